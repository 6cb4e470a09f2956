//! The parameter panel: sections for one scene, generated from the catalogue.

pub mod accuracy;
mod controls;
mod effects;
pub mod fields;
pub mod large_scale;
pub mod materials;
mod matrix;
pub mod paints;
mod slab;
pub mod surface;

use crate::app::worker::SlabPlot;
use crate::plan::Effect;
use crate::scene::{Painted, Scene};
use eframe::egui::{self, RichText, Ui};

pub use accuracy::AccuracyState;
pub use fields::PanelContext;

/// Requests of the panel to the editor.
#[derive(Debug, Default)]
pub struct PanelRequests {
    /// Key of the field for which the user requests a file.
    pub browse: Option<&'static str>,
    pub material: Option<materials::MaterialRequest>,
    /// Message about an invalid value.
    pub error: Option<String>,
}

/// State of the displayed image, for the sections that measure it.
pub struct PanelInputs<'a> {
    pub accuracy: &'a mut AccuracyState,
    /// The plan of the displayed image.
    pub effects: &'a [Effect],
    /// Lobe and energy of the displayed slab.
    pub slab: Option<&'a SlabPlot>,
    /// Version of the document.
    pub version: u64,
}

/// Draws all sections and writes the edits into `scene`.
pub fn ui(
    ui: &mut Ui,
    scene: &mut Scene,
    painted: &Painted,
    name: &str,
    slots: &[String],
    inputs: PanelInputs<'_>,
) -> PanelRequests {
    let mut context = PanelContext { unit: scene.tile.unit.clone(), ..PanelContext::default() };
    let mut material = None;
    // A wide row must not widen the panel.
    ui.set_max_width(ui.available_width());
    section(ui, "Surface", true, |ui| surface::ui(ui, scene, painted, name, &mut context));
    section(ui, "Materials", true, |ui| material = materials::ui(ui, scene, slots, &mut context));
    section(ui, "Slab", scene.slab.is_some(), |ui| slab::ui(ui, scene, inputs.slab, &mut context));
    section(ui, "Object", true, |ui| large_scale::object_ui(ui, scene, &mut context));
    section(ui, "Light", true, |ui| large_scale::light_ui(ui, &mut scene.light, &mut context));
    section(ui, "Camera", false, |ui| large_scale::camera_ui(ui, scene, &mut context));
    section(ui, "Quality", false, |ui| large_scale::quality_ui(ui, &mut scene.quality, &mut context));
    inputs.accuracy.open = false;
    section(ui, "Accuracy", false, |ui| accuracy::ui(ui, scene, inputs.accuracy, inputs.effects, inputs.version));
    section(ui, "Effects", false, |ui| effects::ui(ui, scene, inputs.effects, inputs.accuracy, inputs.version));
    PanelRequests { browse: context.browse, material, error: context.error }
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
