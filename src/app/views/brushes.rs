//! The brush panel below the tile view.

use crate::geometry::image_file::MAX_SLOTS;
use crate::geometry::painted_slot;
use crate::scene::{Scene, shipped};
use eframe::egui::{self, Slider, Ui};

use crate::app::paint::{Brush, Tool};
use crate::app::panels::fields::{display_name, row};
use crate::app::panels::paints;

/// An image over the tile that the user paints on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PaintLayer {
    Heights,
    Colors,
    Slots,
}

impl PaintLayer {
    /// Default name of the image's file.
    pub fn file(self) -> &'static str {
        match self {
            Self::Heights => "heights.png",
            Self::Colors => "colors.png",
            Self::Slots => "materials.png",
        }
    }
}

/// A request of the brush panel to the editor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BrushRequest {
    Open(PaintLayer),
    Save(PaintLayer),
    Clear(PaintLayer),
}

/// Draws the brush panel. `scene` lists the materials that the brush can paint.
pub fn ui(ui: &mut Ui, brush: &mut Brush, scene: &Scene) -> Option<BrushRequest> {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 5.0;
        let shape = Tool::ALL.iter().filter(|tool| !tool.changes_material());
        shape.for_each(|tool| tool_ui(ui, brush, *tool));
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 5.0;
        Tool::ALL.iter().filter(|tool| tool.changes_material()).for_each(|tool| tool_ui(ui, brush, *tool));
    });
    shape_ui(ui, brush);
    match brush.tool {
        Tool::Color => color_ui(ui, brush),
        Tool::Material => material_ui(ui, brush, scene),
        Tool::Stamp => stamp_ui(ui, brush),
        _ => {}
    }
    let request = files_ui(ui, brush.tool);
    ui.small("Drag with the right button to turn the tile. Scroll to zoom.");
    request
}

fn tool_ui(ui: &mut Ui, brush: &mut Brush, tool: Tool) {
    if ui.selectable_label(brush.tool == tool, tool.name()).on_hover_text(tool.tip()).clicked() {
        brush.tool = tool;
    }
}

/// Draws the size, strength and softness of the brush.
fn shape_ui(ui: &mut Ui, brush: &mut Brush) {
    let percent = |ui: &mut Ui, caption: &str, tip: &str, value: &mut f32, max: f32| {
        row(ui, caption, tip, |ui| {
            let mut percentage = *value * 100.0;
            ui.spacing_mut().slider_width = (ui.available_width() - 70.0).max(40.0);
            let slider = Slider::new(&mut percentage, if max > 0.6 { 0.0 } else { 0.5 }..=max * 100.0);
            if ui.add(slider.suffix(" %").max_decimals(1)).changed() {
                *value = percentage / 100.0;
            }
        });
    };
    percent(ui, "Size", "Radius as a fraction of the tile ([ and ])", &mut brush.radius, 0.5);
    // Each texel has exactly one material, so strength and softness do not apply.
    if brush.tool != Tool::Material {
        percent(ui, "Strength", "Effect of a stroke. Light pen pressure reduces it", &mut brush.strength, 1.0);
        percent(ui, "Softness", "0: a hard edge. 100: soft from the centre outwards", &mut brush.falloff, 1.0);
    }
    row(ui, "Wrap", "Strokes continue at the opposite edge of the tile", |ui| {
        ui.checkbox(&mut brush.wrap, "around the edges")
    });
}

fn color_ui(ui: &mut Ui, brush: &mut Brush) {
    row(ui, "Colour", "Multiplies the materials", |ui| {
        let mut rgb = brush.color.to_array();
        if ui.color_edit_button_rgb(&mut rgb).changed() {
            brush.color = rgb.into();
        }
    });
}

/// Draws the choice of the painted material: the original one, an existing one, or a new one.
fn material_ui(ui: &mut Ui, brush: &mut Brush, scene: &Scene) {
    let existing = paints::painted(scene);
    // The first stroke creates the material.
    let next = (1..=MAX_SLOTS).find(|slot| !existing.contains(slot));
    let name = |slot: u8| if slot == 0 { "Original material".to_owned() } else { display_name(&painted_slot(slot)) };
    let selected = if Some(brush.slot) == next { format!("{} (new)", name(brush.slot)) } else { name(brush.slot) };
    row(ui, "Material", "Material of the painted places. Edit its BRDF under Materials", |ui| {
        egui::ComboBox::from_id_salt("paint material").selected_text(selected).width(150.0).show_ui(ui, |ui| {
            for slot in std::iter::once(0).chain(existing) {
                ui.selectable_value(&mut brush.slot, slot, name(slot));
            }
            if let Some(next) = next {
                ui.selectable_value(&mut brush.slot, next, "A new material");
            }
        });
    });
}

fn stamp_ui(ui: &mut Ui, brush: &mut Brush) {
    row(ui, "Pattern", "Shape of the stamp", |ui| {
        egui::ComboBox::from_id_salt("stamp").selected_text(stem(brush.stamp)).show_ui(ui, |ui| {
            for (name, _) in shipped::ASSETS {
                ui.selectable_value(&mut brush.stamp, *name, stem(name));
            }
        });
    });
}

/// Returns the displayed name of a shipped image.
fn stem(file: &str) -> String {
    display_name(file.split('.').next().unwrap_or(file))
}

/// Draws the buttons that open, save and clear the layer that the brush paints on.
fn files_ui(ui: &mut Ui, tool: Tool) -> Option<BrushRequest> {
    let (layer, names, clear) = match tool {
        Tool::Color => (PaintLayer::Colors, "colours", ("Clear colours", "Remove the painted colours")),
        Tool::Material => (PaintLayer::Slots, "materials", ("Clear materials", "Remove the painted materials")),
        _ => (PaintLayer::Heights, "heights", ("Flatten all", "Set all heights to a plane")),
    };
    let mut request = None;
    ui.horizontal_wrapped(|ui| {
        let mut button = |name: String, tip: &str, choice: BrushRequest| {
            if ui.button(name).on_hover_text(tip).clicked() {
                request = Some(choice);
            }
        };
        button(format!("Open {names}…"), "Open an image to paint on", BrushRequest::Open(layer));
        button(
            format!("Save {names}…"),
            "Save a copy as an image. Saving the scene also saves the painted images",
            BrushRequest::Save(layer),
        );
        button(clear.0.to_owned(), clear.1, BrushRequest::Clear(layer));
    });
    request
}
