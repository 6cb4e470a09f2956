//! The parameter panel: sections over one scene, generated from the catalogue.

pub mod accuracy;
mod controls;
mod effects;
pub mod fields;
pub mod look;
pub mod materials;
mod matrix;
pub mod paints;
pub mod surface;

use crate::plan::Effect;
use crate::scene::{Painted, Scene};
use eframe::egui::{self, RichText, Ui};

pub use accuracy::AccuracyState;
pub use fields::Around;

/// What the panel asks for.
#[derive(Debug, Default)]
pub struct Asked {
    /// A file for the field of this key.
    pub browse: Option<&'static str>,
    pub material: Option<materials::Request>,
    pub complaint: Option<String>,
}

/// What is shown now, for the sections that measure it.
pub struct Shown<'a> {
    pub accuracy: &'a mut AccuracyState,
    /// The plan of the picture.
    pub effects: &'a [Effect],
    /// Version of the document.
    pub version: u64,
}

/// All sections. `scene` is left as the person wants it.
pub fn ui(ui: &mut Ui, scene: &mut Scene, painted: &Painted, name: &str, slots: &[String], shown: Shown<'_>) -> Asked {
    let mut around = Around { unit: scene.tile.unit.clone(), ..Around::default() };
    let mut material = None;
    // Whatever a row asks for, the panel keeps the width it was given.
    ui.set_max_width(ui.available_width());
    section(ui, "Surface", true, |ui| surface::ui(ui, scene, painted, name, &mut around));
    section(ui, "Materials", true, |ui| material = materials::ui(ui, scene, slots, &mut around));
    section(ui, "Object", true, |ui| look::object_ui(ui, scene, &mut around));
    section(ui, "Light", true, |ui| look::light_ui(ui, &mut scene.light, &mut around));
    section(ui, "Camera", false, |ui| look::camera_ui(ui, scene, &mut around));
    section(ui, "Quality", false, |ui| look::quality_ui(ui, &mut scene.quality, &mut around));
    shown.accuracy.open = false;
    section(ui, "Accuracy", false, |ui| accuracy::ui(ui, scene, shown.accuracy, shown.effects, shown.version));
    section(ui, "Effects", false, |ui| effects::ui(ui, scene, shown.effects, shown.accuracy, shown.version));
    Asked { browse: around.browse, material, complaint: around.complaint }
}

fn section(ui: &mut Ui, title: &str, open: bool, body: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(RichText::new(title).heading()).id_salt(title).default_open(open).show_unindented(
        ui,
        |ui| {
            ui.add_space(2.0);
            body(ui);
            ui.add_space(6.0);
        },
    );
    ui.separator();
}
