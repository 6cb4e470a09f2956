//! Blocked elevations per facet and azimuth: visibility that interpolates smoothly.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::Vec3;
use rayon::prelude::*;

use super::ray_cast::lifted_origin;
use super::scan::BlockedSlopes;
use super::{PackedVisibility, PeriodicGrid};
use crate::directions::{PolarGrid, from_angles, to_angles};
use crate::geometry::Facets;
use crate::simd;

/// For each azimuth and facet: the elevation [rad] below which all is blocked, and the blocked intervals above it.
///
/// Between azimuths the horizon itself is interpolated (not yes/no), which is why few azimuths do (DESIGN.md, Sec. 4);
/// floating intervals, which appear and vanish from one azimuth to the next, are blended. A blocked elevation ends in
/// a ramp of [`Horizons::ramp`] radians, so that what is computed from it is continuous.
#[derive(Debug, Clone)]
pub struct Horizons {
    pub azimuths: usize,
    pub facets: usize,
    /// Width of the soft step at each end of a blocked interval [rad].
    pub ramp: f32,
    /// `[azimuth][facet]`; [`Horizons::FREE`] where nothing blocks, [`Horizons::BLOCKED`] where all is.
    ground: Vec<f32>,
    /// Layers of blocked intervals above the ground: `[layer][azimuth][facet]`, low and high ends.
    floating: Vec<Layer>,
    /// Facets no direction of the grid sees.
    pub never_seen: usize,
    /// Intervals beyond the layers kept, merged into their neighbours.
    pub merged: usize,
}

#[derive(Debug, Clone)]
struct Layer {
    low: Vec<f32>,
    high: Vec<f32>,
}

/// Layers of floating intervals that are kept a facet and azimuth.
const MAX_LAYERS: usize = 3;

impl Horizons {
    /// A horizon so low that the soft step never reaches above 0.
    const FREE: f32 = -0.02;
    /// A horizon so high that the soft step never reaches the zenith.
    const BLOCKED: f32 = FRAC_PI_2 + 0.02;

    /// Everything visible: a flat tile.
    pub fn unblocked(facets: usize) -> Self {
        let azimuths = 4;
        Self { azimuths, facets, ramp: 0.0, ground: vec![Self::FREE; azimuths * facets], floating: Vec::new(), never_seen: 0, merged: 0 }
    }

    /// Exact in elevation: slices the tile along every azimuth, for every facet.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, ramp: f32) -> Self {
        let diagonal = grid.tile_size.length();
        let count = facets.len();
        Self::from_rows(azimuths, count, ramp, |azimuth, row| {
            let along = from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
            let mut blocked = BlockedSlopes::default();
            for facet in 0..count {
                let origin = lifted_origin(facets, facet, diagonal);
                grid.scan(origin, along, facets.triangles[facet], &mut blocked);
                row.push(facet, blocked.ground.atan(), blocked.floating.iter().map(|&(a, b)| (a.atan(), b.atan())));
            }
        })
    }

    /// From yes/no visibility on a polar grid: an interval ends half way between two rings that differ.
    pub fn from_packed(packed: &PackedVisibility, grid: PolarGrid, ramp: f32) -> Self {
        let elevation = |ring: usize| FRAC_PI_2 - grid.theta(ring);
        Self::from_rows(grid.azimuths, packed.facet_count, ramp, |azimuth, row| {
            let mut runs: Vec<(f32, f32)> = Vec::new();
            for facet in 0..packed.facet_count {
                runs.clear();
                let mut start = None;
                // From the horizon up.
                for ring in (0..grid.ring_count()).rev() {
                    let blocked = !packed.is_visible(ring * grid.azimuths + azimuth, facet);
                    let edge = if ring + 1 == grid.ring_count() { 0.0 } else { 0.5 * (elevation(ring) + elevation(ring + 1)) };
                    match (blocked, start) {
                        (true, None) => start = Some(edge),
                        (false, Some(low)) => {
                            runs.push((low, edge));
                            start = None;
                        }
                        _ => {}
                    }
                }
                if let Some(low) = start {
                    runs.push((low, FRAC_PI_2));
                }
                let ground = runs.first().filter(|run| run.0 <= 0.0).map_or(0.0, |run| run.1);
                let rest = usize::from(ground > 0.0);
                row.push(facet, ground, runs[rest..].iter().copied());
            }
        })
    }

    fn from_rows(azimuths: usize, facets: usize, ramp: f32, fill: impl Fn(usize, &mut Row) + Sync) -> Self {
        let rows: Vec<Row> = (0..azimuths)
            .into_par_iter()
            .map(|azimuth| {
                let mut row = Row { ground: vec![Self::FREE; facets], floating: Vec::new(), merged: 0 };
                fill(azimuth, &mut row);
                row
            })
            .collect();
        let layers = rows.iter().map(|row| row.floating.len()).max().unwrap_or(0);
        let mut seen = vec![false; facets];
        for row in &rows {
            for (seen, &ground) in seen.iter_mut().zip(&row.ground) {
                *seen |= ground < Self::BLOCKED;
            }
        }
        let layer = |k: usize| {
            let pick = |end: fn(&Layer) -> &Vec<f32>| -> Vec<f32> {
                rows.iter().flat_map(|row| row.floating.get(k).map_or_else(|| vec![Self::BLOCKED; facets], |layer| end(layer).clone())).collect()
            };
            Layer { low: pick(|layer| &layer.low), high: pick(|layer| &layer.high) }
        };
        Self {
            azimuths,
            facets,
            ramp,
            floating: (0..layers).map(layer).collect(),
            never_seen: seen.iter().filter(|seen| !**seen).count(),
            merged: rows.iter().map(|row| row.merged).sum(),
            ground: rows.into_iter().flat_map(|row| row.ground).collect(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * (self.ground.len() + self.floating.iter().map(|layer| 2 * layer.low.len()).sum::<usize>())
    }

    /// Layers of blocked intervals above the ground; 0 for a height-field.
    pub fn floating_layers(&self) -> usize {
        self.floating.len()
    }

    /// Writes the visibility of every facet along `direction`, in `[0, 1]`; facing is not included. 0 at and under the horizon.
    pub fn fill(&self, direction: Vec3, out: &mut [f32]) {
        if direction.z <= 0.0 {
            out.fill(0.0);
            return;
        }
        let (theta, phi) = to_angles(direction);
        let elevation = FRAC_PI_2 - theta;
        let at = phi / TAU * self.azimuths as f32;
        let from = at as usize % self.azimuths;
        let to = (from + 1) % self.azimuths;
        let blend = at - at.floor();
        let a = from * self.facets..(from + 1) * self.facets;
        let b = to * self.facets..(to + 1) * self.facets;
        let sharpness = 1.0 / self.ramp.max(1e-6);
        simd::ground_visibility(&self.ground[a.clone()], &self.ground[b.clone()], blend, elevation, sharpness, out);
        for layer in &self.floating {
            simd::floating_visibility(
                [&layer.low[a.clone()], &layer.high[a.clone()]],
                [&layer.low[b.clone()], &layer.high[b.clone()]],
                blend,
                elevation,
                sharpness,
                out,
            );
        }
    }
}

/// One azimuth's horizons while they are made.
struct Row {
    ground: Vec<f32>,
    floating: Vec<Layer>,
    merged: usize,
}

impl Row {
    fn push(&mut self, facet: usize, ground: f32, floating: impl Iterator<Item = (f32, f32)>) {
        let facets = self.ground.len();
        self.ground[facet] = if ground <= 0.0 {
            Horizons::FREE
        } else if ground >= FRAC_PI_2 {
            Horizons::BLOCKED
        } else {
            ground
        };
        let mut kept: Vec<(f32, f32)> = floating.collect();
        while kept.len() > MAX_LAYERS {
            // Close the smallest gap.
            let gap = |k: usize| kept[k + 1].0 - kept[k].1;
            let smallest = (0..kept.len() - 1).min_by(|&a, &b| gap(a).total_cmp(&gap(b))).unwrap_or(0);
            kept[smallest].1 = kept[smallest + 1].1;
            kept.remove(smallest + 1);
            self.merged += 1;
        }
        for (layer, &(low, high)) in kept.iter().enumerate() {
            if self.floating.len() <= layer {
                self.floating.push(Layer { low: vec![Horizons::BLOCKED; facets], high: vec![Horizons::BLOCKED; facets] });
            }
            self.floating[layer].low[facet] = low;
            self.floating[layer].high[facet] = if high >= FRAC_PI_2 { Horizons::BLOCKED } else { high };
        }
    }
}
