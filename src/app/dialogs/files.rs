//! A file dialog with a typed path and a list. It needs no desktop portal and works the same on every system.

use std::path::{Path, PathBuf};

use eframe::egui::{self, Key, RichText, ScrollArea, Ui};

use super::within;
use crate::app::panels::{DriverPlace, SlabFile};
use crate::app::views::brushes::PaintLayer;

/// Purpose for which the user chooses a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Purpose {
    OpenScene,
    SaveScene,
    /// A measured BRDF for a term of a material.
    Measured {
        material: usize,
        term: usize,
    },
    /// An image that drives a layer of the colour map.
    DriverImage(DriverPlace),
    /// A file of the slab.
    Slab(SlabFile),
    /// The rig of a folder of photographs.
    Capture,
    /// An image to paint on.
    Paint(PaintLayer),
    TileMesh,
    ObjectMesh,
    Environment,
    SavePaint(PaintLayer),
    ExportTable,
    /// The material of a scene with a slab.
    ExportSlab,
    ExportTile,
    ExportImage,
    ExportSweep,
}

impl Purpose {
    fn title(&self) -> &'static str {
        match self {
            Self::OpenScene => "Open a scene",
            Self::SaveScene => "Save the scene",
            Self::Measured { .. } => "Open a measured BRDF",
            Self::DriverImage(_) => "Open an image for the colour map",
            Self::Slab(SlabFile::Table { .. }) => "Open a table of slopes",
            Self::Slab(SlabFile::Tile { .. }) => "Open a scene whose tile is the face",
            Self::Slab(SlabFile::Svbtdf) => "Open a captured sheet",
            Self::Slab(SlabFile::Background) => "Open an image for the background",
            Self::Capture => "Open the rig.toml of a capture folder",
            Self::Paint(PaintLayer::Heights) => "Open an image of heights",
            Self::Paint(PaintLayer::Colors) => "Open an image of colours",
            Self::Paint(PaintLayer::Slots) => "Open an image of materials",
            Self::TileMesh => "Open a mesh for the tile",
            Self::ObjectMesh => "Open an object",
            Self::Environment => "Open an environment",
            Self::SavePaint(PaintLayer::Heights) => "Save the heights",
            Self::SavePaint(PaintLayer::Colors) => "Save the colours",
            Self::SavePaint(PaintLayer::Slots) => "Save the painted materials",
            Self::ExportTable | Self::ExportSlab => "Export the material",
            Self::ExportTile => "Export the tile",
            Self::ExportImage => "Export the image",
            Self::ExportSweep => "Save the specification of a sweep",
        }
    }

    pub fn endings(&self) -> &'static [&'static str] {
        match self {
            Self::OpenScene
            | Self::SaveScene
            | Self::Capture
            | Self::ExportSweep
            | Self::Slab(SlabFile::Tile { .. }) => &["toml"],
            Self::Slab(SlabFile::Table { .. }) => &["csv"],
            Self::Slab(SlabFile::Svbtdf) => &["npz"],
            Self::Slab(SlabFile::Background) => &["png", "jpg", "jpeg", "hdr", "exr"],
            Self::Measured { .. } => &["binary", "bsdf", "bin", "npz"],
            Self::DriverImage(_) | Self::Paint(_) => &["png", "jpg", "jpeg", "tif", "tiff", "hdr", "exr"],
            Self::TileMesh | Self::ObjectMesh => &["obj"],
            Self::Environment => &["hdr", "exr"],
            Self::SavePaint(PaintLayer::Slots) => &["png"],
            Self::SavePaint(_) | Self::ExportImage => &["png", "exr"],
            Self::ExportTable => &["npz", "csv", "exr", "bsdf", "binary", "xml", "bin", "astm", "gltf", "mtlx"],
            Self::ExportSlab => &["npz", "xml", "gltf", "mtlx"],
            Self::ExportTile => &["obj", "stl", "png", "svg", "pdf"],
        }
    }

    pub fn saves(&self) -> bool {
        matches!(
            self,
            Self::ExportTable
                | Self::ExportSlab
                | Self::ExportTile
                | Self::ExportImage
                | Self::ExportSweep
                | Self::SaveScene
                | Self::SavePaint(_)
        )
    }
}

/// An open dialog.
#[derive(Debug)]
pub struct FileDialog {
    pub purpose: Purpose,
    folder: PathBuf,
    /// Text field: a name in the folder, or any path.
    pub typed: String,
    /// Names in `folder`, folders first. The flag marks folders.
    entries: Vec<(String, bool)>,
    /// True if the list shows all files, not only those with a matching ending.
    all: bool,
    error: Option<String>,
    /// The existing file that the next confirmation overwrites.
    overwrite: Option<PathBuf>,
    needs_focus: bool,
}

impl FileDialog {
    pub fn new(purpose: Purpose, folder: &Path, name: &str) -> Self {
        let here = std::env::current_dir().unwrap_or_default();
        let folder = if folder.as_os_str().is_empty() { here } else { std::path::absolute(folder).unwrap_or(here) };
        let mut dialog = Self {
            purpose,
            folder,
            typed: name.to_owned(),
            entries: Vec::new(),
            all: false,
            error: None,
            overwrite: None,
            needs_focus: true,
        };
        dialog.list();
        dialog
    }

    fn list(&mut self) {
        self.error = None;
        self.entries.clear();
        let listing = match std::fs::read_dir(&self.folder) {
            Ok(listing) => listing,
            Err(error) => {
                self.error = Some(format!("{}: {error}", self.folder.display()));
                return;
            }
        };
        let endings = self.purpose.endings();
        for entry in listing.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_folder = entry.path().is_dir();
            let fits = Path::new(&name).extension().and_then(|ending| ending.to_str());
            let fits = fits.is_some_and(|ending| endings.contains(&ending.to_ascii_lowercase().as_str()));
            if !name.starts_with('.') && (is_folder || fits || self.all) {
                self.entries.push((name, is_folder));
            }
        }
        self.entries.sort_by_key(|(name, is_folder)| (!is_folder, name.to_lowercase()));
    }

    /// Draws the dialog. Returns `Some(Some(path))` for a choice and `Some(None)` if the user cancels.
    pub fn ui(&mut self, ctx: &egui::Context) -> Option<Option<PathBuf>> {
        let mut result = None;
        let modal = egui::Modal::new(egui::Id::unique("files")).show(ctx, |ui| {
            ui.set_width(within(ctx, 560.0, 40.0, 0));
            ui.heading(self.purpose.title());
            ui.add_space(4.0);
            result = self.body(ui);
        });
        if modal.should_close() && result.is_none() {
            result = Some(None);
        }
        result
    }

    fn body(&mut self, ui: &mut Ui) -> Option<Option<PathBuf>> {
        let mut go_to = None;
        ui.horizontal(|ui| {
            if ui.button("Up").on_hover_text("Open the parent folder").clicked() {
                go_to = self.folder.parent().map(Path::to_owned);
            }
            if ui.button("Home").clicked() {
                go_to = std::env::var_os("HOME").or_else(|| std::env::var_os("USERPROFILE")).map(PathBuf::from);
            }
            ui.add(egui::Label::new(RichText::new(self.folder.display().to_string()).weak()).truncate());
        });
        let mut chosen = false;
        egui::Frame::canvas(ui.style()).inner_margin(4).show(ui, |ui| {
            let height = within(ui.ctx(), 280.0, 240.0, 1);
            ScrollArea::vertical().max_height(height).min_scrolled_height(height).auto_shrink([false, false]).show(
                ui,
                |ui| {
                    for (name, is_folder) in &self.entries {
                        let text = if *is_folder { format!("{name}/") } else { name.clone() };
                        let response = ui.selectable_label(!is_folder && *name == self.typed, text);
                        if response.clicked() {
                            if *is_folder {
                                go_to = Some(self.folder.join(name));
                            } else {
                                self.typed.clone_from(name);
                            }
                        }
                        chosen |= response.double_clicked() && !is_folder;
                    }
                    if self.entries.is_empty() {
                        let kinds = self.purpose.endings().join(", .");
                        ui.weak(format!("No .{kinds} here."));
                    }
                },
            );
        });
        if let Some(folder) = go_to {
            self.folder = folder;
            self.list();
            self.needs_focus = true;
        }
        let field = ui.horizontal(|ui| {
            let label = ui.label(if self.purpose.saves() { "Name or path" } else { "Path" });
            let width = ui.available_width();
            ui.add(egui::TextEdit::singleline(&mut self.typed).desired_width(width)).labelled_by(label.id)
        });
        if let Some(formats) = super::formats::of(&self.purpose) {
            super::formats::ui(ui, formats, &mut self.typed);
        }
        if self.needs_focus {
            field.inner.request_focus();
            self.needs_focus = false;
        }
        if field.inner.changed() {
            self.overwrite = None;
        }
        chosen |= field.inner.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if let Some(error) = &self.error {
            ui.colored_label(ui.visuals().warn_fg_color, error);
        }
        let mut left = false;
        ui.horizontal(|ui| {
            if ui.checkbox(&mut self.all, "All files").changed() {
                self.list();
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let label = match (&self.overwrite, self.purpose.saves()) {
                    (Some(_), _) => "Replace",
                    (None, true) => "Save",
                    (None, false) => "Open",
                };
                chosen |= ui.button(label).clicked();
                left = ui.button("Cancel").clicked();
            });
        });
        if left {
            return Some(None);
        }
        if chosen { self.choose().map(Some) } else { None }
    }

    /// Returns the typed path if it is usable. A folder is opened in the list instead.
    fn choose(&mut self) -> Option<PathBuf> {
        let typed = self.typed.trim();
        if typed.is_empty() {
            self.error = Some("Type a name, or choose one from the list.".to_owned());
            return None;
        }
        let mut path = self.folder.join(typed);
        if path.is_dir() {
            self.folder = path;
            self.typed.clear();
            self.list();
            self.needs_focus = true;
            return None;
        }
        if !self.purpose.saves() {
            if path.is_file() {
                return Some(path);
            }
            self.error = Some(format!("{}: the file does not exist.", path.display()));
            return None;
        }
        if path.extension().is_none()
            && let Some(ending) = self.purpose.endings().first()
        {
            path.set_extension(ending);
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let (endings, has_formats) = (self.purpose.endings(), super::formats::of(&self.purpose).is_some());
        // The next dialog examines the ending of a format.
        if !has_formats && !ending.is_some_and(|ending| endings.contains(&ending.as_str())) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            self.error = Some(format!("Found {name}, expected a name that ends in .{}.", endings.join(" or .")));
            return None;
        }
        if let Some(folder) = path.parent().filter(|folder| !folder.is_dir()) {
            self.error = Some(format!("{}: the folder does not exist.", folder.display()));
            return None;
        }
        if path.exists() && self.overwrite.as_ref() != Some(&path) {
            self.error = Some(format!("{} already exists.", path.display()));
            self.overwrite = Some(path);
            return None;
        }
        Some(path)
    }
}
