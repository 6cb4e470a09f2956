//! Effects of the sum over facets that `[effects]` forces on or off.

use crate::effective::FacetSum;
use crate::geometry::Facets;
use crate::scene::{Effects, Switch};

impl FacetSum {
    /// Applies the effects that are forced; `facets` are those that the sum is made of. The result is the same in all
    /// cases: one lobe per facet or per cluster, and one sum or a sum per channel, differ in cost only.
    pub fn force(&mut self, facets: &Facets, effects: &Effects) {
        match effects.exact_lobes {
            Switch::Auto => {}
            Switch::On => self.group_by_normal(facets),
            Switch::Off => self.clear_clusters(),
        }
        if effects.color_weights == Switch::On {
            self.sum_each_channel(facets);
        }
        self.sum_black_groups(effects.black_materials == Switch::On);
    }
}

/// Replaces the colours of facets by the area-weighted mean colour of their slot.
pub fn mean_colors(facets: &mut Facets) {
    let slots = facets.slots.iter().map(|slot| usize::from(*slot) + 1).max().unwrap_or(0);
    let mut sums = vec![(glam::Vec3::ZERO, 0.0_f32); slots];
    for (slot, (color, area)) in facets.slots.iter().zip(facets.colors.iter().zip(&facets.areas)) {
        let sum = &mut sums[usize::from(*slot)];
        sum.0 += *color * *area;
        sum.1 += area;
    }
    for (color, slot) in facets.colors.iter_mut().zip(&facets.slots) {
        let (sum, area) = sums[usize::from(*slot)];
        *color = if area > 0.0 { sum / area } else { *color };
    }
}
