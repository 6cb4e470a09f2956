//! Single columns of a sum over facets: one lobe, or the visible area of one normal.

use crate::effective::{FacetGroup, FacetSum};
use crate::math::simd;
use crate::math::simd::PairVectors;

impl FacetSum {
    /// Areas of a group's facets, times their colour weights in one channel if those differ.
    fn weights<'a>(&'a self, group: &'a FacetGroup, channel: Option<usize>) -> &'a [f32] {
        match (&group.rgb_areas, channel) {
            (Some(rgb), Some(channel)) => &rgb[channel],
            _ => self.areas(group.range.clone()),
        }
    }

    /// The sum of one lobe over one group, without its tint and the group's colour. `v_i` and `v_o` are the
    /// visibilities of all facets.
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

    /// The area of one normal cluster that is visible from both `i` and `o`.
    pub(crate) fn visible_area(
        &self,
        group: usize,
        cluster: usize,
        channel: Option<usize>,
        v_i: &[f32],
        v_o: &[f32],
    ) -> f64 {
        let group = &self.groups()[group];
        let Some(cluster) = group.clusters.as_ref().map(|clusters| &clusters[cluster]) else { return 0.0 };
        let range = cluster.range.clone();
        let weights = &self.weights(group, channel)[range.start - group.range.start..range.end - group.range.start];
        simd::masked_sum([weights], &v_i[range.clone()], &v_o[range])[0]
    }
}
