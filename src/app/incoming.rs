//! Handling of chosen and dropped files, of requests from the panels, and of exports.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::base::Result;
use crate::export::slab::SlabFormat;
use crate::export::tile::TileOptions;
use crate::metrics::mirror_biased_pairs;
use crate::scene::{BrdfSpec, Geometry};
use crate::slab::capture::rig;
use eframe::egui::Context;

use super::actions::Action;
use super::dialogs::{Dialog, FileUse, Offer, Purpose, Sweep};
use super::editor::Editor;
use super::messages::Level;
use super::panels::{self, materials, surface};
use super::views::brushes::PaintLayer;
use super::worker::{ExportJob, ExportKind, ExportResult, TableChoice};

impl Editor {
    /// Applies the requests of the panels.
    pub(super) fn apply_requests(&mut self, ctx: &Context, requests: panels::PanelRequests) {
        if let Some(key) = requests.browse {
            let purpose = match key {
                "mesh" => Purpose::TileMesh,
                "object" => Purpose::ObjectMesh,
                "environment" => Purpose::Environment,
                "color_path" => Purpose::Paint(PaintLayer::Colors),
                "slot_path" => Purpose::Paint(PaintLayer::Slots),
                _ if matches!(self.document.scene().tile.geometry, Geometry::Mesh(_)) => Purpose::TileMesh,
                _ => Purpose::Paint(PaintLayer::Heights),
            };
            self.browse(purpose, "");
        }
        match requests.material {
            Some(materials::MaterialRequest::Browse { material, term }) => {
                self.browse(Purpose::Measured { material, term }, "")
            }
            Some(materials::MaterialRequest::Copy { material }) => self.copy_material(ctx, material),
            Some(materials::MaterialRequest::Paste { slot }) => self.paste_material(&slot),
            Some(materials::MaterialRequest::FromScene { slot, scene }) => self.take_material_of(scene, &slot),
            None => {}
        }
        if let Some(file) = requests.slab_file {
            self.browse(Purpose::Slab(file), "");
        }
        if let Some(place) = requests.driver_image {
            self.browse(Purpose::DriverImage(place), "");
        }
        self.tile.changing = requests.changing;
        if let Some(text) = requests.error {
            self.messages.put(Level::Error, "edit", text);
        }
    }

    /// Uses the file that the user chose.
    pub(super) fn use_file(&mut self, ctx: &Context, purpose: Purpose, path: PathBuf) {
        // The folder of a scene counts once the scene is saved.
        if purpose != Purpose::SaveScene {
            self.settings.files = path.parent().map(Path::to_owned);
        }
        let mut scene = (**self.document.scene()).clone();
        let relative = self.relative_path(&path);
        match purpose {
            Purpose::OpenScene => match Offer::of(&path) {
                Some(offer) => {
                    self.dialog = Some(Dialog::Offer(offer));
                    return;
                }
                None => return self.execute_now(ctx, Action::OpenFile(path)),
            },
            Purpose::SaveScene => {
                self.save(&path);
                if !self.document.is_dirty() {
                    self.settings.files = path.parent().map(Path::to_owned);
                }
                return;
            }
            Purpose::Capture => {
                self.capture.open(path.parent().map(Path::to_owned).unwrap_or_default());
                return;
            }
            Purpose::Measured { material, term } => match materials::measured(&relative) {
                Some(measured) => {
                    let name = scene.materials.get(material).map(|material| material.name.clone());
                    materials::set_term(&mut scene, material, term, measured);
                    self.as_measured(&mut scene, material, name.as_deref());
                }
                None => return self.unknown_file(&path),
            },
            Purpose::Slab(file) => panels::slab::set_file(&mut scene, file, relative),
            Purpose::DriverImage(place) => panels::color_map::set_image(&mut scene, place, relative),
            Purpose::Paint(PaintLayer::Heights) => match surface::of_file(&relative, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::TileMesh => match surface::of_file(&relative, &scene) {
                Some(geometry) => scene.tile.geometry = geometry,
                None => return self.unknown_file(&path),
            },
            Purpose::Paint(PaintLayer::Colors) => scene.tile.color_path = Some(relative),
            Purpose::Paint(PaintLayer::Slots) => scene.tile.slot_path = Some(relative),
            Purpose::ObjectMesh => {
                "mesh".clone_into(&mut scene.object.kind);
                scene.object.path = Some(relative);
            }
            Purpose::Environment => scene.light.environment = relative.to_string_lossy().into_owned(),
            Purpose::SavePaint(layer) => return self.save_image(&path, layer),
            Purpose::ExportTable | Purpose::ExportSlab
                if path.extension().is_some_and(|ending| ending == "gltf" || ending == "mtlx") =>
            {
                self.dialog = Some(Dialog::Fit { path });
                return;
            }
            Purpose::ExportTile => {
                self.dialog = Some(Dialog::Tile { path, options: TileOptions::default() });
                return;
            }
            Purpose::ExportTable | Purpose::ExportSlab => {
                let checked = match purpose {
                    Purpose::ExportSlab => SlabFormat::of(&path).map(drop),
                    _ => crate::export::check_ending(&path),
                };
                match checked {
                    Ok(()) => self.dialog = Some(Dialog::Table { path, choice: TableChoice::default() }),
                    Err(error) => self.messages.put(Level::Error, "export", error.to_string()),
                }
                return;
            }
            Purpose::ExportSweep => {
                let base = self.document.base_name().unwrap_or_else(|| self.document.name.clone());
                let sweep = Sweep::new(&scene, base, self.material_ms());
                self.dialog = Some(Dialog::Sweep { path, sweep });
                return;
            }
            Purpose::ExportImage => {
                self.dialog = Some(Dialog::Image { path, width: 1024, height: 1024 });
                return;
            }
        }
        self.try_edit(scene);
    }

    /// Milliseconds of the last refined material without its pairs of directions, and of a pair.
    fn material_ms(&self) -> [f64; 2] {
        const OF_IMAGES: [&str; 5] = ["picture table", "g-buffer", "shadows", "shading", "tone"];
        let stages = self.object.stages.iter().filter(|(name, _)| !OF_IMAGES.contains(name));
        let Some(brdf) = self.object.preview.as_ref().and_then(|preview| preview.brdf.as_ref()) else {
            return [stages.map(|(_, ms)| ms).sum(), 0.0];
        };
        let pairs = mirror_biased_pairs(64, 1);
        let start = Instant::now();
        let sum: f32 = pairs.iter().map(|pair| brdf.eval(pair.i, pair.o).x).sum();
        std::hint::black_box(sum);
        [stages.map(|(_, ms)| ms).sum(), start.elapsed().as_secs_f64() * 1e3 / pairs.len() as f64]
    }

    /// Removes the colour of a material that became a measured paint, so that the paint looks as measured.
    fn as_measured(&mut self, scene: &mut crate::scene::Scene, material: usize, name: Option<&str>) {
        self.messages.clear("measured");
        let Some(target) = scene.materials.get_mut(material) else { return };
        let mut notes = Vec::new();
        if target.color != glam::Vec3::ONE {
            target.color = glam::Vec3::ONE;
            notes.push("its colour is white, so that the paint looks as measured");
        }
        if target.brdf.as_ref().is_some_and(|brdf| brdf.terms().len() > 1) {
            notes.push("the other lobes of the material are still added to it (× removes one)");
        }
        if !notes.is_empty() {
            let name = panels::fields::display_name(name.unwrap_or("default"));
            self.messages.put(Level::Note, "measured", format!("{name}: {}.", notes.join("; ")));
        }
    }

    pub(super) fn try_edit(&mut self, scene: crate::scene::Scene) {
        let checked: Result<()> = scene.validate();
        match checked {
            Ok(()) => self.document.edit(scene),
            Err(error) => self.messages.put(Level::Error, "edit", error.to_string()),
        }
        self.scene_changed();
    }

    /// The path as the scene stores it: relative if the file lies under the scene's folder.
    pub(super) fn relative_path(&self, path: &Path) -> PathBuf {
        let base = &self.document.base_dir;
        match path.strip_prefix(base) {
            Ok(inside) if !base.as_os_str().is_empty() => inside.to_owned(),
            _ => path.to_owned(),
        }
    }

    pub(super) fn unknown_file(&mut self, path: &Path) {
        let text = format!(
            "{}: found an unknown kind of file; expected a scene (.toml), a measured BRDF (.binary, .bsdf, .npz), \
             a mesh (.obj), an environment (.hdr, .exr) or an image (.png, .jpg, .tif).",
            path.display()
        );
        self.messages.put(Level::Error, "open", text);
    }

    /// Uses a file in the open scene.
    pub(super) fn use_as(&mut self, ctx: &Context, path: &Path, used: FileUse) {
        let purpose = match used {
            FileUse::Material => return self.dropped(ctx, path.to_owned()),
            FileUse::Tile => Purpose::TileMesh,
            FileUse::Object => Purpose::ObjectMesh,
            FileUse::Environment => Purpose::Environment,
            FileUse::Heights => Purpose::Paint(PaintLayer::Heights),
            FileUse::Colors => Purpose::Paint(PaintLayer::Colors),
        };
        self.use_file(ctx, purpose, path.to_owned());
    }

    /// Uses a file that was dropped on the window, depending on its extension.
    pub(super) fn dropped(&mut self, ctx: &Context, path: PathBuf) {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        match ending.as_str() {
            "toml" if path.file_name().is_some_and(|name| name == rig::FILE) => {
                self.use_file(ctx, Purpose::Capture, path)
            }
            "toml" => self.execute(ctx, Action::OpenFile(path)),
            "binary" | "bsdf" | "bin" | "npz" => {
                let mut scene = (**self.document.scene()).clone();
                if scene.materials.is_empty() {
                    scene.materials.push(materials::grey());
                }
                let relative = self.relative_path(&path);
                let at = scene.materials.iter().position(|material| material.name == "default").unwrap_or(0);
                if let (Some(term), Some(target)) = (materials::measured(&relative), scene.materials.get_mut(at)) {
                    target.brdf = Some(BrdfSpec::One(term));
                }
                self.as_measured(&mut scene, at, None);
                self.try_edit(scene);
            }
            "obj" => self.use_file(ctx, Purpose::TileMesh, path),
            "hdr" | "exr" => self.use_file(ctx, Purpose::Environment, path),
            "png" | "jpg" | "jpeg" | "tif" | "tiff" => self.use_file(ctx, Purpose::Paint(PaintLayer::Heights), path),
            _ => self.unknown_file(&path),
        }
    }

    pub(super) fn export(&mut self, path: PathBuf, kind: ExportKind) {
        if let Some(worker) = &self.background.exports {
            self.messages.clear("export");
            self.exporting = Some((0.0, "Starting"));
            let (loaded, scene_file) = (Arc::new(self.document.loaded()), self.document.path.clone());
            worker.submit(ExportJob { loaded, scene_file, path, kind });
        }
    }

    pub(super) fn receive_export(&mut self, answer: ExportResult) {
        match answer {
            ExportResult::Progress(fraction, task) => {
                if let Some(exporting) = &mut self.exporting {
                    *exporting = (fraction, task);
                }
            }
            ExportResult::Done(text) => {
                self.exporting = None;
                self.messages.put(Level::Note, "export", text);
            }
            ExportResult::Failed(text) => {
                self.exporting = None;
                self.messages.put(Level::Error, "export", format!("Not exported: {text}"));
            }
            // The status line is cleared at the cancellation, and may already show the next export.
            ExportResult::Cancelled => {}
        }
    }
}
