//! The parameter panel: sections for one scene, generated from the catalogue.

pub mod accuracy;
mod accuracy_chart;
mod accuracy_ui;
mod alternatives;
pub mod color_map;
pub mod controls;
pub mod effects;
pub mod fields;
pub mod large_scale;
pub mod materials;
mod matrix;
pub mod paints;
pub mod slab;
mod stage_bars;
pub mod surface;
mod targets;

use crate::app::views::thumbnails::Thumbnails;
use crate::plan::Effect;
use crate::scene::{Painted, Scene};
use eframe::egui::{self, RichText, Ui};

pub use accuracy::AccuracyState;
pub use color_map::{ColorMapState, DriverPlace};
pub use fields::PanelContext;
pub use slab::SlabFile;
pub use targets::TargetState;

/// Requests of the panel to the editor.
#[derive(Debug, Default)]
pub struct PanelRequests {
    /// Key of the field for which the user requests a file.
    pub browse: Option<&'static str>,
    pub material: Option<materials::MaterialRequest>,
    /// Driver of the colour map for which the user requests an image.
    pub driver_image: Option<DriverPlace>,
    /// File of the slab that the user requests.
    pub slab_file: Option<SlabFile>,
    /// Message about an invalid value.
    pub error: Option<String>,
    /// Key of the parameter of the surface that the user is changing.
    pub changing: Option<&'static str>,
}

/// The sections that the panel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tab {
    /// Surface, materials, object, light and camera.
    #[default]
    Scene,
    /// Quality, accuracy and effects.
    Cost,
}

/// State of the displayed image, for the sections that measure it.
pub struct PanelInputs<'a> {
    pub tab: &'a mut Tab,
    pub accuracy: &'a mut AccuracyState,
    pub targets: &'a mut TargetState,
    pub color_map: &'a mut ColorMapState,
    /// The plan of the refined image.
    pub effects: &'a [Effect],
    /// Milliseconds of the stages from the last edit to its refined image.
    pub stages: &'a [(&'static str, f64)],
    /// Version of the document.
    pub version: u64,
    /// The path or the name by which the command line opens the scene.
    pub file: &'a str,
    /// Title of a section that unfolds and comes into view.
    pub reveal: &'a mut Option<&'static str>,
    /// True in the first frame of a document: sections that its scene uses unfold.
    pub is_new: bool,
    /// Images of the choices.
    pub thumbnails: &'a Thumbnails,
}

/// Draws the sections of the open tab and writes the edits into `scene`.
pub fn ui(
    ui: &mut Ui,
    scene: &mut Scene,
    painted: &Painted,
    name: &str,
    slots: &[String],
    inputs: PanelInputs<'_>,
) -> PanelRequests {
    let (unit, thumbnails) = (scene.tile.unit.clone(), inputs.thumbnails.clone());
    let mut context = PanelContext { unit, thumbnails, ..PanelContext::default() };
    let (mut material, mut driver_image, mut slab_file) = (None, None, None);
    let reveal = inputs.reveal;
    // A wide row must not widen the panel.
    ui.set_max_width(ui.available_width());
    inputs.accuracy.open = false;
    inputs.color_map.open = false;
    ui.horizontal(|ui| {
        for (tab, name, tip) in [
            (Tab::Scene, "Scene", "Surface, materials, object, light and camera (F5)"),
            (Tab::Cost, "Cost", "Quality, accuracy against time, and effects (F6)"),
        ] {
            ui.selectable_value(inputs.tab, tab, name).on_hover_text(tip);
        }
    });
    ui.separator();
    if *inputs.tab == Tab::Cost {
        let (state, at) = (inputs.accuracy, (inputs.version, inputs.file));
        let is_slab = scene.slab.is_some();
        section(ui, reveal, "Accuracy", true, |ui| match is_slab {
            true => drop(ui.label(SLAB_ACCURACY)),
            false => accuracy_ui::ui(ui, scene, (state, inputs.targets), inputs.effects, at),
        });
        section(ui, reveal, "Time", true, |ui| stage_bars::ui(ui, inputs.stages));
        if !is_slab {
            section(ui, reveal, "Effects", true, |ui| effects::ui(ui, scene, inputs.effects, state, inputs.version));
        }
        section(ui, reveal, "Quality", false, |ui| large_scale::quality_ui(ui, &mut scene.quality, &mut context));
        return PanelRequests { browse: context.browse, error: context.error, ..PanelRequests::default() };
    }
    // A scene of the gallery unfolds what it shows.
    let unfolds = |used: bool| inputs.is_new.then_some(used);
    let (shows_map, shows_slab) = (scene.color_map.is_some(), scene.slab.is_some());
    section(ui, reveal, "Surface", true, |ui| surface::ui(ui, scene, painted, name, &mut context));
    let changing = context.changing.take();
    section(ui, reveal, "Materials", true, |ui| material = materials::ui(ui, scene, slots, &mut context));
    foldable(ui, reveal, "Colour map", shows_map, unfolds(shows_map), |ui| {
        driver_image = color_map::ui(ui, scene, inputs.color_map, &mut context);
    });
    foldable(ui, reveal, "Slab", shows_slab, unfolds(shows_slab), |ui| slab_file = slab::ui(ui, scene, &mut context));
    section(ui, reveal, "Object", true, |ui| large_scale::object_ui(ui, scene, &mut context));
    section(ui, reveal, "Light", true, |ui| large_scale::light_ui(ui, &mut scene.light, &mut context));
    section(ui, reveal, "Camera", false, |ui| large_scale::camera_ui(ui, scene, &mut context));
    PanelRequests { browse: context.browse, material, driver_image, slab_file, error: context.error, changing }
}

/// Text in place of the accuracy of a slab.
const SLAB_ACCURACY: &str = "Accuracy against time is measured for opaque tiles. The accuracy of a slab follows from its \
    method, in the section Slab of the tab Scene.";

fn section(ui: &mut Ui, reveal: &mut Option<&'static str>, title: &str, open: bool, body: impl FnOnce(&mut Ui)) {
    foldable(ui, reveal, title, open, None, body);
}

/// Draws a section. `unfold` folds or unfolds it in this frame. The section to `reveal` unfolds and comes into view.
fn foldable(
    ui: &mut Ui,
    reveal: &mut Option<&'static str>,
    title: &str,
    open: bool,
    unfold: Option<bool>,
    body: impl FnOnce(&mut Ui),
) {
    let is_revealed = reveal.take_if(|name| *name == title).is_some();
    let unfold = if is_revealed { Some(true) } else { unfold };
    let header = egui::CollapsingHeader::new(RichText::new(title).heading()).id_salt(title);
    let shown = header.default_open(open).open(unfold).show_unindented(ui, |ui| {
        ui.add_space(2.0);
        body(ui);
        ui.add_space(6.0);
    });
    if is_revealed {
        shown.header_response.scroll_to_me(Some(egui::Align::TOP));
    }
    ui.separator();
}

/// The tab and the section that hold the remedy of a warning.
pub fn place_of_remedy(warning: &str) -> (Tab, &'static str) {
    let names = |words: &[&str]| words.iter().any(|word| warning.contains(word));
    if names(&["nterreflection"]) {
        (Tab::Cost, "Effects")
    } else if names(&["quality.", "preset"]) {
        (Tab::Cost, "Quality")
    } else if names(&["material", "albedo", "oughness", "BRDF"]) {
        (Tab::Scene, "Materials")
    } else {
        (Tab::Scene, "Surface")
    }
}
