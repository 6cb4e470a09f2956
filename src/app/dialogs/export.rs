//! What a table or a picture is to be like, before it is written.

use std::path::Path;

use biscale::export::RadianceBasis;
use eframe::egui::{self, Context, DragValue, Grid};

use crate::app::worker::TableChoice;

/// What a dialog answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    Export,
    Cancel,
}

fn footer(ui: &mut egui::Ui, answer: &mut Option<Answer>) {
    ui.add_space(8.0);
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        if ui.button("Export").clicked() || ui.input(|input| input.key_pressed(egui::Key::Enter)) {
            *answer = Some(Answer::Export);
        }
        if ui.button("Cancel").clicked() {
            *answer = Some(Answer::Cancel);
        }
    });
}

/// Steps of a table.
pub fn table_ui(ctx: &Context, path: &Path, choice: &mut TableChoice) -> Option<Answer> {
    let TableChoice { theta, phi, radiance } = choice;
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("export table")).show(ctx, |ui| {
        ui.set_width(420.0);
        ui.heading("Export the BRDF table");
        ui.label(path.display().to_string());
        ui.add_space(6.0);
        if biscale::export::grid_is_free(path) {
            Grid::new("table").num_columns(2).show(ui, |ui| {
                let label = ui.label("Steps from the normal to the horizon");
                ui.add(DragValue::new(theta).range(2..=180)).labelled_by(label.id);
                ui.end_row();
                let label = ui.label("Steps around");
                ui.add(DragValue::new(phi).range(4..=720)).labelled_by(label.id);
                ui.end_row();
            });
            let (millions, megabytes) = (pairs(*theta, *phi) / 1e6, pairs(*theta, *phi) * 24.0 / 1e6);
            ui.label(format!("{millions:.1} million pairs of directions, about {megabytes:.0} MB as .npz"));
        } else {
            ui.label("This format brings its own grid of directions. A note in plain words is written beside it.");
        }
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("xml")) {
            ui.radio_value(radiance, RadianceBasis::Klems, "Klems' 145 x 145 patches");
            ui.radio_value(radiance, RadianceBasis::TensorTree, "Tensor tree, for what is sharp or anisotropic");
        }
        ui.weak("At the scene's quality, not the draft's. Glossy materials ask for more steps.");
        footer(ui, &mut answer);
    });
    if modal.should_close() && answer.is_none() {
        answer = Some(Answer::Cancel);
    }
    answer
}

fn pairs(theta: usize, phi: usize) -> f64 {
    (theta * phi) as f64 * (theta * phi) as f64
}

/// Size of a picture.
pub fn picture_ui(ctx: &Context, path: &Path, width: &mut usize, height: &mut usize) -> Option<Answer> {
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("export picture")).show(ctx, |ui| {
        ui.set_width(420.0);
        ui.heading("Export the picture");
        ui.label(path.display().to_string());
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            ui.label("Pixels");
            ui.name_inputs("Width", |ui| ui.add(DragValue::new(width).range(16..=4096)));
            ui.label("×");
            ui.name_inputs("Height", |ui| ui.add(DragValue::new(height).range(16..=4096)));
        });
        ui.weak(".png is as you see it; .exr holds linear radiance.");
        footer(ui, &mut answer);
    });
    if modal.should_close() && answer.is_none() {
        answer = Some(Answer::Cancel);
    }
    answer
}
