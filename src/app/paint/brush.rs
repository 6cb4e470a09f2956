//! Brushes and the dabs that they paint.

use crate::geometry::image_file;
use crate::scene::Pixels;
use glam::{IVec2, Vec2, Vec3};
use std::path::Path;

/// Effect of a dab.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tool {
    Raise,
    Lower,
    Smooth,
    Flatten,
    Noise,
    Stamp,
    Color,
    Material,
}

impl Tool {
    pub const ALL: [Self; 8] =
        [Self::Raise, Self::Lower, Self::Smooth, Self::Flatten, Self::Noise, Self::Stamp, Self::Color, Self::Material];

    /// Returns true for tools that change colour or material, not shape.
    pub fn changes_material(self) -> bool {
        matches!(self, Self::Color | Self::Material)
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Raise => "Raise",
            Self::Lower => "Lower",
            Self::Smooth => "Smooth",
            Self::Flatten => "Flatten",
            Self::Noise => "Noise",
            Self::Stamp => "Stamp",
            Self::Color => "Colour",
            Self::Material => "Material",
        }
    }

    pub fn tip(self) -> &'static str {
        match self {
            Self::Raise => "Pulls the surface up",
            Self::Lower => "Pushes the surface down",
            Self::Smooth => "Smooths rough places",
            Self::Flatten => "Moves the surface towards the height at which the stroke began",
            Self::Noise => "Roughens the surface",
            Self::Stamp => "Prints a pattern",
            Self::Color => "Paints colour weights, which multiply the materials",
            Self::Material => "Paints a separate material",
        }
    }
}

/// The settings of a brush.
#[derive(Debug, Clone, PartialEq)]
pub struct Brush {
    pub tool: Tool,
    /// Radius as a fraction of the tile.
    pub radius: f32,
    /// Strength, 0 to 1.
    pub strength: f32,
    /// 0 is a hard edge; 1 falls off from the centre.
    pub falloff: f32,
    /// Strokes continue at the opposite edge of the tile.
    pub wrap: bool,
    /// Linear RGB.
    pub color: Vec3,
    /// Painted material: 0 for the surface's own one, k for the slot `paint_k`.
    pub slot: u8,
    /// Pattern of the stamp, the name of a shipped image.
    pub stamp: &'static str,
}

impl Default for Brush {
    fn default() -> Self {
        Self {
            tool: Tool::Raise,
            radius: 0.08,
            strength: 0.5,
            falloff: 0.7,
            wrap: true,
            color: Vec3::new(0.02, 0.08, 0.5),
            slot: 1,
            stamp: "hammered.png",
        }
    }
}

impl Brush {
    /// Fraction of the full effect at a distance in radii.
    fn weight(&self, distance: f32) -> f32 {
        let hard = 1.0 - self.falloff.clamp(0.0, 1.0);
        if distance >= 1.0 {
            return 0.0;
        }
        if distance <= hard {
            return 1.0;
        }
        let t = 1.0 - (distance - hard) / (1.0 - hard).max(1e-6);
        t * t * (3.0 - 2.0 * t)
    }

    /// Calls `touch(index, weight, offset in radii)` for every texel under a dab at `at` (in fractions of the tile).
    pub(super) fn for_texels(&self, size: glam::UVec2, at: Vec2, mut touch: impl FnMut(usize, f32, Vec2)) {
        let (width, height) = (size.x as i32, size.y as i32);
        if !at.is_finite() || width == 0 || height == 0 {
            return;
        }
        let center = at * size.as_vec2() - 0.5;
        let radius = self.radius.clamp(1e-3, 0.5) * size.as_vec2();
        let (low, high) = ((center - radius).ceil().as_ivec2(), (center + radius).floor().as_ivec2());
        // A brush is at most as wide as the tile, so no texel is visited twice.
        let high = high.min(low + IVec2::new(width - 1, height - 1));
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let offset = (Vec2::new(x as f32, y as f32) - center) / radius;
                let weight = self.weight(offset.length());
                let inside = x >= 0 && y >= 0 && x < width && y < height;
                if weight > 0.0 && (self.wrap || inside) {
                    touch((y.rem_euclid(height) * width + x.rem_euclid(width)) as usize, weight, offset);
                }
            }
        }
    }

    /// Paints a dab on heights. `level` is the target of flattening, `bounds` limits the heights, `pressure` is 0 to 1.
    pub fn dab(&self, image: &mut Pixels<f32>, at: Vec2, level: f32, bounds: (f32, f32), pressure: f32) {
        let before = if self.tool == Tool::Smooth { image.values.clone() } else { Vec::new() };
        let (width, height) = (image.size.x as usize, image.size.y as usize);
        let range = bounds.1 - bounds.0;
        let amount = self.strength.clamp(0.0, 1.0) * pressure.clamp(0.0, 1.0);
        let stamp = (self.tool == Tool::Stamp).then(|| Stamp::of(self.stamp));
        let values = &mut image.values;
        self.for_texels(image.size, at, |index, weight, offset| {
            let value = &mut values[index];
            let by = amount * weight;
            *value = match self.tool {
                Tool::Raise => *value + 0.12 * range * by,
                Tool::Lower => *value - 0.12 * range * by,
                Tool::Smooth => *value + (mean_around(&before, width, height, index) - *value) * by,
                Tool::Flatten => *value + (level - *value) * (0.5 * by),
                Tool::Noise => *value + (hash(index as u32) - 0.5) * (0.15 * range * by),
                Tool::Stamp => {
                    let print = stamp.as_ref().map_or(0.5, |stamp| stamp.at(offset));
                    *value + (print - 0.5) * (0.4 * range * by)
                }
                Tool::Color | Tool::Material => *value,
            }
            .clamp(bounds.0, bounds.1);
        });
    }

    /// Paints a dab of colour.
    pub fn dab_color(&self, image: &mut Pixels<Vec3>, at: Vec2, pressure: f32) {
        let amount = self.strength.clamp(0.0, 1.0) * pressure.clamp(0.0, 1.0);
        let values = &mut image.values;
        self.for_texels(image.size, at, |index, weight, _| {
            values[index] = values[index].lerp(self.color, amount * weight);
        });
    }

    /// Paints a dab of material. Its edge is hard, because a texel has exactly one material.
    pub fn dab_slot(&self, image: &mut Pixels<u8>, at: Vec2) {
        let values = &mut image.values;
        let hard = Self { falloff: 0.0, ..self.clone() };
        hard.for_texels(image.size, at, |index, _, _| values[index] = self.slot);
    }
}

fn mean_around(values: &[f32], width: usize, height: usize, index: usize) -> f32 {
    let (x, y) = (index % width, index / width);
    let column = |d: usize| (x + width - 1 + d) % width;
    let row = |d: usize| (y + height - 1 + d) % height;
    (0..9).map(|k| values[row(k / 3) * width + column(k % 3)]).sum::<f32>() / 9.0
}

/// A pseudo-random number in `[0, 1)` from a multiplicative hash.
fn hash(seed: u32) -> f32 {
    let mut x = seed.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    x ^= x >> 15;
    x = x.wrapping_mul(0x2C1B_3C6D);
    x ^= x >> 12;
    (x >> 8) as f32 / (1 << 24) as f32
}

/// A shipped pattern; `None` if it cannot be read.
struct Stamp(Option<Pixels<f32>>);

impl Stamp {
    fn of(name: &str) -> Self {
        Self(image_file::read_heights(Path::new(""), Path::new(&format!("asset:{name}"))).ok())
    }

    /// The pattern at an offset from the brush's centre, in radii.
    fn at(&self, offset: Vec2) -> f32 {
        let Some(image) = &self.0 else { return 0.5 };
        let size = image.size.as_vec2();
        let at = ((offset * 0.5 + 0.5) * size).floor().clamp(Vec2::ZERO, size - 1.0);
        image.values[at.y as usize * image.size.x as usize + at.x as usize]
    }
}
