//! What a person forces on or off in the sum over facets.

use crate::effective::FacetSum;
use crate::geometry::Facets;
use crate::scene::{Effects, Switch};

impl FacetSum {
    /// Does as `effects` force; `facets` are those the sum was made of. Nothing is lost: one lobe a facet and one lobe a normal,
    /// one sum and a sum a channel are the same numbers at different prices.
    pub fn force(&mut self, facets: &Facets, effects: &Effects) {
        match effects.exact_lobes {
            Switch::Auto => {}
            Switch::On => self.group_by_normal(facets),
            Switch::Off => self.one_lobe_a_facet(),
        }
        if effects.color_weights == Switch::On {
            self.sum_each_channel(facets);
        }
        self.keep_black(effects.black_materials == Switch::On);
    }
}

/// Each slot's mean colour in place of its facets' own.
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
