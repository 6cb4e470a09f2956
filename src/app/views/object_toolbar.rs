//! The toolbar above the object: object, exposure, framing, comparison, picking.

use crate::scene::{Camera, OBJECT_KINDS, Scene};
use eframe::egui::{self, Ui};

use super::methods::MethodsState;
use super::object::ObjectView;
use super::thumbnails::Thumbnails;
use crate::app::actions::Action;
use crate::app::panels::controls;

impl ObjectView {
    /// Draws the toolbar above the view.
    pub fn toolbar(
        &mut self,
        ui: &mut Ui,
        scene: &mut Scene,
        compares_methods: bool,
        thumbnails: &Thumbnails,
    ) -> Option<Action> {
        let mut action = None;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let title = ui.strong("Object");
            ui.label_inputs_by(title.id, |ui| object_ui(ui, scene, thumbnails));
            ui.name_inputs("Exposure", |ui| exposure_ui(ui, scene));
            ui.separator();
            for (choice, name, tip, on) in [
                (Action::Frame, "Frame", "Show the whole object (F)", false),
                (
                    Action::Snapshot,
                    "A/B",
                    "Store this image as A and compare later ones with it (B)",
                    self.comparison.is_some(),
                ),
                (
                    Action::Pick,
                    "Pick",
                    "Point at the object to see how it reflects there, and what each facet contributes (I)",
                    self.picking,
                ),
            ] {
                if ui.selectable_label(on, name).on_hover_text(tip).clicked() {
                    action = Some(choice);
                }
            }
            let tip =
                "Show the methods for this scene beside each other, with the reference and its standard error (M)";
            if MethodsState::applies_to(scene)
                && ui.selectable_label(compares_methods, "Methods").on_hover_text(tip).clicked()
            {
                action = Some(Action::Methods);
            }
            if self.comparison.is_some()
                && ui.button("Back to A").on_hover_text("Undo all edits since A in one step").clicked()
            {
                action = Some(Action::BackToA);
            }
        });
        action
    }
}

fn object_ui(ui: &mut Ui, scene: &mut Scene, thumbnails: &Thumbnails) {
    let kinds = OBJECT_KINDS.iter().copied().filter(|kind| *kind != "mesh");
    if let Some(kind) = controls::object_kind_ui(ui, &scene.object.kind, kinds, 90.0, thumbnails) {
        kind.clone_into(&mut scene.object.kind);
        scene.object.path = None;
    }
}

fn exposure_ui(ui: &mut Ui, scene: &mut Scene) {
    let camera = scene.camera.clone().unwrap_or_default();
    let mut exposure = camera.exposure_ev;
    let drag = egui::DragValue::new(&mut exposure).range(-10.0..=10.0).speed(0.03).suffix(" EV").max_decimals(2);
    let response = ui.add(drag).on_hover_text("Exposure: drag sideways");
    if response.changed() && exposure.is_finite() {
        scene.camera = Some(Camera { exposure_ev: exposure, ..camera });
    }
}
