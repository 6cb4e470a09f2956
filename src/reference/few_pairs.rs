//! The reference at few pairs. Lobes of many facets are cheap, and rays are not. For each pair, rays start from a
//! systematic sample of the facets, whose density is proportional to what the facets reflect and to their openness.

use glam::{DVec3, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::paths::Paths;
use super::ray_cast::{Estimate, Reference, ReferenceSettings, in_passes};
use crate::geometry::facets::openness::Openness;
use crate::geometry::{FacetSampler, Facets, lifted_origins};
use crate::metrics::Pair;

/// Most facets per pass and pair from which rays start.
const SAMPLES: usize = 192;

/// The facets of a pass, and what is known of all of them.
struct Pass<'r> {
    reference: &'r Reference<'r>,
    facets: Facets,
    origins: Vec<Vec3>,
    /// Openness of each facet.
    openness: Vec<f64>,
    /// The visible projected area is known, so that no rays measure it.
    is_closed: bool,
    paths: Option<Paths<'r>>,
}

impl Reference<'_> {
    /// Estimates `f̄` at each pair as [`Reference::estimate`] does, with far fewer rays and walks.
    pub fn estimate_few_pairs(
        &self,
        pairs: &[Pair],
        settings: &ReferenceSettings,
        progress: impl FnMut(usize, f64) -> bool,
    ) -> Vec<Estimate> {
        let sampler = FacetSampler::new(self.mesh);
        let openness = Openness::measure(&sampler, self.mesh, &self.grid);
        let is_closed = self.mesh.closes_plane && self.mesh.corner_normals.is_none();
        in_passes(pairs, settings, progress, |number, shift, moments| {
            let facets = sampler.sample(self.mesh, settings.facets, shift);
            let origins = lifted_origins(&facets, self.mesh.size);
            let openness = (0..facets.len()).map(|s| openness.of(&facets, s)).collect();
            let pass = Pass { reference: self, facets, origins, openness, is_closed, paths: self.paths() };
            moments.par_iter_mut().zip(pairs).enumerate().for_each(|(at, (moments, pair))| {
                let start = fraction(settings.seed ^ number << 20 ^ (at as u64) << 40);
                let (s, a) = pass.sums(*pair, start);
                moments.add(s, a);
            });
        })
    }
}

impl Pass<'_> {
    /// Estimates `(Σ ΔA V V f, a_v)`. `start` in `[0, 1)` shifts the systematic samples.
    fn sums(&self, Pair { i, o }: Pair, start: f64) -> (DVec3, f64) {
        if i.z <= 0.0 || o.z <= 0.0 {
            return (DVec3::ZERO, 0.0);
        }
        let Facets { normals, areas, .. } = &self.facets;
        let reflected: Vec<Vec3> = (0..self.facets.len()).map(|s| self.reflected(s, i, o)).collect();
        let mut sum = DVec3::ZERO;
        let expected = reflected.iter().zip(&self.openness).map(|(f, openness)| f.as_dvec3().element_sum() * openness);
        sample(expected, start, |s, weight| {
            if self.is_visible(s, o) && self.is_visible(s, i) {
                sum += weight * reflected[s].as_dvec3();
            }
        });
        let projected = |s: usize| f64::from(areas[s] * normals[s].dot(o).max(0.0));
        let seen = (0..self.facets.len()).map(|s| projected(s) * self.openness[s]);
        if let Some(paths) = &self.paths {
            let mut rng = ChaCha8Rng::seed_from_u64(start.to_bits());
            sample(seen.clone(), start, |s, weight| {
                if self.is_visible(s, o) {
                    sum += weight * paths.walk_from(&self.facets, self.origins[s], s, Pair { i, o }, &mut rng);
                }
            });
        }
        if self.is_closed {
            return (sum, f64::from(self.reference.mesh.base_area() * o.z));
        }
        let mut area = 0.0;
        sample(seen, start, |s, weight| {
            if self.is_visible(s, o) {
                area += weight * projected(s);
            }
        });
        (sum, area)
    }

    /// `ΔA f` of a facet without visibility.
    fn reflected(&self, s: usize, i: Vec3, o: Vec3) -> Vec3 {
        let (normal, reference) = (self.facets.normals[s], self.reference);
        if normal.dot(i) <= 0.0 || normal.dot(o) <= 0.0 {
            return Vec3::ZERO;
        }
        let material = &reference.materials[reference.material_of_slot[usize::from(self.facets.slots[s])]];
        material.brdf.f(normal, i, o) * material.color * self.facets.colors[s] * self.facets.areas[s]
    }

    fn is_visible(&self, s: usize, to: Vec3) -> bool {
        self.facets.normals[s].dot(to) > 0.0
            && !self.reference.grid.is_blocked(self.origins[s], to, self.facets.triangles[s])
    }
}

/// Draws [`SAMPLES`] systematic samples with a density proportional to `values`. Calls `each(index, weight)` once per
/// drawn index. The expectation of the sum of `weight · x[index]` is the sum of `x`, for any `x` that is 0 where `values` is.
fn sample(values: impl Iterator<Item = f64> + Clone, start: f64, mut each: impl FnMut(usize, f64)) {
    let step = values.clone().sum::<f64>() / SAMPLES as f64;
    if !(step > 0.0 && step.is_finite()) {
        return;
    }
    let (mut sum, mut drawn) = (0.0, 0.0);
    for (s, value) in values.enumerate() {
        sum += value;
        let wanted = (sum / step - start).ceil().max(drawn);
        if wanted > drawn {
            each(s, (wanted - drawn) * step / value);
            drawn = wanted;
        }
    }
}

/// A number in `[0, 1)` that looks random.
fn fraction(seed: u64) -> f64 {
    let mixed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0x94d0_49bb_1331_11eb);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::mirror_biased_pairs;
    use crate::pipeline::Pipeline;

    #[test]
    fn few_rays_give_the_values_of_the_reference_within_the_standard_errors() {
        for name in ["fig4b_bicolor_cup", "fig8a_hammered", "fig6a_velvet_spread"] {
            let loaded = crate::scene::open(name, &[]).unwrap();
            let pairs = mirror_biased_pairs(48, 5);
            let of = |facets: usize, max_passes: usize, seed: u64, few: bool| {
                let settings = ReferenceSettings { facets, max_passes, target: 0.0, seed };
                let mut error = 0.0;
                let estimates = Pipeline::new().with_reference(&loaded, |reference| {
                    let progress = |_, at| {
                        error = at;
                        true
                    };
                    if few {
                        reference.estimate_few_pairs(&pairs, &settings, progress)
                    } else {
                        reference.estimate(&pairs, &settings, progress)
                    }
                });
                (estimates.unwrap(), error)
            };
            let ((few, few_error), (all, all_error)) = (of(2048, 16, 3, true), of(2048, 6, 4, false));
            let squares =
                |value: &dyn Fn(usize) -> Vec3| (0..pairs.len()).map(|k| value(k).length_squared()).sum::<f32>();
            let difference = squares(&|k| few[k].f_bar - all[k].f_bar) / squares(&|k| all[k].f_bar);
            let (difference, expected) = (f64::from(difference).sqrt(), few_error.hypot(all_error));
            assert!(difference < 2.0 * expected + 1e-3, "{name}: {difference}, expected about {expected}");
            assert!(few_error < 0.08, "{name}: {few_error}");
        }
    }

    #[test]
    fn samples_of_a_sum_add_up_to_it() {
        let values = [0.0, 3.0, 0.0, 1e-6, 40.0, 0.5];
        let mut total = 0.0;
        for k in 0..1000 {
            sample(values.into_iter(), f64::from(k) / 1000.0, |s, weight| total += weight * values[s] / 1000.0);
        }
        assert!((total - 43.500_001).abs() < 1e-6, "{total}");
        sample([0.0, 0.0].into_iter(), 0.5, |s, _| panic!("drew {s} of nothing"));
    }
}
