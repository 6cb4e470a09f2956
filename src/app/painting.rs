//! Painting: pointer input becomes strokes of the document.

use std::path::Path;

use crate::geometry::painted_slot;
use crate::scene::{Geometry, Pixels};
use eframe::egui::{Context, Key};
use glam::UVec2;

use super::document::{write_colors, write_heights, write_slots};
use super::editor::Editor;
use super::messages::Level;
use super::paint::{self, Stroke, Tool};
use super::panels::paints;
use super::views::brushes::{BrushRequest, PaintLayer};
use super::views::pointer::Pointer;
use super::views::tile::TileMode;

impl Editor {
    /// Applies pointer input on the tile.
    pub(super) fn paint(&mut self, pointer: Pointer) {
        match pointer {
            Pointer::Press(at, pressure) => {
                if self.stroke.is_none() && !self.begin_stroke() {
                    return;
                }
                if let Some(stroke) = &mut self.stroke {
                    stroke.move_to(&self.tile.brush, at, pressure);
                    self.document.show_stroke(stroke.images());
                }
            }
            Pointer::Released => self.end_stroke(),
        }
    }

    pub(super) fn end_stroke(&mut self) {
        if let Some(stroke) = self.stroke.take() {
            let name = match self.tile.brush.tool {
                Tool::Color => "Paint colour".to_owned(),
                Tool::Material => "Paint material".to_owned(),
                tool => format!("Paint: {}", tool.name().to_lowercase()),
            };
            self.document.end_stroke(&name, &stroke.before);
        }
    }

    /// Begins a stroke and creates the image to paint on if there is none. Returns false after an error.
    fn begin_stroke(&mut self) -> bool {
        let is_ready = match self.tile.brush.tool {
            Tool::Color => self.ensure_colors(),
            Tool::Material => self.ensure_slots(),
            _ => self.ensure_heights(),
        };
        if is_ready {
            self.messages.clear("paint");
            // Clay has neither colours nor materials.
            if matches!(self.tile.brush.tool, Tool::Color | Tool::Material) && self.tile.show == TileMode::Clay {
                self.tile.show = TileMode::Materials;
            }
            self.stroke = Some(Stroke::begin(self.document.painted()));
        }
        is_ready
    }

    fn ensure_heights(&mut self) -> bool {
        let is_field = matches!(self.document.scene().tile.geometry, Geometry::Heightfield(_));
        if is_field && self.document.painted().heights.is_some() {
            return true;
        }
        if is_field {
            match paint::heights_of(&self.document.loaded()) {
                Ok(heights) => self.document.paint_heights("Begin to paint", heights, None),
                Err(error) => {
                    self.messages.put(Level::Error, "paint", error.to_string());
                    return false;
                }
            }
            return true;
        }
        // Any other surface becomes a height field of the same shape.
        let Some(rendered) = &self.tile.rendered else { return false };
        let kind = self.document.scene().tile.geometry.kind();
        let (heights, scale) = paint::relief_of(&rendered.tile);
        self.document.paint_heights("Turn into a relief", heights, Some(scale));
        let text = format!("The {kind} are now a relief to paint on. Undo brings their parameters back.");
        self.messages.put(Level::Note, "relief", text);
        self.scene_changed();
        true
    }

    fn ensure_colors(&mut self) -> bool {
        if self.document.painted().colors.is_some() {
            return true;
        }
        match paint::colors_of(&self.document.loaded()) {
            Ok(colors) => self.document.paint_colors("Begin to paint colours", Some(colors)),
            Err(error) => {
                self.messages.put(Level::Error, "paint", error.to_string());
                return false;
            }
        }
        true
    }

    /// Creates the image of slots, and the material that the brush paints, if they do not exist.
    fn ensure_slots(&mut self) -> bool {
        let mut scene = (**self.document.scene()).clone();
        let added = paints::add_painted(&mut scene, self.tile.brush.slot);
        if self.document.painted().slots.is_some() && !added {
            return true;
        }
        match paint::slots_of(&self.document.loaded()) {
            Ok(slots) => self.document.paint_slots("Begin to paint materials", scene, Some(slots)),
            Err(error) => {
                self.messages.put(Level::Error, "paint", error.to_string());
                return false;
            }
        }
        if added {
            let name = crate::app::panels::fields::display_name(&painted_slot(self.tile.brush.slot));
            let text = format!("\"{name}\" is a new material: its BRDF and colour are on the right, under Materials.");
            self.messages.put(Level::Note, "relief", text);
        }
        true
    }

    /// Changes the radius of the brush with the keys [ and ].
    pub(super) fn brush_keys(&mut self, ctx: &Context) {
        if self.tile.painting && !ctx.text_edit_focused() {
            let (smaller, larger) =
                ctx.input(|input| (input.key_pressed(Key::OpenBracket), input.key_pressed(Key::CloseBracket)));
            let factor = if smaller {
                1.0 / 1.25
            } else if larger {
                1.25
            } else {
                1.0
            };
            self.tile.brush.radius = (self.tile.brush.radius * factor).clamp(0.005, 0.5);
        }
    }

    pub(super) fn apply_brush_request(&mut self, request: BrushRequest) {
        use super::dialogs::Purpose;
        match request {
            BrushRequest::Open(layer) => self.browse(Purpose::Paint(layer), ""),
            BrushRequest::Save(layer) => self.browse(Purpose::SavePaint(layer), layer.file()),
            BrushRequest::Clear(PaintLayer::Heights) => {
                let size = self.document.painted().heights.as_ref().map_or(UVec2::splat(128), |image| image.size);
                let plane = Pixels { size, values: vec![0.5; (size.x * size.y) as usize] };
                self.document.paint_heights("Flatten all", plane, None);
            }
            BrushRequest::Clear(PaintLayer::Colors) => self.document.paint_colors("No colours", None),
            BrushRequest::Clear(PaintLayer::Slots) => {
                let scene = (**self.document.scene()).clone();
                self.document.paint_slots("No painted materials", scene, None);
            }
        }
        self.scene_changed();
    }

    /// Writes one painted image to a file.
    pub(super) fn save_image(&mut self, path: &Path, layer: PaintLayer) {
        let loaded = self.document.loaded();
        let written = match layer {
            PaintLayer::Heights => paint::heights_of(&loaded).and_then(|image| write_heights(&image, path)),
            PaintLayer::Colors => paint::colors_of(&loaded).and_then(|image| write_colors(&image, path)),
            PaintLayer::Slots => paint::slots_of(&loaded).and_then(|image| write_slots(&image, path)),
        };
        match written {
            Ok(()) => self.messages.put(Level::Note, "save", format!("Saved {}.", path.display())),
            Err(error) => self.messages.put(Level::Error, "save", error.to_string()),
        }
    }

    /// Paints a stroke along a path.
    #[cfg(test)]
    pub fn draw(&mut self, path: &[glam::Vec2]) {
        for at in path {
            self.paint(Pointer::Press(*at, 1.0));
        }
        self.paint(Pointer::Released);
    }
}
