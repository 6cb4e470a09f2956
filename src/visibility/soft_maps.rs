//! Binary visibility on a polar grid, blended between the nodes, for surfaces with overhangs.

use std::ops::Range;

use glam::Vec3;

use super::PackedVisibility;
use crate::math::directions::PolarGrid;
use crate::math::simd;

/// Binary visibility at the nodes of a polar grid.
#[derive(Debug, Clone)]
pub struct SoftMaps {
    pub grid: PolarGrid,
    pub packed: PackedVisibility,
}

impl SoftMaps {
    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let taps = self.grid.taps(direction);
        let rows = taps.map(|(node, _)| self.packed.row(node));
        simd::blend_bits(rows, taps.map(|(_, weight)| weight), range.start, out);
    }
}
