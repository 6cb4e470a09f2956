//! Corrections that bring the mean of the pixels over a tile to `f̄` at every width, measured on the tile itself.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, PoisonError};

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::object::{PixelOnTile, above};
use super::radiance::PixelMaterials;
use super::surface::FilteredTile;
use crate::base::{Cancel, Result};
use crate::color_map::slopes::direction;
use crate::effective::Reflectance;

/// Polar angles of viewer and light, and differences of their azimuths, between which corrections are interpolated [deg].
const POLAR: [f64; 6] = [0.0, 30.0, 50.0, 65.0, 76.0, 85.0];
const APART: [f64; 5] = [0.0, 30.0, 75.0, 125.0, 180.0];
/// Azimuths of the viewer, over which a correction is averaged.
const AZIMUTHS: usize = 8;
/// Pixels along a side of the tile. With half as many, the mean of few hills is wrong by 4.7 % in place of 2.4 %.
const SIDE: usize = 24;
/// Bound of a correction.
const MOST: f64 = 2.0;
/// Polar angles of light and viewer at which an `f̄` is recognized [rad].
const PROBES: [[f64; 2]; 4] = [[0.2, 0.4], [0.9, 0.5], [1.2, 1.3], [0.6, 1.0]];

/// Corrections of pixels by width and directions. Widths that were not measured have none.
#[derive(Debug, Clone, Default)]
pub struct Calibration {
    /// `f̄` at a few pairs of directions, to which the corrections belong.
    of: Vec<Vec3>,
    /// Corrections of each level: light fastest, then view.
    levels: Vec<Option<Arc<Vec<Vec3>>>>,
}

/// Where the corrections of an image come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corrections {
    /// Those that are missing are measured, which takes longer than a draft may.
    Measured,
    /// Widths whose corrections are not known have none.
    Known,
}

impl FilteredTile {
    /// The corrections that are known so far.
    pub(super) fn known_calibration(&self) -> Calibration {
        self.calibration.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The corrections of pixels between two widths [tile units]. Those that are not known yet are measured and kept.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn calibrated(
        &self,
        materials: &PixelMaterials<'_>,
        reflectance: &dyn Reflectance,
        widths: (f64, f64),
        cancel: &Cancel,
    ) -> Result<Calibration> {
        if self.is_analytic {
            return Ok(Calibration::none());
        }
        let of = PROBES.map(|[i, o]| {
            let mut value = [Vec3::ZERO];
            reflectance.eval_lights(&[direction(i, 0.3).as_vec3()], direction(o, 1.7).as_vec3(), &mut value);
            value[0]
        });
        let mut kept = self.calibration.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.of != of {
            *kept = Calibration { of: of.to_vec(), levels: vec![None; self.levels()] };
        }
        let (first, last) = (self.level(widths.0).finer, (self.level(widths.1).finer + 1).min(self.levels() - 1));
        let missing: Vec<usize> =
            (first..=last).filter(|level| kept.levels[*level].is_none() && self.width(*level) < self.far()).collect();
        let corrections = measured(self, materials, reflectance, &missing, cancel)?;
        for (level, corrections) in missing.into_iter().zip(corrections) {
            kept.levels[level] = Some(Arc::new(corrections));
        }
        Ok(kept.clone())
    }
}

impl Calibration {
    /// No correction at any width.
    pub fn none() -> Self {
        Self::default()
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

/// Viewers at one polar angle, each with its lights and `f̄`.
struct Viewers(Vec<(DVec3, Vec<Vec3>, Vec<Vec3>)>);

/// Values of pixels along rows: for each pixel those of all lights, without and with the part that `f̄` has in them.
type Values = Vec<Vec<DVec3>>;

impl Viewers {
    fn new(reflectance: &dyn Reflectance, theta: f64) -> Self {
        let viewer = |k: usize| {
            let azimuth = TAU * k as f64 / AZIMUTHS as f64;
            let (o, lights) = (
                above(direction(theta, azimuth).as_vec3()),
                lights(azimuth, if k.is_multiple_of(2) { 1.0 } else { -1.0 }),
            );
            let mut far = vec![Vec3::ZERO; lights.len()];
            reflectance.eval_lights(&lights, o.as_vec3(), &mut far);
            (o, lights, far)
        };
        Self((0..AZIMUTHS).map(viewer).collect())
    }

    /// The viewer of a pixel: neighbours in a row and in a column have different azimuths.
    fn of_pixel(&self, x: usize, y: usize) -> &(DVec3, Vec<Vec3>, Vec<Vec3>) {
        &self.0[(x + 3 * y) % AZIMUTHS]
    }

    /// Values of pixels of a width over the tile. The mean over a tile is that of parts of pixels, whatever their number.
    fn values(&self, tile: &FilteredTile, materials: &PixelMaterials<'_>, width: f64) -> Values {
        let ratios: Vec<Vec<DVec3>> = self
            .0
            .iter()
            .map(|(o, lights, far)| {
                let mut ratios = vec![DVec3::ONE; lights.len()];
                tile.times_far(lights, *o, width, materials, far, &mut ratios);
                ratios
            })
            .collect();
        let pixel = |k: usize| {
            let (x, y) = (k % SIDE, k / SIDE);
            let (o, lights, _) = self.of_pixel(x, y);
            let centre = (DVec2::new(x as f64, y as f64) + 0.5) / SIDE as f64 * tile.size();
            let mut values = vec![DVec3::ZERO; lights.len()];
            tile.add_part(&PixelOnTile { centre, width }, lights, *o, materials, &mut values);
            values.iter_mut().zip(&ratios[(x + 3 * y) % AZIMUTHS]).for_each(|(value, ratio)| *value *= *ratio);
            values
        };
        (0..SIDE * SIDE).into_par_iter().with_min_len(8).map(pixel).collect()
    }

    /// `f̄` of each of these pixels.
    fn far(&self) -> impl Iterator<Item = &Vec<Vec3>> + Clone {
        (0..SIDE * SIDE).map(|k| &self.of_pixel(k % SIDE, k / SIDE).2)
    }
}

/// Corrections of levels at all nodes: the mean of `f̄` over that of the pixels.
fn measured(
    tile: &FilteredTile,
    materials: &PixelMaterials<'_>,
    reflectance: &dyn Reflectance,
    levels: &[usize],
    cancel: &Cancel,
) -> Result<Vec<Vec<Vec3>>> {
    let mut corrections = vec![Vec::new(); levels.len()];
    if levels.is_empty() {
        return Ok(corrections);
    }
    for theta in POLAR {
        let viewers = Viewers::new(reflectance, theta.to_radians());
        // Points of the surface have the mean `f̄`. Their deviation from it is the sampling error that the pixels share.
        let points = viewers.values(tile, materials, 0.0);
        for (level, corrections) in levels.iter().zip(&mut corrections) {
            cancel.check()?;
            let values = viewers.values(tile, materials, tile.width(*level));
            corrections.extend((0..POLAR.len() * APART.len()).map(|light| {
                let far = viewers.far().map(|far| far[light].as_dvec3());
                let at = |values: &Values| values.iter().map(|values| values[light]).collect::<Vec<_>>();
                correction(far, &at(&values), &at(&points))
            }));
        }
    }
    // A cancelled `f̄` may be zero.
    cancel.check()?;
    Ok(corrections)
}

/// The mean of `far` over that of `values`. `points` have the mean of `far` and vary together with the values: the part of
/// their error that the values share is taken off.
fn correction(far: impl Iterator<Item = DVec3> + Clone, values: &[DVec3], points: &[DVec3]) -> Vec3 {
    let count = values.len() as f64;
    let exact = far.clone().sum::<DVec3>() / count;
    let mut ours = values.iter().sum::<DVec3>() / count;
    let off = points.iter().sum::<DVec3>() / count - exact;
    let (mut shared, mut own) = (DVec3::ZERO, DVec3::splat(f64::MIN_POSITIVE));
    for ((far, value), point) in far.zip(values).zip(points) {
        let point = *point - far - off;
        shared += point * (*value - far - (ours - exact));
        own += point * point;
    }
    ours -= off * (shared / own).clamp(DVec3::ZERO, DVec3::ONE);
    let least = DVec3::splat(1e-9 + 1e-4 * exact.max_element());
    ((exact + least) / (ours + least).max(least)).clamp(DVec3::splat(1.0 / MOST), DVec3::splat(MOST)).as_vec3()
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
