//! What comes in and goes out: files that were chosen or dropped, what the panels asked for, exports.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::base::Result;
use crate::export::tile::TileOptions;
use crate::scene::{BrdfSpec, Geometry};
use eframe::egui::Context;

use super::actions::Action;
use super::dialogs::{Dialog, Purpose};
use super::editor::Editor;
use super::messages::Level;
use super::panels::{self, materials, surface};
use super::views::brushes::Layer;
use super::worker::{ExportAnswer, ExportJob, TableChoice, What};

impl Editor {
    /// What the panel asked for.
    pub(super) fn take_asked(&mut self, ctx: &Context, asked: panels::Asked) {
        if let Some(key) = asked.browse {
            let purpose = match key {
                "mesh" => Purpose::TileMesh,
                "object" => Purpose::ObjectMesh,
                "environment" => Purpose::Environment,
                "color_path" => Purpose::Paint(Layer::Colors),
                "slot_path" => Purpose::Paint(Layer::Slots),
                _ if matches!(self.document.scene().tile.geometry, Geometry::Mesh(_)) => Purpose::TileMesh,
                _ => Purpose::Paint(Layer::Heights),
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

    /// A file was chosen.
    pub(super) fn chosen(&mut self, ctx: &Context, purpose: Purpose, path: PathBuf) {
        self.settings.files = path.parent().map(Path::to_owned);
        let mut scene = (**self.document.scene()).clone();
        let near = self.near(&path);
        match purpose {
            Purpose::OpenScene => return self.perform_now(ctx, Action::OpenFile(path)),
            Purpose::SaveScene => return self.save(&path),
            Purpose::Measured { material, term } => match materials::measured(&near) {
                Some(measured) => {
                    let name = scene.materials.get(material).map(|material| material.name.clone());
                    materials::set_term(&mut scene, material, term, measured);
                    self.as_measured(&mut scene, material, name.as_deref());
                }
                None => return self.unknown_file(&path),
            },
            Purpose::Paint(Layer::Heights) => match surface::of_file(&near, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::TileMesh => match surface::of_file(&near, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::Paint(Layer::Colors) => scene.tile.color_path = Some(near),
            Purpose::Paint(Layer::Slots) => scene.tile.slot_path = Some(near),
            Purpose::ObjectMesh => {
                "mesh".clone_into(&mut scene.object.kind);
                scene.object.path = Some(near);
            }
            Purpose::Environment => scene.light.environment = near.to_string_lossy().into_owned(),
            Purpose::SavePaint(layer) => return self.save_image(&path, layer),
            Purpose::ExportTable if path.extension().is_some_and(|ending| ending == "gltf" || ending == "mtlx") => {
                self.dialog = Some(Dialog::Fit { path });
                return;
            }
            Purpose::ExportTile => {
                self.dialog = Some(Dialog::Tile { path, options: TileOptions::default() });
                return;
            }
            Purpose::ExportTable => {
                match crate::export::check_ending(&path) {
                    Ok(()) => self.dialog = Some(Dialog::Table { path, choice: TableChoice::default() }),
                    Err(error) => self.messages.put(Level::Trouble, "export", error.to_string()),
                }
                return;
            }
            Purpose::ExportImage => {
                self.dialog = Some(Dialog::Image { path, width: 1024, height: 1024 });
                return;
            }
        }
        self.try_edit(scene);
    }

    /// A paint that was measured is shown as it was: no tint of the material before remains, and that is said.
    fn as_measured(&mut self, scene: &mut crate::scene::Scene, material: usize, name: Option<&str>) {
        self.messages.clear("measured");
        let Some(place) = scene.materials.get_mut(material) else { return };
        let mut said = Vec::new();
        if place.color != glam::Vec3::ONE {
            place.color = glam::Vec3::ONE;
            said.push("its colour is white now, so that the paint looks as it was measured");
        }
        if place.brdf.as_ref().is_some_and(|brdf| brdf.terms().len() > 1) {
            said.push("the other lobes of the material are still added to it (× removes one)");
        }
        if !said.is_empty() {
            let name = panels::fields::words(name.unwrap_or("default"));
            self.messages.put(Level::Note, "measured", format!("{name}: {}.", said.join("; ")));
        }
    }

    pub(super) fn try_edit(&mut self, scene: crate::scene::Scene) {
        let checked: Result<()> = scene.validate();
        match checked {
            Ok(()) => self.document.edit(scene),
            Err(error) => self.messages.put(Level::Trouble, "edit", error.to_string()),
        }
        self.scene_changed();
    }

    /// The path as the scene should name it: relative where the file lies under the scene's folder.
    pub(super) fn near(&self, path: &Path) -> PathBuf {
        let base = &self.document.base_dir;
        match path.strip_prefix(base) {
            Ok(inside) if !base.as_os_str().is_empty() => inside.to_owned(),
            _ => path.to_owned(),
        }
    }

    pub(super) fn unknown_file(&mut self, path: &Path) {
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
                let at = scene.materials.iter().position(|material| material.name == "default").unwrap_or(0);
                if let (Some(term), Some(place)) = (materials::measured(&near), scene.materials.get_mut(at)) {
                    place.brdf = Some(BrdfSpec::One(term));
                }
                self.as_measured(&mut scene, at, None);
                self.try_edit(scene);
            }
            "obj" => self.chosen(ctx, Purpose::TileMesh, path),
            "hdr" | "exr" => self.chosen(ctx, Purpose::Environment, path),
            "png" | "jpg" | "jpeg" | "tif" | "tiff" => self.chosen(ctx, Purpose::Paint(Layer::Heights), path),
            _ => self.unknown_file(&path),
        }
    }

    pub(super) fn export(&mut self, path: PathBuf, what: What) {
        if let Some(worker) = &self.background.exports {
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
            // Whoever gave it up took it off the status line; by now the next export may stand there.
            ExportAnswer::Cancelled => {}
        }
    }
}
