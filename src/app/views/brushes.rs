//! The brush, under the tile.

use crate::geometry::image_file::MAX_SLOTS;
use crate::geometry::painted_slot;
use crate::scene::{Scene, shipped};
use eframe::egui::{self, Slider, Ui};

use crate::app::paint::{Brush, Tool};
use crate::app::panels::fields::{row, words};
use crate::app::panels::paints;

/// An image over the tile that is painted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    Heights,
    Colors,
    Slots,
}

impl Layer {
    /// What its file is called unless a person says otherwise.
    pub fn file(self) -> &'static str {
        match self {
            Self::Heights => "heights.png",
            Self::Colors => "colors.png",
            Self::Slots => "materials.png",
        }
    }
}

/// What is asked for here besides the brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BrushAsked {
    Open(Layer),
    Save(Layer),
    Clear(Layer),
}

/// `scene` tells which materials there are to paint with.
pub fn ui(ui: &mut Ui, brush: &mut Brush, scene: &Scene) -> Option<BrushAsked> {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 5.0;
        let shape = Tool::ALL.iter().filter(|tool| !tool.prints());
        shape.for_each(|tool| tool_ui(ui, brush, *tool));
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 5.0;
        Tool::ALL.iter().filter(|tool| tool.prints()).for_each(|tool| tool_ui(ui, brush, *tool));
    });
    shape_ui(ui, brush);
    match brush.tool {
        Tool::Color => color_ui(ui, brush),
        Tool::MaterialSpec => material_ui(ui, brush, scene),
        Tool::Stamp => stamp_ui(ui, brush),
        _ => {}
    }
    let asked = files_ui(ui, brush.tool);
    ui.small("Right drag turns the tile, the wheel comes closer.");
    asked
}

fn tool_ui(ui: &mut Ui, brush: &mut Brush, tool: Tool) {
    if ui.selectable_label(brush.tool == tool, tool.name()).on_hover_text(tool.tip()).clicked() {
        brush.tool = tool;
    }
}

/// Size, strength, edge.
fn shape_ui(ui: &mut Ui, brush: &mut Brush) {
    let percent = |ui: &mut Ui, caption: &str, tip: &str, value: &mut f32, most: f32| {
        row(ui, caption, tip, |ui| {
            let mut shown = *value * 100.0;
            ui.spacing_mut().slider_width = (ui.available_width() - 70.0).max(40.0);
            let slider = Slider::new(&mut shown, if most > 0.6 { 0.0 } else { 0.5 }..=most * 100.0);
            if ui.add(slider.suffix(" %").max_decimals(1)).changed() {
                *value = shown / 100.0;
            }
        });
    };
    percent(ui, "Size", "Radius as a part of the tile ([ and ])", &mut brush.radius, 0.5);
    // A place has one material, wholly.
    if brush.tool != Tool::MaterialSpec {
        percent(ui, "Strength", "How much a stroke does; a pen's pressure lessens it", &mut brush.strength, 1.0);
        percent(ui, "Softness", "0: a hard edge. 100: soft from the middle on", &mut brush.falloff, 1.0);
    }
    row(ui, "Wrap", "Strokes go on at the opposite edge of the tile", |ui| {
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

/// Which material is painted: the surface's own, those that there are, or one more.
fn material_ui(ui: &mut Ui, brush: &mut Brush, scene: &Scene) {
    let there = paints::painted(scene);
    // The first stroke makes the material.
    let next = (1..=MAX_SLOTS).find(|slot| !there.contains(slot));
    let name = |slot: u8| if slot == 0 { "The surface's own".to_owned() } else { words(&painted_slot(slot)) };
    let shown = if Some(brush.slot) == next { format!("{} (new)", name(brush.slot)) } else { name(brush.slot) };
    row(ui, "Material", "What the places that are painted wear; its BRDF is under Materials", |ui| {
        egui::ComboBox::from_id_salt("paint material").selected_text(shown).width(150.0).show_ui(ui, |ui| {
            for slot in std::iter::once(0).chain(there) {
                ui.selectable_value(&mut brush.slot, slot, name(slot));
            }
            if let Some(next) = next {
                ui.selectable_value(&mut brush.slot, next, "A new material");
            }
        });
    });
}

fn stamp_ui(ui: &mut Ui, brush: &mut Brush) {
    row(ui, "Pattern", "What the stamp prints", |ui| {
        egui::ComboBox::from_id_salt("stamp").selected_text(stem(brush.stamp)).show_ui(ui, |ui| {
            for (name, _) in shipped::ASSETS {
                ui.selectable_value(&mut brush.stamp, *name, stem(name));
            }
        });
    });
}

/// A shipped image as a person calls it.
fn stem(file: &str) -> String {
    words(file.split('.').next().unwrap_or(file))
}

/// Images of the layer that the brush paints on.
fn files_ui(ui: &mut Ui, tool: Tool) -> Option<BrushAsked> {
    let (layer, names, clear) = match tool {
        Tool::Color => (Layer::Colors, "colours", ("No colours", "Remove what was painted")),
        Tool::MaterialSpec => {
            (Layer::Slots, "materials", ("No materials", "Every place wears the surface's own again"))
        }
        _ => (Layer::Heights, "heights", ("Flatten all", "Back to a plane")),
    };
    let mut asked = None;
    ui.horizontal_wrapped(|ui| {
        let mut button = |name: String, tip: &str, what: BrushAsked| {
            if ui.button(name).on_hover_text(tip).clicked() {
                asked = Some(what);
            }
        };
        button(format!("Open {names}…"), "An image to go on with", BrushAsked::Open(layer));
        button(format!("Save {names}…"), "As an image, beside what the scene saves by itself", BrushAsked::Save(layer));
        button(clear.0.to_owned(), clear.1, BrushAsked::Clear(layer));
    });
    asked
}
