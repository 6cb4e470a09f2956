//! A sum over part of its facets for pairs of directions about one half vector: all that a glossy lobe lights up, and few of
//! those whose share is small.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use crate::brdf::LobeAngles;
use crate::effective::direct::facet_groups::NormalCluster;
use crate::effective::{Direct, FacetSum, Group};
use crate::math::simd;
use crate::math::simd::{LANES, PairVectors, total};

/// Part of the samples that goes to facets whatever they reflect: lobes grow wider as light and view move apart.
const EVENLY: f32 = 0.25;

/// Facets that a group or a normal keeps at least.
const MIN: f64 = 16.0;

/// What is certain, in whole numbers: their sums have no rounding, and the twin of this on a device (`pick_facets.wgsl`) may
/// add them up in any order. A chance of a hundredth is known to a thousandth of itself; what a pick stands for is told by the
/// rounded one.
const CERTAIN: u32 = 1 << 16;

/// Rounds that leave to the others what those that are certain cannot use.
const ROUNDS: usize = 2;

/// How many of a run of facets are picked, where `count` are of `all`.
pub(crate) fn share_of(run: usize, count: usize, all: usize) -> f64 {
    let run = run as f64;
    (count as f64 * run / all.max(1) as f64).max(MIN).min(run)
}

impl Direct {
    /// Some `count` facets with weights that keep every sum's expectation, each picked with a probability that follows what it
    /// reflects of light that comes and goes along `h`, at even steps along that measure (systematic sampling). Where facets
    /// of one normal share a lobe, each is as likely. `None` where it saves nothing.
    pub(crate) fn about(&self, h: Vec3, count: usize) -> Option<Self> {
        if self.sum.facet_count() < 2 * count {
            return None;
        }
        let lit = self.sum.groups().iter().filter(|group| !group.is_black);
        let facets: usize = lit.map(|group| group.range.len()).sum();
        let share = |range: &Range<usize>| share_of(range.len(), count, facets);
        let mut picks = SampledFacets::default();
        let groups = self.sum.groups().iter().map(|group| {
            let first = picks.facets.len();
            let patches = match &group.patches {
                _ if group.is_black => None,
                Some(patches) => Some(
                    patches
                        .iter()
                        .map(|NormalCluster { range, normal }| {
                            let chance = in_whole_numbers((share(range) / range.len().max(1) as f64) as f32);
                            let range = picks.walk(range.clone(), std::iter::repeat(chance));
                            NormalCluster { range, normal: *normal }
                        })
                        .collect(),
                ),
                None => {
                    let chances = chances(self.sum.shares(group, h), share(&group.range) as f32);
                    picks.walk(group.range.clone(), chances.into_iter().map(in_whole_numbers));
                    None
                }
            };
            (first..picks.facets.len(), patches)
        });
        let groups: Vec<_> = groups.collect();
        let visibility = self.visibility.picked(&picks.facets)?;
        Some(Self::new(Arc::new(self.sum.sampled(&picks, groups)), Arc::new(visibility)))
    }
}

/// Facets in ascending order, and what each stands for.
#[derive(Default)]
struct SampledFacets {
    facets: Vec<usize>,
    weights: Vec<f32>,
}

impl SampledFacets {
    /// SampledFacets of a run of facets those at which the sum of the chances passes a multiple of [`CERTAIN`]; where they stand.
    fn walk(&mut self, range: Range<usize>, chances: impl Iterator<Item = u32>) -> Range<usize> {
        let first = self.facets.len();
        let mut walked = CERTAIN / 2;
        for (facet, chance) in range.zip(chances) {
            walked += chance;
            if walked >= CERTAIN {
                walked -= CERTAIN;
                self.facets.push(facet);
                self.weights.push(CERTAIN as f32 / chance as f32);
            }
        }
        first..self.facets.len()
    }
}

/// A chance in `(0, 1]`, of [`CERTAIN`].
fn in_whole_numbers(chance: f32) -> u32 {
    (chance * CERTAIN as f32).round().clamp(1.0, CERTAIN as f32) as u32
}

/// Chances in `(0, 1]` in proportion to `shares`, which add up to 1, so that about `count` are picked, and no more.
fn chances(mut shares: Vec<f32>, count: f32) -> Vec<f32> {
    let mut scale = count;
    for _ in 0..ROUNDS {
        let expected = sum(&shares, |share| least(scale * share, 1.0));
        scale *= count / expected.max(1e-9);
    }
    for share in &mut shares {
        *share = (scale * *share).clamp(1e-9, 1.0);
    }
    shares
}

fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The sum of what becomes of each value, in as many partial sums as fill vectors.
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
    /// What part each facet of a group has in what the group reflects of light along `h` back along `h`: the mean over its
    /// lobes, some of it the same for all.
    fn shares(&self, group: &Group, h: Vec3) -> Vec<f32> {
        let count = group.range.len();
        let mut shares = vec![EVENLY / count.max(1) as f32; count];
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
            let each = (1.0 - EVENLY) / parts as f32;
            for (share, value) in shares.iter_mut().zip(&values) {
                *share += each * if total > 0.0 { value / total } else { 1.0 / count as f32 };
            }
        }
        shares
    }

    /// Facets that stand for all; where those of each group stand, and their runs of one normal.
    fn sampled(&self, picks: &SampledFacets, groups: Vec<(Range<usize>, Option<Vec<NormalCluster>>)>) -> Self {
        let facets = || picks.facets.iter().zip(&picks.weights);
        let areas = facets().map(|(&s, weight)| self.facet(s).1 * weight).collect();
        let normals = [0, 1, 2].map(|axis| picks.facets.iter().map(|&s| self.facet(s).0[axis]).collect());
        let groups = self.groups().iter().zip(groups).map(|(group, (range, patches))| {
            let weighted = |areas: &Vec<f32>| -> Vec<f32> {
                let of_group = facets().skip(range.start).take(range.len());
                of_group.map(|(&s, weight)| areas[s - group.range.start] * weight).collect()
            };
            let rgb_areas = group.rgb_areas.as_ref().map(|rgb| rgb.each_ref().map(weighted));
            Group { range, rgb_areas, patches, ..group.clone() }
        });
        self.over(normals, areas, groups.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_add_up_to_the_count_and_never_exceed_certainty() {
        let raw: Vec<f32> = (0..1000).map(|k| if k % 100 == 0 { 50.0 } else { 1.0 }).collect();
        let total: f32 = raw.iter().sum();
        let shares: Vec<f32> = raw.iter().map(|share| share / total).collect();
        let chances = chances(shares, 200.0);
        let expected: f32 = chances.iter().sum();
        assert!((expected - 200.0).abs() < 1.0, "{expected}");
        assert!(chances.iter().all(|&chance| chance > 0.0 && chance <= 1.0));
        // What weighs fifty times as much is certain.
        assert_eq!(chances[0], 1.0);
    }
}
