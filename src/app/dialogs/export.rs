//! What a table or a picture is to be like, before it is written.

use std::path::Path;

use crate::export::RadianceBasis;
use crate::export::tile::TileOptions;
use eframe::egui::{self, Context, DragValue, Grid, Ui};

use crate::app::theme;
use crate::app::worker::TableChoice;

/// What a dialog answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    Export,
    Cancel,
}

fn footer(ui: &mut Ui, can: bool, answer: &mut Option<Answer>) {
    ui.add_space(8.0);
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        let export = ui.add_enabled(can, egui::Button::new("Export"));
        if export.clicked() || can && ui.input(|input| input.key_pressed(egui::Key::Enter)) {
            *answer = Some(Answer::Export);
        }
        if ui.button("Cancel").clicked() {
            *answer = Some(Answer::Cancel);
        }
    });
}

/// How fine a table is.
pub fn table_ui(ctx: &Context, path: &Path, choice: &mut TableChoice) -> Option<Answer> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    asked(ctx, "Export the BRDF as a table", path, |ui| {
        match ending.as_str() {
            _ if crate::export::grid_is_free(path) => grid_ui(ui, choice),
            "bsdf" => rgl_ui(ui, choice),
            "xml" => radiance_ui(ui, choice),
            _ => drop(ui.label("This format brings its own grid of directions.")),
        }
        let checked = choice.resolution(path).map_or(Ok(()), |resolution| resolution.check());
        if let Err(error) = &checked {
            ui.colored_label(theme::WARNING, error.to_string());
        }
        if !matches!(ending.as_str(), "npz" | "csv" | "exr") {
            ui.weak("A note in plain words is written beside it: what the numbers are, and how well it reads.");
        }
        ui.weak("At the scene's quality, not the draft's. Progress and Cancel are in the status line.");
        checked.is_ok()
    })
}

/// Steps of a grid that is free.
fn grid_ui(ui: &mut Ui, choice: &mut TableChoice) {
    let TableChoice { theta, phi, .. } = choice;
    Grid::new("table").num_columns(2).show(ui, |ui| {
        let label = ui.label("Steps from the normal to the horizon");
        ui.add(DragValue::new(theta).range(2..=180)).labelled_by(label.id);
        ui.end_row();
        let label = ui.label("Steps around");
        ui.add(DragValue::new(phi).range(4..=720)).labelled_by(label.id);
        ui.end_row();
    });
    let pairs = (*theta * *phi) as f64 * (*theta * *phi) as f64;
    let (millions, megabytes) = (pairs / 1e6, pairs * 24.0 / 1e6);
    ui.label(format!("{millions:.1} million pairs of directions, about {megabytes:.0} MB as .npz"));
    ui.weak("Glossy materials ask for more steps.");
}

/// Sizes of an RGL file.
fn rgl_ui(ui: &mut Ui, choice: &mut TableChoice) {
    ui.radio_value(&mut choice.rgl, None, "As fine as the material asks for, up to the large one");
    for (name, sizes) in [
        ("Small: 9 x 24 slices of 24 x 24, about 3 MB", [9, 24, 24, 24]),
        ("Medium: 13 x 48 slices of 36 x 36, about 20 MB", [13, 48, 36, 36]),
        ("Large: 19 x 72 slices of 56 x 56, about 105 MB", [19, 72, 56, 56]),
    ] {
        ui.radio_value(&mut choice.rgl, Some(sizes), name);
    }
    ui.weak("A name that ends in _spec.bsdf gets spectra in place of RGB, for Mitsuba's spectral modes.");
}

/// The basis of a Radiance file.
fn radiance_ui(ui: &mut Ui, choice: &mut TableChoice) {
    ui.radio_value(&mut choice.radiance, RadianceBasis::Klems, "Klems' 145 x 145 patches");
    let tree = RadianceBasis::TensorTree;
    ui.radio_value(&mut choice.radiance, tree, "Tensor tree, for what is sharp or anisotropic");
    if choice.radiance == RadianceBasis::TensorTree {
        ui.horizontal(|ui| {
            ui.label("Cells along a side");
            for side in [16, 32, 64] {
                ui.radio_value(&mut choice.tree, side, side.to_string());
            }
        });
    }
}

/// Size of a picture.
pub fn image_ui(ctx: &Context, path: &Path, width: &mut usize, height: &mut usize) -> Option<Answer> {
    asked(ctx, "Export the picture", path, |ui| {
        ui.horizontal(|ui| {
            ui.label("Pixels");
            ui.name_inputs("Width", |ui| ui.add(DragValue::new(width).range(16..=4096)));
            ui.label("×");
            ui.name_inputs("Height", |ui| ui.add(DragValue::new(height).range(16..=4096)));
        });
        ui.weak(".png is as you see it; .exr holds linear radiance.");
        true
    })
}

/// What a fit is.
pub fn fit_ui(ctx: &Context, path: &Path) -> Option<Answer> {
    asked(ctx, "Export a few parameters", path, |ui| {
        ui.label(
            "A rough metal or plastic with a matte part is fitted to the material; what it loses is said afterwards.",
        );
        ui.weak("For all of the material export a table.");
        true
    })
}

/// How much of the tile, and how large.
pub fn tile_ui(ctx: &Context, path: &Path, options: &mut TileOptions) -> Option<Answer> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    asked(ctx, "Export the tile", path, |ui| {
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
                let label = ui.label("Enlarged by");
                let drag = DragValue::new(&mut options.scale).range(0.01..=10_000.0).speed(0.2).max_decimals(2);
                ui.add(drag).labelled_by(label.id);
                ui.weak("a tile of 1 mm by 40 is 4 cm");
            });
        }
        if matches!(ending.as_str(), "stl" | "png") {
            let mut side = options.samples.x;
            ui.horizontal(|ui| {
                let label = ui.label("Samples along a tile");
                ui.add(DragValue::new(&mut side).range(2..=2048)).labelled_by(label.id);
            });
            options.samples = glam::UVec2::splat(side);
        }
        options.scale.is_finite()
    })
}

/// A dialog about a file to be written; `body` says whether it can be.
fn asked(ctx: &Context, title: &str, path: &Path, body: impl FnOnce(&mut Ui) -> bool) -> Option<Answer> {
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique(title)).show(ctx, |ui| {
        ui.set_width(440.0);
        ui.heading(title);
        ui.label(path.display().to_string());
        ui.add_space(6.0);
        let can = body(ui);
        footer(ui, can, &mut answer);
    });
    if modal.should_close() && answer.is_none() {
        answer = Some(Answer::Cancel);
    }
    answer
}
