//! Yes/no visibility on a polar grid, blended between its nodes: for surfaces with overhangs.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::ray_cast::lifted_origin;
use super::scan::BlockedSlopes;
use super::{PackedVisibility, PeriodicGrid};
use crate::directions::{PolarGrid, from_angles};
use crate::geometry::Facets;
use crate::simd;

/// Bits on the nodes of a polar grid.
#[derive(Debug, Clone)]
pub struct SoftMaps {
    pub grid: PolarGrid,
    pub packed: PackedVisibility,
}

impl SoftMaps {
    /// Cells and triangles that one slice looks at on average, from a few of them: what [`SoftMaps::scan`] will cost.
    pub fn scan_work(periodic: &PeriodicGrid, facets: &Facets) -> f64 {
        const FACETS: usize = 48;
        const AZIMUTHS: usize = 5;
        let mut blocked = BlockedSlopes::default();
        let chosen = (0..FACETS).map(|k| k * facets.len() / FACETS).filter(|facet| *facet < facets.len());
        let diagonal = periodic.tile_size.length();
        for facet in chosen {
            for azimuth in 0..AZIMUTHS {
                let along = from_angles(FRAC_PI_2, TAU * (azimuth as f32 + 0.3) / AZIMUTHS as f32).truncate();
                let origin = lifted_origin(facets, facet, diagonal);
                periodic.scan(origin, facets.normals[facet], along, facets.triangles[facet], &mut blocked);
            }
        }
        blocked.work as f64 / (FACETS * AZIMUTHS) as f64
    }

    /// Slices the mesh along every azimuth and reads all rings off each slice: exact at the nodes.
    pub fn scan(periodic: &PeriodicGrid, facets: &Facets, grid: PolarGrid) -> Self {
        let diagonal = periodic.tile_size.length();
        let slopes: Vec<f32> = (0..grid.ring_count()).map(|ring| (FRAC_PI_2 - grid.theta(ring)).tan()).collect();
        let words = facets.len().div_ceil(32);
        let azimuths: Vec<Vec<u32>> = (0..grid.azimuths)
            .into_par_iter()
            .map(|azimuth| {
                let along = from_angles(FRAC_PI_2, TAU * azimuth as f32 / grid.azimuths as f32).truncate();
                let mut blocked = BlockedSlopes::default();
                let mut bits = vec![0_u32; words * slopes.len()];
                for facet in 0..facets.len() {
                    let origin = lifted_origin(facets, facet, diagonal);
                    periodic.scan(origin, facets.normals[facet], along, facets.triangles[facet], &mut blocked);
                    for (ring, &slope) in slopes.iter().enumerate() {
                        if !blocked.contains(slope) {
                            bits[ring * words + facet / 32] |= 1 << (facet % 32);
                        }
                    }
                }
                bits
            })
            .collect();
        let mut packed = PackedVisibility::new(facets.len(), grid.len());
        for (azimuth, bits) in azimuths.iter().enumerate() {
            for (ring, row) in bits.chunks(words.max(1)).enumerate() {
                packed.row_mut(ring * grid.azimuths + azimuth).copy_from_slice(row);
            }
        }
        Self { grid, packed }
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let taps = self.grid.taps(direction);
        let rows = taps.map(|(node, _)| self.packed.row(node));
        simd::blend_bits(rows, taps.map(|(_, weight)| weight), range.start, out);
    }
}
