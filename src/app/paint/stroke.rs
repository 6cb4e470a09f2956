//! A stroke: dabs along the way of the hand, from an image to an image.

use std::sync::Arc;

use crate::scene::{Painted, Pixels};
use glam::{Vec2, Vec3};

use super::brush::{Brush, Tool};

/// Dabs are this many radii apart.
const SPACING: f32 = 0.25;

/// A stroke while it is drawn.
#[derive(Debug)]
pub struct Stroke {
    /// What was there before.
    pub before: Painted,
    heights: Option<Arc<Pixels<f32>>>,
    colors: Option<Arc<Pixels<Vec3>>>,
    slots: Option<Arc<Pixels<u8>>>,
    last: Option<Vec2>,
    level: f32,
    bounds: (f32, f32),
}

impl Stroke {
    /// Begins on the images that are there.
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

    /// The hand is at `at` (parts of the tile; not wrapped, so that a way across the edge is short).
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
        let way = at - last;
        // A jump over many tiles is no stroke.
        let count = ((way.length() / step) as usize).min(400);
        for k in 1..=count {
            self.dab(brush, last + way * (k as f32 * step / way.length()), pressure);
        }
        if count > 0 {
            self.last = Some(last + way * (count as f32 * step / way.length()));
        }
    }

    fn dab(&mut self, brush: &Brush, at: Vec2, pressure: f32) {
        match (brush.tool, &mut self.heights, &mut self.colors, &mut self.slots) {
            (Tool::Color, _, Some(image), _) => brush.dab_color(Arc::make_mut(image), at, pressure),
            (Tool::MaterialSpec, _, _, Some(image)) => brush.dab_slot(Arc::make_mut(image), at),
            (Tool::Color | Tool::MaterialSpec, ..) => {}
            (_, Some(image), ..) => brush.dab(Arc::make_mut(image), at, self.level, self.bounds, pressure),
            _ => {}
        }
    }

    /// The images as the stroke left them.
    pub fn images(&self) -> Painted {
        Painted { heights: self.heights.clone(), colors: self.colors.clone(), slots: self.slots.clone() }
    }
}

fn value_at(image: &Pixels<f32>, at: Vec2) -> f32 {
    let cell = (at * image.size.as_vec2()).floor().as_ivec2().rem_euclid(image.size.as_ivec2());
    image.values.get((cell.y * image.size.x as i32 + cell.x) as usize).copied().unwrap_or(0.5)
}
