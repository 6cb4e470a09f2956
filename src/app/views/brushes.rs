//! The brush, under the tile.

use biscale::scene::shipped;
use eframe::egui::{self, Slider, Ui};

use crate::app::paint::{Brush, Tool};
use crate::app::panels::fields::row;

/// What is asked for here besides the brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BrushAsked {
    OpenHeights,
    SaveHeights,
    OpenColors,
    SaveColors,
    Flatten,
    ClearColors,
}

pub fn ui(ui: &mut Ui, brush: &mut Brush) -> Option<BrushAsked> {
    let mut asked = None;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 5.0;
        for tool in Tool::ALL {
            if ui.selectable_label(brush.tool == tool, tool.name()).on_hover_text(tool.tip()).clicked() {
                brush.tool = tool;
            }
        }
    });
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
    percent(ui, "Strength", "How much a stroke does", &mut brush.strength, 1.0);
    percent(ui, "Softness", "0: a hard edge. 100: soft from the middle on", &mut brush.falloff, 1.0);
    row(ui, "Wrap", "Strokes go on at the opposite edge of the tile", |ui| {
        ui.checkbox(&mut brush.wrap, "around the edges")
    });
    if brush.tool == Tool::Color {
        row(ui, "Colour", "Multiplies the materials", |ui| {
            let mut rgb = brush.color.to_array();
            if ui.color_edit_button_rgb(&mut rgb).changed() {
                brush.color = rgb.into();
            }
        });
    }
    if brush.tool == Tool::Stamp {
        row(ui, "Pattern", "What the stamp prints", |ui| {
            egui::ComboBox::from_id_salt("stamp").selected_text(brush.stamp).show_ui(ui, |ui| {
                for (name, _) in shipped::ASSETS {
                    ui.selectable_value(&mut brush.stamp, *name, *name);
                }
            });
        });
    }
    ui.horizontal_wrapped(|ui| {
        let choices: &[(&str, &str, BrushAsked)] = if brush.tool == Tool::Color {
            &[
                ("Open colours…", "An image of colour weights", BrushAsked::OpenColors),
                ("Save colours…", "As .png or .exr", BrushAsked::SaveColors),
                ("No colours", "Remove what was painted", BrushAsked::ClearColors),
            ]
        } else {
            &[
                ("Open heights…", "An image of heights", BrushAsked::OpenHeights),
                ("Save heights…", "As .png or .exr", BrushAsked::SaveHeights),
                ("Flatten all", "Back to a plane", BrushAsked::Flatten),
            ]
        };
        for (name, tip, what) in choices {
            if ui.button(*name).on_hover_text(*tip).clicked() {
                asked = Some(*what);
            }
        }
    });
    ui.small("Right drag turns the tile, the wheel comes closer.");
    asked
}
