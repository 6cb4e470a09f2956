//! What actions do, and what dialogs answer.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use biscale::Result;
use biscale::scene::{BrdfSpec, Geometry, Material};
use eframe::egui::{Context, Theme};

use super::actions::Action;
use super::dialogs::{self, Dialog, FileDialog, Purpose};
use super::document::Document;
use super::editor::Editor;
use super::messages::Level;
use super::panels::{self, materials, surface};
use super::views::object;
use super::views::tile::Which;
use super::worker::{ExportAnswer, ExportJob, What};

impl Editor {
    /// Does it, or asks first.
    pub(super) fn perform(&mut self, ctx: &Context, action: Action) {
        let discards = matches!(
            action,
            Action::New | Action::Open | Action::OpenFile(_) | Action::OpenShipped(_) | Action::Reload | Action::Quit
        );
        if discards && self.document.is_dirty() {
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
            Action::ExportPicture => {
                let name = format!("{}.png", self.document.name);
                self.browse(Purpose::ExportPicture, &name);
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
                    self.object.keep(ctx, &scene, &name);
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

    fn zoom(&mut self, ctx: &Context, factor: f32) {
        self.settings.zoom = if factor == 0.0 { 1.0 } else { (self.settings.zoom * factor).clamp(0.5, 3.0) };
        ctx.set_zoom_factor(self.settings.zoom);
    }

    pub(super) fn browse(&mut self, purpose: Purpose, name: &str) {
        let folder = self.document.base_dir.clone();
        self.dialog = Some(Dialog::Files(FileDialog::new(purpose, &folder, name)));
    }

    /// Opens a file or a shipped scene; on failure what is open stays.
    fn open(&mut self, what: &str) {
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
        self.slots = materials::slots_of(&self.document.scene().tile.geometry);
    }

    fn save(&mut self, path: &Path) {
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

    fn copy_material(&mut self, ctx: &Context, index: usize) {
        let scene = self.document.scene();
        let Some(material) = scene.materials.get(index) else { return };
        let found = scene.material_for_slot(&material.name);
        let full = Material { brdf: found.ok().map(|found| found.brdf.clone()), ..material.clone() };
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
        let pasted = Material { name: slot.to_owned(), ..copied };
        match scene.materials.iter_mut().find(|material| material.name == slot) {
            Some(place) => *place = pasted,
            None => scene.materials.push(pasted),
        }
        self.document.edit_as("Paste a material", scene);
    }

    /// What the panel asked for.
    pub(super) fn take_asked(&mut self, ctx: &Context, asked: panels::Asked) {
        if let Some(key) = asked.browse {
            let purpose = match key {
                "mesh" => Purpose::TileMesh,
                "object" => Purpose::ObjectMesh,
                "environment" => Purpose::Environment,
                "color_path" => Purpose::Colors,
                _ if matches!(self.document.scene().tile.geometry, Geometry::Mesh(_)) => Purpose::TileMesh,
                _ => Purpose::Heights,
            };
            self.browse(purpose, "");
        }
        match asked.material {
            Some(materials::Request::Browse { material, term }) => {
                self.browse(Purpose::Measured { material, term }, "")
            }
            Some(materials::Request::Copy { material }) => self.copy_material(ctx, material),
            Some(materials::Request::Paste { slot }) => self.paste_material(&slot),
            None => {}
        }
        if let Some(text) = asked.complaint {
            self.messages.put(Level::Trouble, "edit", text);
        }
    }

    /// The dialog that is open, and what it answers.
    pub(super) fn dialogs(&mut self, ctx: &Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        let stays = match &mut dialog {
            Dialog::Files(files) => match files.ui(ctx) {
                None => true,
                Some(path) => {
                    let purpose = files.purpose.clone();
                    if let Some(path) = path {
                        self.chosen(ctx, purpose, path);
                    }
                    false
                }
            },
            Dialog::Unsaved(action) => {
                let text = format!("\"{}\" has changes that are not saved.", self.document.name);
                match dialogs::question(ctx, "Unsaved changes", &text, &["Save", "Discard", "Cancel"]) {
                    None => true,
                    Some(answer) => {
                        let action = action.clone();
                        if answer == 0 {
                            self.perform_now(ctx, Action::Save);
                            if !self.document.is_dirty() {
                                self.perform_now(ctx, action);
                            }
                        } else if answer == 1 {
                            self.perform_now(ctx, action);
                        }
                        false
                    }
                }
            }
            Dialog::Help => dialogs::help_ui(ctx),
            Dialog::About => {
                let text = format!(
                    "Version {}. The effective BRDF of tiny structures, after Wu, Dorsey and Rushmeier 2011. MIT or Apache-2.0.",
                    env!("CARGO_PKG_VERSION")
                );
                dialogs::question(ctx, "biscale", &text, &["Close"]).is_none()
            }
            Dialog::Recover(found) => {
                let names: Vec<&str> = found.iter().map(|one| one.name.as_str()).collect();
                let text = format!("The editor ended without saving: {}.", names.join(", "));
                match dialogs::question(ctx, "Unsaved work was found", &text, &["Recover", "Throw away", "Later"]) {
                    None => true,
                    Some(answer) => {
                        match (answer, found.first()) {
                            (0, Some(first)) => match first.restore() {
                                Ok(document) => {
                                    self.take_document(document);
                                    first.discard();
                                }
                                Err(error) => self.messages.put(Level::Trouble, "open", error.to_string()),
                            },
                            (1, _) => found.iter().for_each(super::document::Recovered::discard),
                            _ => {}
                        }
                        false
                    }
                }
            }
            Dialog::ChangedOnDisk { saving } => {
                let text = format!("\"{}\" was changed by another program.", self.document.name);
                match dialogs::question(ctx, "The file has changed", &text, &["Keep mine", "Reload", "Later"]) {
                    None => true,
                    Some(answer) => {
                        match (answer, self.document.path.clone()) {
                            (0, Some(path)) if *saving => self.save(&path),
                            (0, _) => self.document.accept_disk(),
                            (1, Some(path)) => self.open(&path.to_string_lossy()),
                            _ => {}
                        }
                        false
                    }
                }
            }
            Dialog::Table { path, theta, phi } => match dialogs::export::table_ui(ctx, path, theta, phi) {
                None => true,
                Some(answer) => {
                    if answer == dialogs::export::Answer::Export {
                        self.export(path.clone(), What::Table { theta: *theta, phi: *phi });
                    }
                    false
                }
            },
            Dialog::Picture { path, width, height } => match dialogs::export::picture_ui(ctx, path, width, height) {
                None => true,
                Some(answer) => {
                    if answer == dialogs::export::Answer::Export {
                        self.export(path.clone(), What::Picture { size: [*width, *height] });
                    }
                    false
                }
            },
        };
        if stays && self.dialog.is_none() {
            self.dialog = Some(dialog);
        }
    }

    /// A file was chosen.
    fn chosen(&mut self, ctx: &Context, purpose: Purpose, path: PathBuf) {
        let mut scene = (**self.document.scene()).clone();
        let near = self.near(&path);
        match purpose {
            Purpose::OpenScene => return self.perform_now(ctx, Action::OpenFile(path)),
            Purpose::SaveScene => return self.save(&path),
            Purpose::Measured { material, term } => match materials::measured(&near) {
                Some(measured) => materials::set_term(&mut scene, material, term, measured),
                None => return self.unknown_file(&path),
            },
            Purpose::Heights => match surface::of_file(&near, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::TileMesh => match surface::of_file(&near, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::Colors => {
                if let Some(place) = super::document::color_path(&mut scene.tile.geometry) {
                    *place = Some(near);
                }
            }
            Purpose::ObjectMesh => {
                "mesh".clone_into(&mut scene.object.kind);
                scene.object.path = Some(near);
            }
            Purpose::Environment => scene.light.environment = near.to_string_lossy().into_owned(),
            Purpose::SaveHeights => return self.save_image(&path, false),
            Purpose::SaveColors => return self.save_image(&path, true),
            Purpose::ExportTable => {
                match biscale::export::check_ending(&path) {
                    Ok(()) => self.dialog = Some(Dialog::Table { path, theta: 16, phi: 64 }),
                    Err(error) => self.messages.put(Level::Trouble, "export", error.to_string()),
                }
                return;
            }
            Purpose::ExportPicture => {
                self.dialog = Some(Dialog::Picture { path, width: 1024, height: 1024 });
                return;
            }
        }
        self.try_edit(scene);
    }

    fn try_edit(&mut self, scene: biscale::scene::Scene) {
        let checked: Result<()> = scene.validate();
        match checked {
            Ok(()) => self.document.edit(scene),
            Err(error) => self.messages.put(Level::Trouble, "edit", error.to_string()),
        }
        self.scene_changed();
    }

    /// The path as the scene should name it: relative where the file lies under the scene's folder.
    fn near(&self, path: &Path) -> PathBuf {
        let base = &self.document.base_dir;
        match path.strip_prefix(base) {
            Ok(inside) if !base.as_os_str().is_empty() => inside.to_owned(),
            _ => path.to_owned(),
        }
    }

    fn unknown_file(&mut self, path: &Path) {
        let text = format!(
            "{}: found a file of another kind; scenes end in .toml, measured BRDFs in .binary or .bsdf, meshes in .obj, \
             skies in .hdr or .exr, heights in .png.",
            path.display()
        );
        self.messages.put(Level::Trouble, "open", text);
    }

    /// A file dropped on the window goes where its ending says.
    pub(super) fn dropped(&mut self, ctx: &Context, path: PathBuf) {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        match ending.as_str() {
            "toml" => self.perform(ctx, Action::OpenFile(path)),
            "binary" | "bsdf" | "bin" | "npz" => {
                let mut scene = (**self.document.scene()).clone();
                if scene.materials.is_empty() {
                    scene.materials.push(materials::grey());
                }
                let near = self.near(&path);
                if let (Some(term), Some(first)) = (materials::measured(&near), scene.materials.first_mut()) {
                    first.brdf = Some(BrdfSpec::One(term));
                }
                self.try_edit(scene);
            }
            "obj" => self.chosen(ctx, Purpose::TileMesh, path),
            "hdr" | "exr" => self.chosen(ctx, Purpose::Environment, path),
            "png" | "jpg" | "jpeg" | "tif" | "tiff" => self.chosen(ctx, Purpose::Heights, path),
            _ => self.unknown_file(&path),
        }
    }

    fn export(&mut self, path: PathBuf, what: What) {
        if let Some(worker) = &self.exports {
            self.messages.clear("export");
            self.exporting = Some((0.0, "Starting"));
            worker.ask(ExportJob { loaded: Arc::new(self.document.loaded()), path, what });
        }
    }

    pub(super) fn take_export(&mut self, answer: ExportAnswer) {
        match answer {
            ExportAnswer::Progress(part, what) => {
                if let Some(exporting) = &mut self.exporting {
                    *exporting = (part, what);
                }
            }
            ExportAnswer::Done(text) => {
                self.exporting = None;
                self.messages.put(Level::Note, "export", text);
            }
            ExportAnswer::Failed(text) => {
                self.exporting = None;
                self.messages.put(Level::Trouble, "export", format!("Not exported: {text}"));
            }
            ExportAnswer::Cancelled => self.exporting = None,
        }
    }
}
