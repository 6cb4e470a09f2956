//! Strokes: dabs along the path of the pointer.

use std::sync::Arc;

use crate::scene::{Painted, Pixels};
use glam::{Vec2, Vec3};

use super::brush::{Brush, Tool};

/// Distance between dabs in radii.
const SPACING: f32 = 0.25;

/// A stroke that the user is drawing.
#[derive(Debug)]
pub struct Stroke {
    /// The images at the start of the stroke.
    pub before: Painted,
    heights: Option<Arc<Pixels<f32>>>,
    colors: Option<Arc<Pixels<Vec3>>>,
    slots: Option<Arc<Pixels<u8>>>,
    last: Option<Vec2>,
    level: f32,
    bounds: (f32, f32),
}

impl Stroke {
    /// Begins a stroke on these images.
    pub fn begin(before: &Painted) -> Self {
        let heights = before.heights.clone();
        let (low, high) = heights
            .iter()
            .flat_map(|image| &image.values)
            .fold((0.0_f32, 1.0_f32), |(low, high), value| (low.min(*value), high.max(*value)));
        Self {
            before: before.clone(),
            heights,
            colors: before.colors.clone(),
            slots: before.slots.clone(),
            last: None,
            level: 0.5,
            bounds: (low, high),
        }
    }

    /// Continues the stroke to `at`, in fractions of the tile. Positions are not wrapped, so that a path across an edge
    /// is short.
    pub fn move_to(&mut self, brush: &Brush, at: Vec2, pressure: f32) {
        if !at.is_finite() {
            return;
        }
        let Some(last) = self.last else {
            self.level = self.heights.as_ref().map_or(0.5, |image| value_at(image, at));
            self.dab(brush, at, pressure);
            self.last = Some(at);
            return;
        };
        let step = (SPACING * brush.radius).max(1e-3);
        let path = at - last;
        // The number of dabs is limited, because a jump over many tiles is not a stroke.
        let count = ((path.length() / step) as usize).min(400);
        for k in 1..=count {
            self.dab(brush, last + path * (k as f32 * step / path.length()), pressure);
        }
        if count > 0 {
            self.last = Some(last + path * (count as f32 * step / path.length()));
        }
    }

    fn dab(&mut self, brush: &Brush, at: Vec2, pressure: f32) {
        match (brush.tool, &mut self.heights, &mut self.colors, &mut self.slots) {
            (Tool::Color, _, Some(image), _) => brush.dab_color(Arc::make_mut(image), at, pressure),
            (Tool::Material, _, _, Some(image)) => brush.dab_slot(Arc::make_mut(image), at),
            (Tool::Color | Tool::Material, ..) => {}
            (_, Some(image), ..) => brush.dab(Arc::make_mut(image), at, self.level, self.bounds, pressure),
            _ => {}
        }
    }

    /// The images after the stroke.
    pub fn images(&self) -> Painted {
        Painted { heights: self.heights.clone(), colors: self.colors.clone(), slots: self.slots.clone() }
    }
}

fn value_at(image: &Pixels<f32>, at: Vec2) -> f32 {
    let cell = (at * image.size.as_vec2()).floor().as_ivec2().rem_euclid(image.size.as_ivec2());
    image.values.get((cell.y * image.size.x as i32 + cell.x) as usize).copied().unwrap_or(0.5)
}
