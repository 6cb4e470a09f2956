//! Sheets made by formulas: what the shipped scenes show, and known sheets that a capture must find again.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, Vec3};

use super::super::ellipse::{Ellipse, Profile};
use super::lobe::{LobeOptics, PointModel, SlopeGrid};
use super::svbtdf::Svbtdf;

/// A sheet of a figure of Dai et al. 2009, made by formulas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// Film with ribs along both axes, which blur strongly across them.
    GridSheet,
    /// Glass with rough leaves and smoother veins on a nearly smooth ground.
    LeafGlass,
    /// Paper with fibres.
    RicePaper,
}

/// All patterns with the names of their files.
pub const PATTERNS: [(Pattern, &str); 3] =
    [(Pattern::GridSheet, "grid_sheet"), (Pattern::LeafGlass, "leaf_glass"), (Pattern::RicePaper, "rice_paper")];

/// A kind of surface: roughnesses along two axes, the rotation of the first [rad], and α.
#[derive(Clone, Copy)]
struct Material {
    roughness: DVec2,
    rotation: f64,
    alpha: f64,
}

/// Composition of a place of a sheet: parts of its materials, `k_s`, and the diffuse part.
struct Place {
    parts: Vec<(usize, f64)>,
    scale: Vec3,
    diffuse: Vec3,
}

/// Materials that are mixed at one place, at most.
const MIXED: usize = 3;
/// Steps of the direction of fibres and veins.
const TURNS: usize = 8;

impl Pattern {
    /// The sheet with pixels of this size.
    pub fn sheet(self, size: [usize; 2]) -> Svbtdf {
        let grid = SlopeGrid { side: 32, span: 1.0 };
        let (mut index, mut weight, mut scale, mut diffuse) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..size[0] * size[1] {
            let at = DVec2::new((pixel % size[0]) as f64, (pixel / size[0]) as f64) + 0.5;
            let place = self.place(at / DVec2::new(size[0] as f64, size[1] as f64));
            let total: f64 = place.parts.iter().map(|part| part.1).sum();
            for k in 0..MIXED {
                let (material, part) = place.parts.get(k).copied().unwrap_or((0, 0.0));
                index.push(material as u32);
                weight.push((part / total) as f32);
            }
            scale.push(place.scale);
            diffuse.push(place.diffuse);
        }
        let models = self.materials().iter().map(|material| model(grid, material)).collect();
        let optics = LobeOptics::new(self.eta(), 0.2);
        Svbtdf { size, optics, grid, models, neighbours: MIXED, index, weight, scale, diffuse, bounced: None }
    }

    /// Index of refraction (Table 1 of Dai et al. 2009).
    fn eta(self) -> f64 {
        match self {
            Self::GridSheet => 1.4,
            Self::LeafGlass => 1.5,
            Self::RicePaper => 1.55,
        }
    }

    fn materials(self) -> Vec<Material> {
        let of = |x: f64, y: f64, rotation: f64, alpha: f64| Material { roughness: DVec2::new(x, y), rotation, alpha };
        let turned = |x: f64, y: f64, alpha: f64| {
            (0..TURNS).map(move |k| of(x, y, PI * k as f64 / TURNS as f64, alpha)).collect::<Vec<_>>()
        };
        match self {
            Self::GridSheet => {
                vec![of(0.08, 0.08, 0.0, 0.5), of(0.32, 0.08, 0.0, 0.8), of(0.08, 0.32, 0.0, 0.8)]
            }
            Self::LeafGlass => {
                [vec![of(0.09, 0.09, 0.0, 0.3), of(0.26, 0.26, 0.0, 0.7)], turned(0.08, 0.24, 0.7)].concat()
            }
            Self::RicePaper => [vec![of(0.24, 0.24, 0.0, 0.5)], turned(0.14, 0.3, 0.5)].concat(),
        }
    }

    /// The sheet at a place, 0 to 1 along both axes. It repeats.
    fn place(self, at: DVec2) -> Place {
        match self {
            Self::GridSheet => {
                // One rib along each axis per period.
                let rib = |x: f64| (0.5 + 0.5 * (TAU * x).cos()).powi(2);
                let [x, y] = [rib(at.x), rib(at.y)];
                let parts = vec![(0, (1.0 - x) * (1.0 - y) + 1e-3), (1, x), (2, y)];
                Place { parts, scale: Vec3::splat(0.95), diffuse: Vec3::splat(0.005) }
            }
            Self::LeafGlass => leaf_glass(at),
            Self::RicePaper => rice_paper(at),
        }
    }
}

fn model(grid: SlopeGrid, material: &Material) -> PointModel {
    let ellipse = Ellipse::new(Profile::Beckmann, material.roughness, material.rotation);
    let ln = |k: usize| ellipse.as_ref().map_or(0.0, |ellipse| ellipse.density(grid.node(k)).max(1e-30).ln());
    let ln_density = (0..grid.side * grid.side).map(ln).collect();
    let mut model = PointModel { grid, alpha: material.alpha, ln_density };
    model.normalise();
    model
}

/// The turned material that lies nearest to an angle, after `first` others.
fn turned(first: usize, angle: f64) -> usize {
    first + ((angle / PI * TURNS as f64).round() as i64).rem_euclid(TURNS as i64) as usize
}

/// 1 below 0, 0 above 1, smooth between.
fn fade(x: f64) -> f64 {
    let t = 1.0 - x.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The shortest way from one place to another on a sheet that repeats.
fn shortest(from: DVec2, to: DVec2) -> DVec2 {
    let d = to - from;
    d - d.round()
}

fn leaf_glass(at: DVec2) -> Place {
    let (mut leaf, mut vein, mut direction) = (0.0_f64, 0.0_f64, 0.0);
    for k in 0..5_u32 {
        let middle = DVec2::new(f64::from(k) * 0.618_034, f64::from(k) * 0.381_966 + 0.2).fract_gl();
        let along = DVec2::from_angle(f64::from(k) * 2.4);
        let d = shortest(middle, at);
        let (x, y) = (d.dot(along) / 0.26, d.perp_dot(along) / 0.26);
        // A leaf is a lens that ends in two tips.
        let width = 0.5 * (1.0 - x * x).max(0.0);
        let inside = fade((y.abs() - width) / 0.06 + 0.5) * fade((x.abs() - 0.97) / 0.06 + 0.5);
        leaf = leaf.max(inside);
        let side = (x - 1.3 * y.abs()) * 6.0;
        let of_vein = inside * fade(y.abs() / 0.07).max(0.8 * fade((side - side.round()).abs() / 0.35));
        if of_vein > vein {
            let is_middle = y.abs() < 0.07;
            let angle = f64::from(k) * 2.4 + if is_middle { 0.0 } else { 0.65 * y.signum() };
            (vein, direction) = (of_vein, angle);
        }
    }
    let parts = vec![(0, (1.0 - leaf) + 1e-3), (1, leaf * (1.0 - vein)), (turned(2, direction), leaf * vein)];
    let scale = Vec3::new(0.78, 0.95, 0.84).lerp(Vec3::new(0.5, 0.85, 0.6), leaf as f32);
    Place { parts, scale, diffuse: Vec3::splat(0.01) * (1.0 + leaf as f32) }
}

fn rice_paper(at: DVec2) -> Place {
    let (mut fibre, mut direction) = (0.0_f64, 0.0);
    for k in 0..26_u32 {
        let middle = DVec2::new(f64::from(k) * 0.754_877_7, f64::from(k) * 0.569_840_3).fract_gl();
        let angle = f64::from(k) * 1.9 + 0.3;
        let along = DVec2::from_angle(angle);
        let d = shortest(middle, at);
        let x = d.dot(along) / 0.24;
        // Fibres bend.
        let y = d.perp_dot(along) - 0.02 * (4.0 * x + f64::from(k)).sin();
        let of_fibre = fade(y.abs() / 0.02) * fade((x.abs() - 0.8) / 0.2);
        if of_fibre > fibre {
            (fibre, direction) = (of_fibre, angle);
        }
    }
    let cloud = 0.5 + 0.25 * ((TAU * (at.x + 2.0 * at.y)).sin() + (TAU * (2.0 * at.x - at.y)).cos());
    let parts = vec![(0, 1.0 - fibre + 1e-3), (turned(1, direction), fibre)];
    let scale = Vec3::new(0.66, 0.62, 0.54) * (1.0 - 0.45 * fibre as f32) * (0.8 + 0.2 * cloud as f32);
    Place { parts, scale, diffuse: Vec3::new(0.07, 0.066, 0.058) * (1.0 + 0.5 * fibre as f32) }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::slab::capture::svbtdf::Svbtdf;

    /// Pixels of the shipped sheets. The ribs of the grid repeat.
    fn shipped_size(pattern: Pattern) -> [usize; 2] {
        if pattern == Pattern::GridSheet { [16, 16] } else { [64, 64] }
    }

    fn path(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("sheets").join(name).with_extension("npz")
    }

    #[test]
    #[ignore = "writes sheets/"]
    fn write_the_sheets() {
        for (pattern, name) in PATTERNS {
            pattern.sheet(shipped_size(pattern)).write(&path(name)).unwrap();
        }
    }

    #[test]
    fn the_shipped_sheets_match_their_formulas() {
        for (pattern, name) in PATTERNS {
            let shipped = Svbtdf::read(&PathBuf::from(format!("asset:{name}.npz"))).unwrap();
            let sheet = pattern.sheet(shipped_size(pattern));
            assert_eq!((shipped.size, &shipped.index), (sheet.size, &sheet.index), "{name}");
            for (a, b) in shipped.weight.iter().zip(&sheet.weight) {
                assert!((a - b).abs() < 1e-5, "{name}");
            }
            for (a, b) in shipped.models.iter().zip(&sheet.models) {
                assert!((a.density(DVec2::splat(0.1)) / b.density(DVec2::splat(0.1)) - 1.0).abs() < 1e-4, "{name}");
            }
        }
    }

    #[test]
    fn the_ribs_of_the_grid_sheet_blur_across_themselves() {
        let sheet = Pattern::GridSheet.sheet([16, 16]);
        // The first column lies on a rib along y, the first row on one along x.
        let squares = |pixel: usize| sheet.model(pixel).moments().2;
        let (on_x, on_y) = (squares(8 * 16), squares(8));
        assert!(on_x.x > 4.0 * on_x.y && on_y.y > 4.0 * on_y.x, "{on_x} {on_y}");
    }
}
