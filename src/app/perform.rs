//! What actions do.

use std::path::Path;

use crate::scene::MaterialSpec;
use eframe::egui::{Context, Event, Theme};

use super::actions::Action;
use super::dialogs::{Dialog, FileDialog, Purpose};
use super::document::Document;
use super::editor::Editor;
use super::messages::Level;
use super::panels::materials;
use super::views::object;
use super::views::tile::Which;

impl Editor {
    /// Does it, or asks first.
    pub(super) fn perform(&mut self, ctx: &Context, action: Action) {
        let discards = matches!(
            action,
            Action::New | Action::Open | Action::OpenFile(_) | Action::OpenShipped(_) | Action::Reload | Action::Quit
        );
        if discards && self.document.has_work() {
            self.dialog = Some(Dialog::Unsaved(action));
            return;
        }
        self.perform_now(ctx, action);
    }

    pub(super) fn perform_now(&mut self, ctx: &Context, action: Action) {
        match action {
            Action::New => self.open("default"),
            Action::Open => self.browse(Purpose::OpenScene, ""),
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
                None => self.perform_now(ctx, Action::SaveAs),
            },
            Action::SaveAs => {
                let name = format!("{}.toml", self.document.name);
                self.browse(Purpose::SaveScene, &name);
            }
            Action::ExportTable => {
                let name = format!("{}.npz", self.document.name);
                self.browse(Purpose::ExportTable, &name);
            }
            Action::ExportTile => {
                let name = format!("{}.obj", self.document.name);
                self.browse(Purpose::ExportTile, &name);
            }
            Action::ExportImage => {
                let name = format!("{}.png", self.document.name);
                self.browse(Purpose::ExportImage, &name);
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
            Action::Frame => {
                let mut scene = (**self.document.scene()).clone();
                object::frame(&mut scene);
                self.document.edit(scene);
            }
            Action::Snapshot => {
                if self.object.kept.take().is_none() {
                    let (scene, name) = (self.document.scene().clone(), self.document.name.clone());
                    if !self.object.keep(ctx, &scene, &name) {
                        let text = "The picture could not be read from the graphics device, so there is nothing to compare with.";
                        self.messages.put(Level::Trouble, "kept", text);
                    }
                }
            }
            Action::BackToA => {
                if let Some(kept) = &self.object.kept {
                    let scene = (*kept.scene).clone();
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
            Action::Gallery => self.settings.gallery = !self.settings.gallery,
            Action::Pick => {
                self.object.picking = !self.object.picking;
                if !self.object.picking {
                    (self.lobe.viewer, self.tile.picked) = (None, None);
                    if self.tile.show == Which::Contribution {
                        self.tile.show = Which::Clay;
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
        // What belongs to a scene is saved beside it; what is opened lies where the last file was.
        let own = Some(self.document.base_dir.clone()).filter(|folder| !folder.as_os_str().is_empty());
        let last = self.settings.files.clone().filter(|folder| folder.is_dir());
        let folder = if purpose.saves() { own.or(last) } else { last.or(own) }.unwrap_or_default();
        self.dialog = Some(Dialog::Files(FileDialog::new(purpose, &folder, name)));
    }

    /// Opens a file or a shipped scene; on failure what is open stays.
    pub(super) fn open(&mut self, what: &str) {
        match Document::open(what) {
            Ok(document) => self.take_document(document),
            Err(error) => self.messages.put(Level::Trouble, "open", error.to_string()),
        }
    }

    pub fn take_document(&mut self, document: Document) {
        self.messages.clear("open");
        self.messages.clear("edit");
        if let Some(path) = &document.path {
            self.settings.add_recent(path);
            self.settings.save(self.folder.as_deref());
        }
        let version = self.document.version() + document.version();
        self.document = document;
        // Versions go on: a picture of the old document is never taken for one of the new.
        self.document.start_at(version);
        self.scene_changed();
    }

    /// After changes that did not come from the panels.
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
                self.messages.put(Level::Trouble, "save", text);
            }
        }
    }

    pub(super) fn copy_material(&mut self, ctx: &Context, index: usize) {
        let scene = self.document.scene();
        let Some(material) = scene.materials.get(index) else { return };
        let found = scene.material_for_slot(&material.name);
        let mut full = MaterialSpec { brdf: found.ok().map(|found| found.brdf.clone()), ..material.clone() };
        // Another scene, elsewhere, is to find the files too.
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
        self.messages.clear("paste");
        let mut scene = (**self.document.scene()).clone();
        let pasted = MaterialSpec { name: slot.to_owned(), ..copied };
        match scene.materials.iter_mut().find(|material| material.name == slot) {
            Some(place) => *place = pasted,
            None => scene.materials.push(pasted),
        }
        match scene.validate() {
            Ok(()) => self.document.edit_as("Paste a material", scene),
            Err(error) => self.messages.put(Level::Trouble, "paste", format!("Not pasted: {error}")),
        }
    }

    /// Text that comes from the clipboard while no text is typed: a material, of this editor or another.
    pub(super) fn take_pasted(&mut self, ctx: &Context) {
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
