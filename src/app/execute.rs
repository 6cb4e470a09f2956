//! Execution of actions.

use std::path::Path;

use crate::scene::MaterialSpec;
use eframe::egui::{Context, Event, Theme};

use super::actions::Action;
use super::dialogs::{Dialog, FileDialog, Purpose, Variants};
use super::document::Document;
use super::editor::Editor;
use super::layout::is_narrow;
use super::messages::Level;
use super::panels::{Tab, materials};
use super::views::methods::MethodsState;
use super::views::object;
use super::views::tile::TileMode;

impl Editor {
    /// Executes an action. If it would discard unsaved work, a dialog asks the user first.
    pub(super) fn execute(&mut self, ctx: &Context, action: Action) {
        let discards = matches!(
            action,
            Action::New | Action::Open | Action::OpenFile(_) | Action::OpenShipped(_) | Action::Reload | Action::Quit
        );
        if discards && self.document.has_work() {
            self.dialog = Some(Dialog::Unsaved(action));
            return;
        }
        self.execute_now(ctx, action);
    }

    pub(super) fn execute_now(&mut self, ctx: &Context, action: Action) {
        match action {
            Action::New => self.open("default"),
            Action::Open => self.browse(Purpose::OpenScene, ""),
            Action::OpenCapture => self.browse(Purpose::Capture, ""),
            Action::OpenFile(path) => self.open(&path.to_string_lossy()),
            Action::OpenShipped(name) => self.open(&name),
            Action::Reload => {
                if let Some(path) = self.document.path.clone() {
                    self.open(&path.to_string_lossy());
                }
            }
            Action::Save => match self.document.path.clone() {
                Some(_) if self.document.changed_on_disk() => {
                    self.dialog = Some(Dialog::ChangedOnDisk { saving: true });
                }
                Some(path) => self.save(&path),
                None => self.execute_now(ctx, Action::SaveAs),
            },
            Action::SaveAs => {
                let name = format!("{}.toml", self.document.name);
                self.browse(Purpose::SaveScene, &name);
            }
            Action::ExportTable => {
                let name = format!("{}.npz", self.document.name);
                let is_slab = self.document.scene().slab.is_some();
                self.browse(if is_slab { Purpose::ExportSlab } else { Purpose::ExportTable }, &name);
            }
            Action::ExportTile => {
                let name = format!("{}.obj", self.document.name);
                self.browse(Purpose::ExportTile, &name);
            }
            Action::ExportImage => {
                let name = format!("{}.png", self.document.name);
                self.browse(Purpose::ExportImage, &name);
            }
            Action::Sweep if self.document.scene().slab.is_some() => {
                let text = "A slab cannot be swept, because biscale.batch computes only what a tile reflects.";
                self.messages.put(Level::Note, "sweep", text);
            }
            Action::Sweep if self.document.base_name().is_none() => {
                let text = "Save the scene first: the specification of a sweep refers to the file of the scene.";
                self.messages.put(Level::Note, "sweep", text);
            }
            Action::Sweep => {
                let name = format!("{}_sweep.toml", self.document.name);
                self.browse(Purpose::ExportSweep, &name);
            }
            Action::Quit => self.leaving = true,
            Action::Undo => {
                self.document.undo();
                self.scene_changed();
            }
            Action::Redo => {
                self.document.redo();
                self.scene_changed();
            }
            Action::CopyMaterial => self.copy_material(ctx, 0),
            Action::PasteMaterial => self.paste_material("default"),
            Action::CopyPython => {
                ctx.copy_text(super::python_lines::python_lines(&self.document));
                let text = "Lines of Python that compute this material are in the clipboard. They need the Python package biscale.";
                self.messages.put(Level::Note, "python", text);
            }
            Action::Vary => self.dialog = Some(Dialog::Vary(Box::new(Variants::new(self.document.scene())))),
            Action::Frame => {
                let mut scene = (**self.document.scene()).clone();
                object::frame(&mut scene);
                self.document.edit(scene);
            }
            Action::Snapshot => {
                if self.object.comparison.take().is_none() {
                    let (scene, name) = (self.document.scene().clone(), self.document.name.clone());
                    if !self.object.store_comparison(ctx, &scene, &name) {
                        let text = "The image could not be read from the GPU, so there is no image to compare with.";
                        self.messages.put(Level::Error, "comparison", text);
                    }
                }
            }
            Action::SceneTab => self.tab = Tab::Scene,
            Action::CostTab => self.tab = Tab::Cost,
            Action::Methods if !MethodsState::applies_to(self.document.scene()) => {
                let text = "Only a scene with a slab or a colour map has methods to compare.";
                self.messages.put(Level::Note, "methods", text);
            }
            Action::Methods => self.methods.on = !self.methods.on,
            Action::BackToA => {
                if let Some(comparison) = &self.object.comparison {
                    let scene = (*comparison.scene).clone();
                    self.document.edit_as("Back to A", scene);
                    self.scene_changed();
                }
            }
            Action::Theme => {
                self.settings.dark = !self.settings.dark;
                ctx.set_theme(if self.settings.dark { Theme::Dark } else { Theme::Light });
                self.settings.save(self.folder.as_deref());
            }
            Action::ZoomIn => self.zoom(ctx, 1.1),
            Action::ZoomOut => self.zoom(ctx, 1.0 / 1.1),
            Action::ZoomReset => self.zoom(ctx, 0.0),
            Action::Help => self.dialog = Some(Dialog::Help),
            Action::About => self.dialog = Some(Dialog::About),
            Action::Gallery if is_narrow(self.window_width) => self.drawer = !self.drawer,
            Action::Gallery => self.settings.gallery = !self.settings.gallery,
            Action::Pick => {
                self.object.picking = !self.object.picking;
                if !self.object.picking {
                    (self.lobe.viewer, self.tile.picked) = (None, None);
                    if self.tile.show == TileMode::Contribution {
                        self.tile.show = self.tile.before_pick.take().unwrap_or(TileMode::Clay);
                    }
                }
            }
            Action::Exchange => self.exchanged = !self.exchanged,
            Action::Paint => self.tile.set_painting(!self.tile.painting),
        }
    }

    pub(super) fn zoom(&mut self, ctx: &Context, factor: f32) {
        self.settings.zoom = if factor == 0.0 { 1.0 } else { (self.settings.zoom * factor).clamp(0.5, 3.0) };
        ctx.set_zoom_factor(self.settings.zoom);
    }

    pub(super) fn browse(&mut self, purpose: Purpose, name: &str) {
        // Files are saved beside the scene, and opened from the folder of the last file.
        let scene_folder = Some(self.document.base_dir.clone()).filter(|folder| !folder.as_os_str().is_empty());
        let last = self.settings.files.clone().filter(|folder| folder.is_dir());
        let folder = if purpose.saves() { scene_folder.or(last) } else { last.or(scene_folder) }.unwrap_or_default();
        self.dialog = Some(Dialog::Files(FileDialog::new(purpose, &folder, name)));
    }

    /// Opens a file or a shipped scene. After an error the current document stays open.
    pub(super) fn open(&mut self, scene: &str) {
        match Document::open(scene) {
            Ok(document) => self.set_document(document),
            Err(error) => self.messages.put(Level::Error, "open", error.to_string()),
        }
    }

    pub fn set_document(&mut self, document: Document) {
        self.messages.clear("open");
        self.messages.clear("edit");
        if let Some(path) = &document.path {
            self.settings.add_recent(path);
            self.settings.save(self.folder.as_deref());
        }
        (self.object.warnings, self.object.warnings_of) = (Vec::new(), self.document.version());
        let version = self.document.version() + document.version();
        self.document = document;
        // Version numbers continue, so that an image of the old document never matches the new one.
        self.document.start_at(version);
        self.opened = version;
        self.accuracy.forget();
        self.targets.forget();
        self.object.refined_effects = None;
        self.noted_left_out = false;
        self.messages.clear("left out");
        self.is_new = true;
        self.scene_changed();
    }

    /// Updates the slots after a change that did not come from the panels.
    pub(super) fn scene_changed(&mut self) {
        self.slots = materials::slots_of(self.document.scene());
    }

    pub(super) fn save(&mut self, path: &Path) {
        match self.document.save_as(path) {
            Ok(()) => {
                self.messages.clear("save");
                if let Some(recovery) = &self.recovery {
                    recovery.clear();
                }
                self.settings.add_recent(path);
                self.settings.save(self.folder.as_deref());
            }
            Err(error) => {
                let text =
                    format!("Not saved: {error}. Your changes are still here; save under another name or place.");
                self.messages.put(Level::Error, "save", text);
            }
        }
    }

    pub(super) fn copy_material(&mut self, ctx: &Context, index: usize) {
        let scene = self.document.scene();
        let Some(material) = scene.materials.get(index) else { return };
        let found = scene.material_for_slot(&material.name);
        let mut full = MaterialSpec { brdf: found.ok().map(|found| found.brdf.clone()), ..material.clone() };
        // A scene in another folder must find the files, too.
        super::document::make_absolute(&mut full, &self.document.base_dir);
        if let Ok(text) = toml::to_string(&full) {
            self.copied = Some(full);
            ctx.copy_text(text);
        }
    }

    pub(super) fn paste_material(&mut self, slot: &str) {
        let Some(copied) = self.copied.clone() else {
            self.messages.put(Level::Note, "paste", "No material has been copied yet: use Copy at a material first.");
            return;
        };
        self.set_material(slot, copied, "Paste a material");
    }

    /// Gives a slot the material of a shipped scene: that of the slot with the same name, or the default.
    pub(super) fn take_material_of(&mut self, name: &str, slot: &str) {
        let Ok(opened) = crate::scene::open(name, &[]) else { return };
        let materials = &opened.scene.materials;
        let of = |name: &str| materials.iter().find(|material| material.name == name);
        let default = of("default").cloned().unwrap_or_else(materials::grey);
        let mut material = of(slot).cloned().unwrap_or_else(|| default.clone());
        material.brdf = material.brdf.or(default.brdf);
        self.set_material(slot, material, "Take a material of the gallery");
    }

    fn set_material(&mut self, slot: &str, material: MaterialSpec, action: &'static str) {
        self.messages.clear("paste");
        let mut scene = (**self.document.scene()).clone();
        let changed = MaterialSpec { name: slot.to_owned(), ..material };
        match scene.materials.iter_mut().find(|material| material.name == slot) {
            Some(place) => *place = changed,
            None => scene.materials.push(changed),
        }
        match scene.validate() {
            Ok(()) => self.document.edit_as(action, scene),
            Err(error) => self.messages.put(Level::Error, "paste", format!("Not changed: {error}")),
        }
    }

    /// Pastes a material from the clipboard, of this or another editor, unless the user types a text.
    pub(super) fn paste_clipboard(&mut self, ctx: &Context) {
        if self.dialog.is_some() || ctx.text_edit_focused() {
            return;
        }
        let texts = ctx.input(|input| {
            let pasted = |event: &Event| if let Event::Paste(text) = event { Some(text.clone()) } else { None };
            input.events.iter().filter_map(pasted).collect::<Vec<_>>()
        });
        for text in texts {
            match toml::from_str::<MaterialSpec>(&text) {
                Ok(material) => {
                    self.copied = Some(material);
                    self.paste_material("default");
                }
                Err(_) => {
                    let text = "The clipboard holds no material: use Copy at a material, here or in another editor.";
                    self.messages.put(Level::Note, "paste", text);
                }
            }
        }
    }
}
