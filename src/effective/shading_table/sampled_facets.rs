//! A sum over a subset of its facets, for direction pairs about one half vector. The subset contains the facets that a
//! glossy lobe lights, and few of the others.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use crate::brdf::LobeAngles;
use crate::effective::direct::facet_groups::NormalCluster;
use crate::effective::{Direct, FacetGroup, FacetSum};
use crate::math::simd;
use crate::math::simd::{LANES, PairVectors, total};

/// Fraction of the samples that is distributed evenly over facets, because lobes grow wider as light and view move
/// apart.
const EVEN_FRACTION: f32 = 0.25;

/// Smallest number of facets of a group or cluster in a subset.
const MIN: f64 = 16.0;

/// The probability 1 as an integer. Sums of integer probabilities have no rounding, so the GPU's twin
/// (`sample_facets.wgsl`) may add them in any order. A probability of 0.01 is rounded to about 0.1 % of itself; a
/// facet's weight is the inverse of the rounded probability.
const CERTAIN: u32 = 1 << 16;

/// Iterations that redistribute the excess of facets whose probability is limited to 1.
const ROUNDS: usize = 2;

/// Expected number of facets that are drawn from a run, if `count` are drawn from `all`.
pub(crate) fn subset_size(run: usize, count: usize, all: usize) -> f64 {
    let run = run as f64;
    (count as f64 * run / all.max(1) as f64).max(MIN).min(run)
}

impl Direct {
    /// Draws about `count` facets, with weights that keep the expectation of every sum. The probability of a facet
    /// follows its reflection of light along `h` back along `h`; facets are drawn at even steps of the summed
    /// probability (systematic sampling). Facets of a cluster share a lobe, so their probabilities are equal. `None` if
    /// the subset saves nothing.
    pub(crate) fn sampled_about(&self, h: Vec3, count: usize) -> Option<Self> {
        if self.sum.facet_count() < 2 * count {
            return None;
        }
        let reflecting = self.sum.groups().iter().filter(|group| !group.is_black);
        let facets: usize = reflecting.map(|group| group.range.len()).sum();
        let size = |range: &Range<usize>| subset_size(range.len(), count, facets);
        let mut subset = SampledFacets::default();
        let groups = self.sum.groups().iter().map(|group| {
            let first = subset.facets.len();
            let clusters = match &group.clusters {
                _ if group.is_black => None,
                Some(clusters) => Some(
                    clusters
                        .iter()
                        .map(|NormalCluster { range, normal }| {
                            let probability = as_integer((size(range) / range.len().max(1) as f64) as f32);
                            let range = subset.draw(range.clone(), std::iter::repeat(probability));
                            NormalCluster { range, normal: *normal }
                        })
                        .collect(),
                ),
                None => {
                    let probabilities = probabilities(self.sum.shares(group, h), size(&group.range) as f32);
                    subset.draw(group.range.clone(), probabilities.into_iter().map(as_integer));
                    None
                }
            };
            (first..subset.facets.len(), clusters)
        });
        let groups: Vec<_> = groups.collect();
        let visibility = self.visibility.subset(&subset.facets)?;
        Some(Self::new(Arc::new(self.sum.sampled(&subset, groups)), Arc::new(visibility)))
    }
}

/// Indices of the drawn facets, ascending, and their weights.
#[derive(Default)]
struct SampledFacets {
    facets: Vec<usize>,
    weights: Vec<f32>,
}

impl SampledFacets {
    /// Draws the facets of a run at which the sum of the probabilities passes a multiple of [`CERTAIN`]. Returns their
    /// positions in the subset.
    fn draw(&mut self, range: Range<usize>, probabilities: impl Iterator<Item = u32>) -> Range<usize> {
        let first = self.facets.len();
        let mut summed = CERTAIN / 2;
        for (facet, probability) in range.zip(probabilities) {
            summed += probability;
            if summed >= CERTAIN {
                summed -= CERTAIN;
                self.facets.push(facet);
                self.weights.push(CERTAIN as f32 / probability as f32);
            }
        }
        first..self.facets.len()
    }
}

/// A probability in `(0, 1]` as an integer fraction of [`CERTAIN`].
fn as_integer(probability: f32) -> u32 {
    ((probability * CERTAIN as f32 + 0.5) as u32).clamp(1, CERTAIN)
}

/// Probabilities in `(0, 1]` in proportion to `shares`, which sum to 1. Their sum is about `count`, and not more.
fn probabilities(mut shares: Vec<f32>, count: f32) -> Vec<f32> {
    let mut scale = count;
    for _ in 0..ROUNDS {
        let expected = sum(&shares, |share| smaller(scale * share, 1.0));
        scale *= count / expected.max(1e-9);
    }
    for share in &mut shares {
        *share = (scale * *share).clamp(1e-9, 1.0);
    }
    shares
}

fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The sum of `of(value)` over all values, in [`LANES`] partial sums, which the compiler vectorises.
fn sum(values: &[f32], of: impl Fn(f32) -> f32) -> f32 {
    let mut lanes = [0.0; LANES];
    for values in values.chunks(LANES) {
        for (lane, value) in lanes.iter_mut().zip(values) {
            *lane += of(*value);
        }
    }
    total(&lanes) as f32
}

impl FacetSum {
    /// The share of each facet in a group's reflection of light along `h` back along `h`: the mean over the group's
    /// lobes, plus a fraction that is equal for all facets.
    fn shares(&self, group: &FacetGroup, h: Vec3) -> Vec<f32> {
        let count = group.range.len();
        let mut shares = vec![EVEN_FRACTION / count.max(1) as f32; count];
        let parts = group.lobes.len() + group.measured.len();
        let mut values = vec![0.0; count];
        for part in 0..parts {
            match group.lobes.get(part) {
                Some((lobe, _)) => {
                    simd::lobe_values(*lobe, &PairVectors::new(h, h), self.normals(group.range.clone()), &mut values);
                }
                None => {
                    let table = &group.measured[part - group.lobes.len()];
                    for (value, s) in values.iter_mut().zip(group.range.clone()) {
                        let angles = LobeAngles::new(self.facet(s).0, h, h, h);
                        let lit = if angles.n_dot_i > 0.0 { angles.n_dot_i * angles.n_dot_o } else { 0.0 };
                        *value = table.f_r(&angles).max_element().max(0.0) * lit;
                    }
                }
            }
            for (value, area) in values.iter_mut().zip(self.areas(group.range.clone())) {
                *value *= area;
            }
            let total = sum(&values, |value| value);
            let each = (1.0 - EVEN_FRACTION) / parts as f32;
            for (share, value) in shares.iter_mut().zip(&values) {
                *share += each * if total > 0.0 { value / total } else { 1.0 / count as f32 };
            }
        }
        shares
    }

    /// The sum over a subset; `groups` has the positions of each group's facets in the subset, and their normal
    /// clusters.
    fn sampled(&self, subset: &SampledFacets, groups: Vec<(Range<usize>, Option<Vec<NormalCluster>>)>) -> Self {
        let facets = || subset.facets.iter().zip(&subset.weights);
        let all = self.areas(0..self.facet_count());
        let areas = facets().map(|(&s, weight)| all[s] * weight).collect();
        let normals = self.normals(0..self.facet_count()).map(|all| subset.facets.iter().map(|&s| all[s]).collect());
        let groups = self.groups().iter().zip(groups).map(|(group, (range, clusters))| {
            let weighted = |areas: &Vec<f32>| -> Vec<f32> {
                let of_group = facets().skip(range.start).take(range.len());
                of_group.map(|(&s, weight)| areas[s - group.range.start] * weight).collect()
            };
            let rgb_areas = group.rgb_areas.as_ref().map(|rgb| rgb.each_ref().map(weighted));
            FacetGroup { range, rgb_areas, clusters, ..group.clone() }
        });
        self.over(normals, areas, groups.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_sum_to_the_count_and_never_exceed_one() {
        let raw: Vec<f32> = (0..1000).map(|k| if k % 100 == 0 { 50.0 } else { 1.0 }).collect();
        let total: f32 = raw.iter().sum();
        let shares: Vec<f32> = raw.iter().map(|share| share / total).collect();
        let probabilities = probabilities(shares, 200.0);
        let expected: f32 = probabilities.iter().sum();
        assert!((expected - 200.0).abs() < 1.0, "{expected}");
        assert!(probabilities.iter().all(|&probability| probability > 0.0 && probability <= 1.0));
        // A facet with fifty times the share of the others is certain.
        assert_eq!(probabilities[0], 1.0);
    }
}
