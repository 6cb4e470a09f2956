//! The lobe of one direction of the light over the disc (o.x, o.y): cells, totals and moments.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::model::Slab;

/// Means over cells of the square around the disc, x fastest. A cell holds flux per area of the disc, which is the BTDF (or
/// BRDF) averaged over it. Straight light is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct DiscLobe {
    pub side: usize,
    pub values: Vec<DVec3>,
}

/// Points per side of the square in which most of a lobe lies: at least, and at most where slopes are single.
const FINE: usize = 192;
const FINEST: usize = 768;
/// Half width of that square, in deviations of the lobe.
const REACH: f64 = 6.0;
/// Points per side of the other cells.
const COARSE: usize = 3;

/// Resolution of points over the disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiscGrid {
    /// Cells per side of the square around the disc; each has nine points.
    pub side: usize,
    /// Points per side of the square in which most of a lobe lies: at least, and at most where slopes are single.
    pub fine: usize,
    pub finest: usize,
}

impl DiscGrid {
    /// Points of the disc with their areas. They are denser around `center`, where a lobe of the deviation `width` lies.
    /// `detail` is the size of details in it, or 0 without any.
    pub fn points(&self, center: DVec2, (width, detail): (f64, f64)) -> Vec<(DVec2, f64)> {
        let half = REACH * width.clamp(1e-9, 1.0);
        let cell = 2.0 / self.side as f64;
        let (mut low, mut high) = ((center - half).max(DVec2::NEG_ONE), (center + half).min(DVec2::ONE));
        let (least, most) = (self.fine as f64, self.finest as f64);
        let wanted = if detail > 0.0 { (8.0 * half.min(1.0) / detail).clamp(least, most).ceil() } else { least };
        let mut fine = DVec2::splat(wanted);
        if half > cell {
            // A square of whole cells, so that all cells have equally many points.
            low = ((low + 1.0) / cell).floor() * cell - 1.0;
            high = ((high + 1.0) / cell).ceil() * cell - 1.0;
            let cells = ((high - low) / cell).round().max(DVec2::ONE);
            fine = (fine / cells).ceil().max(DVec2::splat(COARSE as f64)) * cells;
        }
        let is_inside = |p: DVec2| p.cmpge(low).all() && p.cmplt(high).all();
        let is_on_disc = |p: &DVec2| p.length_squared() < 1.0 - 1e-12;
        let side = self.side * COARSE;
        let at = |k: usize| (DVec2::new((k % side) as f64, (k / side) as f64) + 0.5) * (2.0 / side as f64) - 1.0;
        let coarse = (0..side * side).map(at).filter(|p| is_on_disc(p) && !is_inside(*p));
        let area = (2.0 / side as f64).powi(2);
        let mut points: Vec<(DVec2, f64)> = coarse.map(|p| (p, area)).collect();
        let step = (high - low) / fine;
        if step.min_element() > 0.0 {
            let (columns, rows) = (fine.x as usize, fine.y as usize);
            let at = |k: usize| low + step * (DVec2::new((k % columns) as f64, (k / columns) as f64) + 0.5);
            points.extend((0..columns * rows).map(at).filter(is_on_disc).map(|p| (p, step.x * step.y)));
        }
        points
    }
}

impl DiscLobe {
    /// Integrates a function of the direction over cells. Most of its light lies around `center`, with the deviation
    /// `width`, in details of the size `detail`, or 0 without any. `down` is true for directions below.
    pub fn new(
        side: usize,
        center: DVec2,
        shape: (f64, f64),
        down: bool,
        value: impl Fn(DVec3) -> DVec3 + Sync,
    ) -> Self {
        let cell = 2.0 / side as f64;
        let points = DiscGrid { side, fine: FINE, finest: FINEST }.points(center, shape);
        let at = |(p, area): &(DVec2, f64)| {
            let z = (1.0 - p.length_squared()).max(0.0).sqrt();
            let index = ((*p + 1.0) / cell).floor().clamp(DVec2::ZERO, DVec2::splat((side - 1) as f64));
            let share = area / (cell * cell);
            (index.y as usize * side + index.x as usize, share * value(p.extend(if down { -z } else { z })))
        };
        let found: Vec<(usize, DVec3)> = points.par_iter().map(at).collect();
        let mut values = vec![DVec3::ZERO; side * side];
        found.into_iter().for_each(|(index, value)| values[index] += value);
        Self { side, values }
    }

    /// The transmitted lobe of light from `i`, which points up.
    pub fn transmitted(slab: &Slab, i: DVec3, side: usize) -> Self {
        let row = slab.row(i);
        Self::new(side, -i.truncate(), slab.transmitted_shape(), true, |o| row.btdf(o))
    }

    /// The reflected lobe of light from `i`, which points up.
    pub fn reflected(slab: &Slab, i: DVec3, side: usize) -> Self {
        // Near the horizon details shrink on the disc.
        let detail = slab.top.resolution() * i.z.max(0.1);
        Self::new(side, -i.truncate(), (2.0 * slab.top.deviation(), detail), false, |o| slab.brdf(i, o))
    }

    /// Flux of the whole lobe, as a part of the incident flux.
    pub fn total(&self) -> DVec3 {
        self.values.iter().sum::<DVec3>() * (2.0 / self.side as f64).powi(2)
    }

    /// Mean and deviation of (o.x, o.y), weighted by the mean of the channels.
    pub fn moments(&self) -> (DVec2, DVec2) {
        let center = |k: usize| {
            (DVec2::new((k % self.side) as f64, (k / self.side) as f64) + 0.5) * (2.0 / self.side as f64) - 1.0
        };
        let weight = |value: &DVec3| value.element_sum();
        let total: f64 = self.values.iter().map(weight).sum();
        if total.is_nan() || total <= 0.0 {
            return (DVec2::ZERO, DVec2::ZERO);
        }
        let mean = self.values.iter().enumerate().map(|(k, value)| weight(value) * center(k)).sum::<DVec2>() / total;
        let square = |(k, value): (usize, &DVec3)| weight(value) * (center(k) - mean) * (center(k) - mean);
        let variance = self.values.iter().enumerate().map(square).sum::<DVec2>() / total;
        (mean, variance.max(DVec2::ZERO).map(f64::sqrt))
    }
}
