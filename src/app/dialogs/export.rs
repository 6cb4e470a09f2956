//! Export dialogs: settings of a table, image, fit or tile before the file is written.

use std::path::Path;

use super::within;
use crate::export::RadianceBasis;
use crate::export::tile::TileOptions;
use eframe::egui::{self, Context, DragValue, Grid, Ui};

use crate::app::worker::TableChoice;

/// The button that ended an export dialog.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportDecision {
    Export,
    Cancel,
}

pub(super) fn footer(ui: &mut Ui, valid: bool, decision: &mut Option<ExportDecision>) {
    ui.add_space(8.0);
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        let export = ui.add_enabled(valid, egui::Button::new("Export"));
        if export.clicked() || valid && ui.input(|input| input.key_pressed(egui::Key::Enter)) {
            *decision = Some(ExportDecision::Export);
        }
        if ui.button("Cancel").clicked() {
            *decision = Some(ExportDecision::Cancel);
        }
    });
}

/// Draws the dialog of a table export, with its resolution. `left_out` says which light the table lacks.
pub fn table_ui(
    ctx: &Context,
    path: &Path,
    choice: &mut TableChoice,
    left_out: Option<&str>,
) -> Option<ExportDecision> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    export_dialog(ctx, "Export the BRDF as a table", path, |ui| {
        match ending.as_str() {
            _ if crate::export::grid_is_free(path) => grid_ui(ui, choice, &ending),
            "bsdf" => rgl_ui(ui, choice),
            _ if path.to_string_lossy().ends_with(crate::export::mitsuba::ENDING) => {
                drop(ui.label(
                    "The file is a scene of Mitsuba 3: both faces as rough sheets, with the camera and the background.",
                ));
            }
            "xml" => radiance_ui(ui, choice),
            _ => drop(ui.label("This format has a fixed grid of directions.")),
        }
        let checked = choice.resolution(path).map_or(Ok(()), |resolution| resolution.check());
        if let Err(error) = &checked {
            ui.colored_label(ui.visuals().warn_fg_color, error.to_string());
        }
        if !matches!(ending.as_str(), "npz" | "csv" | "exr") {
            ui.weak("A text file beside it describes the conventions and the error of the table.");
        }
        if let Some(left_out) = left_out {
            ui.colored_label(ui.visuals().warn_fg_color, left_out);
        }
        ui.weak("The export uses the scene's quality. Progress and Cancel are at the foot of the window.");
        checked.is_ok()
    })
}

/// Draws the resolution of a format whose grid is free, and the size of the file.
fn grid_ui(ui: &mut Ui, choice: &mut TableChoice, ending: &str) {
    let TableChoice { theta, phi, .. } = choice;
    Grid::new("table").num_columns(2).show(ui, |ui| {
        let label = ui.label("Polar steps (normal to horizon)");
        ui.add(DragValue::new(theta).range(2..=180)).labelled_by(label.id);
        ui.end_row();
        let label = ui.label("Azimuth steps");
        ui.add(DragValue::new(phi).range(4..=720)).labelled_by(label.id);
        ui.end_row();
    });
    let pairs = (*theta * *phi) as f64 * (*theta * *phi) as f64;
    // Sizes of exports of 9 x 24 directions, divided by their pairs.
    let bytes_per_pair = match ending {
        "csv" => 110.0,
        "astm" => 75.0,
        _ => 24.0,
    };
    let (millions, megabytes) = (pairs / 1e6, pairs * bytes_per_pair / 1e6);
    ui.label(format!("{millions:.1} million direction pairs, about {megabytes:.0} MB"));
    ui.weak("Glossy materials need more steps.");
}

/// Draws the sizes of an RGL file.
fn rgl_ui(ui: &mut Ui, choice: &mut TableChoice) {
    ui.radio_value(&mut choice.rgl, None, "Automatic: from the material, up to the large size");
    for (name, sizes) in [
        ("Small: 9 x 24 slices of 24 x 24, about 3 MB", [9, 24, 24, 24]),
        ("Medium: 13 x 48 slices of 36 x 36, about 20 MB", [13, 48, 36, 36]),
        ("Large: 19 x 72 slices of 56 x 56, about 105 MB", [19, 72, 56, 56]),
    ] {
        ui.radio_value(&mut choice.rgl, Some(sizes), name);
    }
    ui.weak("A name that ends in _spec.bsdf stores spectra instead of RGB, for the spectral modes of Mitsuba.");
}

/// Draws the basis of a Radiance file.
fn radiance_ui(ui: &mut Ui, choice: &mut TableChoice) {
    ui.radio_value(&mut choice.radiance, RadianceBasis::Klems, "Klems basis, 145 x 145 patches");
    let tree = RadianceBasis::TensorTree;
    ui.radio_value(&mut choice.radiance, tree, "Tensor tree, for glossy or anisotropic materials");
    if choice.radiance == RadianceBasis::TensorTree {
        ui.horizontal(|ui| {
            ui.label("Cells per side");
            for side in [16, 32, 64] {
                ui.radio_value(&mut choice.tree, side, side.to_string());
            }
        });
    }
}

/// Draws the dialog of an image export, with its size.
pub fn image_ui(ctx: &Context, path: &Path, width: &mut usize, height: &mut usize) -> Option<ExportDecision> {
    export_dialog(ctx, "Export the image", path, |ui| {
        ui.horizontal(|ui| {
            ui.label("Pixels");
            ui.name_inputs("Width", |ui| ui.add(DragValue::new(width).range(16..=4096)));
            ui.label("×");
            ui.name_inputs("Height", |ui| ui.add(DragValue::new(height).range(16..=4096)));
        });
        ui.weak(".png stores the displayed colours. .exr stores linear radiance.");
        true
    })
}

/// Draws the dialog of an exported fit.
pub fn fit_ui(ctx: &Context, path: &Path) -> Option<ExportDecision> {
    export_dialog(ctx, "Export a fit", path, |ui| {
        ui.label(
            "The file holds the parameters of a rough metal or plastic with a diffuse part. A message gives the error.",
        );
        ui.weak("Export a table to keep the whole BRDF.");
        true
    })
}

/// Draws the dialog of a tile export, with repetitions and scale.
pub fn tile_ui(ctx: &Context, path: &Path, options: &mut TileOptions) -> Option<ExportDecision> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    export_dialog(ctx, "Export the tile", path, |ui| {
        let [mut across, mut along] = options.repeat.to_array();
        ui.horizontal(|ui| {
            ui.label("Tiles");
            ui.name_inputs("Tiles across", |ui| ui.add(DragValue::new(&mut across).range(1..=64)));
            ui.label("×");
            ui.name_inputs("Tiles along", |ui| ui.add(DragValue::new(&mut along).range(1..=64)));
        });
        options.repeat = glam::UVec2::new(across, along);
        if matches!(ending.as_str(), "stl" | "svg" | "pdf") {
            ui.horizontal(|ui| {
                let label = ui.label("Scale");
                let drag = DragValue::new(&mut options.scale).range(0.01..=10_000.0).speed(0.2).max_decimals(2);
                ui.add(drag).labelled_by(label.id);
                ui.weak("with 40, a tile of 1 mm becomes 4 cm");
            });
        }
        if matches!(ending.as_str(), "stl" | "png") {
            let mut side = options.samples.x;
            ui.horizontal(|ui| {
                let label = ui.label("Samples per side");
                ui.add(DragValue::new(&mut side).range(2..=2048)).labelled_by(label.id);
            });
            options.samples = glam::UVec2::splat(side);
        }
        options.scale.is_finite()
    })
}

/// Draws the frame of an export dialog. `body` returns whether the settings are valid.
fn export_dialog(
    ctx: &Context,
    title: &str,
    path: &Path,
    body: impl FnOnce(&mut Ui) -> bool,
) -> Option<ExportDecision> {
    let mut decision = None;
    let modal = egui::Modal::new(egui::Id::unique(title)).show(ctx, |ui| {
        ui.set_width(within(ctx, 440.0, 40.0, 0));
        ui.heading(title);
        ui.label(path.display().to_string());
        ui.add_space(6.0);
        let valid = body(ui);
        footer(ui, valid, &mut decision);
    });
    if modal.should_close() && decision.is_none() {
        decision = Some(ExportDecision::Cancel);
    }
    decision
}
