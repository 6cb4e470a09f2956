//! Corrections that bring the mean of the pixels over a tile to `f̄` at every width, measured on the tile itself.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::object::PixelOnTile;
use super::radiance::PixelMaterials;
use super::surface::FilteredTile;
use crate::color_map::slopes::direction;
use crate::effective::Reflectance;

/// Polar angles of viewer and light, and differences of their azimuths, between which corrections are interpolated [deg].
const POLAR: [f64; 6] = [0.0, 30.0, 50.0, 65.0, 76.0, 85.0];
const APART: [f64; 5] = [0.0, 30.0, 75.0, 125.0, 180.0];
/// Azimuths of the viewer, over which a correction is averaged.
const AZIMUTHS: usize = 8;
/// Pixels along a side of the tile: per width of a pixel, and their bounds.
const PER_WIDTH: f64 = 1.5;
const SIDES: (f64, f64) = (12.0, 32.0);
/// Bound of a correction.
const MOST: f32 = 2.0;

/// Corrections of pixels by width and directions. Widths that were not measured have none.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Corrections of each level: light fastest, then view.
    levels: Vec<Option<Vec<Vec3>>>,
}

impl Calibration {
    /// No correction at any width.
    pub fn none() -> Self {
        Self { levels: Vec::new() }
    }

    /// Measures the corrections of pixels between two widths [tile units], apart from those that are known.
    pub fn measure(
        &mut self,
        tile: &FilteredTile,
        materials: &PixelMaterials<'_>,
        reflectance: &dyn Reflectance,
        widths: (f64, f64),
    ) {
        let levels = tile.levels();
        self.levels.resize(levels, None);
        let (first, last) = (tile.level(widths.0).finer, tile.level(widths.1).finer + 1);
        for level in first..=last.min(levels - 1) {
            if self.levels[level].is_none() && tile.width(level) < tile.far() {
                let corrections = POLAR
                    .iter()
                    .flat_map(|view| of_view(tile, materials, reflectance, tile.width(level), view.to_radians()));
                self.levels[level] = Some(corrections.collect());
            }
        }
    }

    /// The correction of a pixel of this width.
    pub(super) fn at(&self, tile: &FilteredTile, width: f64, i: DVec3, o: DVec3) -> Vec3 {
        let level = tile.level(width);
        let of = |level: usize| match self.levels.get(level) {
            Some(Some(corrections)) => interpolated(corrections, i, o),
            _ => Vec3::ONE,
        };
        of(level.finer).lerp(of(level.finer + 1), level.weight)
    }
}

/// Directions of light at all nodes, for a viewer at this azimuth [rad].
fn lights(azimuth: f64, side: f64) -> Vec<Vec3> {
    let light =
        |apart: f64| POLAR.map(|polar| direction(polar.to_radians(), azimuth + side * apart.to_radians()).as_vec3());
    APART.iter().flat_map(|apart| light(*apart)).collect()
}

/// Corrections of a view at all nodes of the light: the mean of `f̄` over that of the pixels.
fn of_view(
    tile: &FilteredTile,
    materials: &PixelMaterials<'_>,
    reflectance: &dyn Reflectance,
    width: f64,
    theta: f64,
) -> Vec<Vec3> {
    let views: Vec<(Vec3, Vec<Vec3>, Vec<Vec3>)> = (0..AZIMUTHS)
        .map(|k| {
            let azimuth = TAU * k as f64 / AZIMUTHS as f64;
            let (o, lights) =
                (direction(theta, azimuth).as_vec3(), lights(azimuth, if k % 2 == 0 { 1.0 } else { -1.0 }));
            let mut far = vec![Vec3::ZERO; lights.len()];
            reflectance.eval_lights(&lights, o, &mut far);
            (o, lights, far)
        })
        .collect();
    let counts = (tile.size() * PER_WIDTH / width).ceil().clamp(DVec2::splat(SIDES.0), DVec2::splat(SIDES.1));
    let [columns, rows] = [counts.x as usize, counts.y as usize];
    let none = Calibration::none();
    let pixel = |k: usize| -> Vec<[Vec3; 2]> {
        let place = (DVec2::new((k % columns) as f64, (k / columns) as f64) + 0.5) / counts;
        // Neighbours in a row and in a column have different azimuths.
        let (o, lights, far) = &views[(k % columns + 3 * (k / columns)) % AZIMUTHS];
        let mut values = far.clone();
        let pixel = PixelOnTile { centre: place * tile.size(), width };
        tile.eval_lights(&pixel, lights, *o, materials, &none, &mut values);
        values.into_iter().zip(far).map(|(value, far)| [value, *far]).collect()
    };
    let pixels: Vec<Vec<[Vec3; 2]>> = (0..columns * rows).into_par_iter().with_min_len(8).map(pixel).collect();
    let correction = |light: usize| {
        let sum = |k: usize| pixels.iter().map(|values| values[light][k].as_dvec3()).sum::<DVec3>();
        let (ours, exact) = (sum(0), sum(1));
        let least = DVec3::splat(1e-9 + 1e-4 * exact.max_element());
        ((exact + least) / (ours + least)).as_vec3().clamp(Vec3::splat(1.0 / MOST), Vec3::splat(MOST))
    };
    (0..POLAR.len() * APART.len()).map(correction).collect()
}

/// The node below a value, and the part of the way to the next.
fn node(nodes: &[f64], value: f64) -> (usize, f32) {
    let k = (nodes.partition_point(|node| *node <= value).max(1) - 1).min(nodes.len() - 2);
    (k, ((value - nodes[k]) / (nodes[k + 1] - nodes[k])).clamp(0.0, 1.0) as f32)
}

fn interpolated(corrections: &[Vec3], i: DVec3, o: DVec3) -> Vec3 {
    let polar = |d: DVec3| d.z.clamp(-1.0, 1.0).acos().to_degrees();
    let turn = (i.y.atan2(i.x) - o.y.atan2(o.x)).rem_euclid(TAU);
    let apart = turn.min(TAU - turn).clamp(0.0, PI).to_degrees();
    let (view, light, apart) = (node(&POLAR, polar(o)), node(&POLAR, polar(i)), node(&APART, apart));
    let mut sum = Vec3::ZERO;
    for corner in 0..8 {
        let take = |bit: usize, (k, f): (usize, f32)| if corner >> bit & 1 == 1 { (k + 1, f) } else { (k, 1.0 - f) };
        let ((v, a), (l, b), (d, c)) = (take(0, view), take(1, light), take(2, apart));
        sum += corrections[(v * APART.len() + d) * POLAR.len() + l] * (a * b * c);
    }
    sum
}
