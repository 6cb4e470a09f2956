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

/// Points per side of the square in which most of a lobe lies.
const FINE: usize = 192;
/// Half width of that square, in deviations of the lobe.
const REACH: f64 = 6.0;
/// Points per side of the other cells.
const COARSE: usize = 3;

impl DiscLobe {
    /// Integrates a function of the direction over cells. Most of its light lies around `center`, with the deviation
    /// `width`. `down` is true for directions below.
    pub fn new(side: usize, center: DVec2, width: f64, down: bool, value: impl Fn(DVec3) -> DVec3 + Sync) -> Self {
        let half = REACH * width.clamp(1e-9, 1.0);
        let cell = 2.0 / side as f64;
        let (mut low, mut high) = ((center - half).max(DVec2::NEG_ONE), (center + half).min(DVec2::ONE));
        let mut fine = DVec2::splat(FINE as f64);
        if half > cell {
            // A square of whole cells, so that all cells have equally many points.
            low = ((low + 1.0) / cell).floor() * cell - 1.0;
            high = ((high + 1.0) / cell).ceil() * cell - 1.0;
            let cells = ((high - low) / cell).round().max(DVec2::ONE);
            fine = (fine / cells).ceil().max(DVec2::splat(COARSE as f64)) * cells;
        }
        let at = |p: DVec2| {
            let square = p.length_squared();
            if square >= 1.0 - 1e-12 {
                return DVec3::ZERO;
            }
            value(p.extend((1.0 - square).sqrt() * if down { -1.0 } else { 1.0 }))
        };
        let is_inside = |p: DVec2| p.cmpge(low).all() && p.cmplt(high).all();
        let coarse = |k: usize| {
            let corner = DVec2::new((k % side) as f64, (k / side) as f64);
            let point = |j: usize| {
                let inside = (DVec2::new((j % COARSE) as f64, (j / COARSE) as f64) + 0.5) / COARSE as f64;
                (corner + inside) * cell - 1.0
            };
            (0..COARSE * COARSE).map(point).filter(|p| !is_inside(*p)).map(at).sum::<DVec3>() / (COARSE * COARSE) as f64
        };
        let mut values: Vec<DVec3> = (0..side * side).into_par_iter().map(coarse).collect();
        let step = (high - low) / fine;
        if step.min_element() > 0.0 {
            let (columns, rows) = (fine.x as usize, fine.y as usize);
            let point = |k: usize| {
                let p = low + step * (DVec2::new((k % columns) as f64, (k / columns) as f64) + 0.5);
                let index = ((p + 1.0) / cell).floor().clamp(DVec2::ZERO, DVec2::splat((side - 1) as f64));
                (index.y as usize * side + index.x as usize, at(p))
            };
            let points: Vec<(usize, DVec3)> = (0..columns * rows).into_par_iter().map(point).collect();
            let share = step.x * step.y / (cell * cell);
            points.into_iter().for_each(|(index, value)| values[index] += share * value);
        }
        Self { side, values }
    }

    /// The transmitted lobe of light from `i`, which points up.
    pub fn transmitted(slab: &Slab, i: DVec3, side: usize) -> Self {
        let width = (slab.optics.eta.max_element() - 1.0) * slab.deviation();
        Self::new(side, -i.truncate(), width, true, |o| slab.btdf(i, o))
    }

    /// The reflected lobe of light from `i`, which points up.
    pub fn reflected(slab: &Slab, i: DVec3, side: usize) -> Self {
        Self::new(side, -i.truncate(), 2.0 * slab.top.deviation(), false, |o| slab.brdf(i, o))
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
        if !(total > 0.0) {
            return (DVec2::ZERO, DVec2::ZERO);
        }
        let mean = self.values.iter().enumerate().map(|(k, value)| weight(value) * center(k)).sum::<DVec2>() / total;
        let square = |(k, value): (usize, &DVec3)| weight(value) * (center(k) - mean) * (center(k) - mean);
        let variance = self.values.iter().enumerate().map(square).sum::<DVec2>() / total;
        (mean, variance.max(DVec2::ZERO).map(f64::sqrt))
    }
}
