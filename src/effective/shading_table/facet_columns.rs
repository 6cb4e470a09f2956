//! Single columns of a sum over facets: one lobe, one colour, one normal.

use crate::effective::{FacetSum, Group};
use crate::math::simd;
use crate::math::simd::PairVectors;

impl FacetSum {
    /// Areas of a group's facets, times their colour weights in one channel where those differ.
    fn weights<'a>(&'a self, group: &'a Group, channel: Option<usize>) -> &'a [f32] {
        match (&group.rgb_areas, channel) {
            (Some(rgb), Some(channel)) => &rgb[channel],
            _ => self.areas(group.range.clone()),
        }
    }

    /// One lobe of one group, without its tint and the group's colour; visibilities are those of all facets.
    pub(crate) fn lobe_sum(
        &self,
        group: usize,
        lobe: usize,
        channel: Option<usize>,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
    ) -> f64 {
        let group = &self.groups()[group];
        let range = group.range.clone();
        let weights = self.weights(group, channel);
        let (v_i, v_o) = (&v_i[range.clone()], &v_o[range.clone()]);
        simd::lobe_sums(group.lobes[lobe].0, pair, self.normals(range), [weights], v_i, v_o)[0]
    }

    /// The area of the facets of one normal that `i` and `o` both see.
    pub(crate) fn visible_area(
        &self,
        group: usize,
        patch: usize,
        channel: Option<usize>,
        v_i: &[f32],
        v_o: &[f32],
    ) -> f64 {
        let group = &self.groups()[group];
        let Some(patch) = group.patches.as_ref().map(|patches| &patches[patch]) else { return 0.0 };
        let range = patch.range.clone();
        let weights = &self.weights(group, channel)[range.start - group.range.start..range.end - group.range.start];
        simd::masked_sum([weights], &v_i[range.clone()], &v_o[range])[0]
    }
}
