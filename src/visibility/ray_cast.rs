//! Exact visibility of facets by rays through the endless tiling, the reference of the other algorithms.

use glam::Vec3;
use rayon::prelude::*;

use super::PackedVisibility;
use crate::geometry::{Facets, PeriodicGrid, is_facet_visible};

/// Computes the exact visibility of every facet along every direction.
pub fn ray_cast(grid: &PeriodicGrid, facets: &Facets, directions: &[Vec3]) -> PackedVisibility {
    grid.prepare_rays();
    let mut packed = PackedVisibility::new(facets.len(), directions.len());
    let words = packed.words_per_row().max(1);
    packed.words.par_chunks_mut(words).zip(directions).for_each(|(row, &to)| {
        for facet in 0..facets.len() {
            if is_facet_visible(grid, facets, facet, to) {
                row[facet / 32] |= 1 << (facet % 32);
            }
        }
    });
    packed
}
