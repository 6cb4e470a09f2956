//! A noisy reference for images. Each query sums over few facets of its own, so that an image takes seconds. The mean
//! of many such images converges to the image of the reference.

use glam::{DVec3, Vec3};

use super::Reference;
use crate::base::Cancel;
use crate::effective::Reflectance;
use crate::geometry::{FacetSampler, Facets, SampleShift, lifted_origins};

/// Number of facets per query. If a tile has holes, the sum is divided by the estimated visible area of the facets. The
/// bias of that ratio is of the order of one over their number.
const FACETS: usize = 256;
/// Number of sets of facets from which a query takes one.
const SETS: usize = 128;

/// A noisy evaluation of the reference. Its noise differs between directions and between seeds.
#[derive(Debug)]
pub struct StochasticReference<'r> {
    reference: &'r Reference<'r>,
    facets: Facets,
    origins: Vec<Vec3>,
    seed: u64,
    cancel: Cancel,
}

impl Reference<'_> {
    /// The reference for one noisy image; `None` with interreflection, which takes too long. After `cancel` is set, all
    /// values are black.
    pub fn stochastic_reference(&self, seed: u64, cancel: &Cancel) -> Option<StochasticReference<'_>> {
        if self.bounces > 0 {
            return None;
        }
        let facets = FacetSampler::new(self.mesh).sample(self.mesh, FACETS * SETS, SampleShift::from_seed(seed));
        let origins = lifted_origins(&facets, self.mesh.size);
        Some(StochasticReference { reference: self, facets, origins, seed, cancel: cancel.clone() })
    }
}

impl Reflectance for StochasticReference<'_> {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let mut sums = vec![DVec3::ZERO; lights.len()];
        let mut visible_area = 0.0;
        if o.z > 0.0 && !self.cancel.is_set() {
            // The facets follow the surface in order, so that every SETS-th facet makes a stratified set.
            let first = hash(o, self.seed) as usize % SETS;
            for s in (first..self.facets.len()).step_by(SETS) {
                visible_area += self.add(s, lights, o, &mut sums);
            }
        }
        if self.reference.mesh.closes_plane {
            // The visible area of a tile without holes is known. An estimate would add noise to the divisor.
            visible_area = f64::from(self.reference.mesh.base_area() * o.z.max(0.0)) / SETS as f64;
        }
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = if visible_area > 0.0 { (sum / visible_area).as_vec3() } else { Vec3::ZERO };
        }
    }
}

impl StochasticReference<'_> {
    /// Adds facet `s` to the sums and returns its visible projected area.
    fn add(&self, s: usize, lights: &[Vec3], o: Vec3, sums: &mut [DVec3]) -> f64 {
        let (normal, triangle) = (self.facets.normals[s], self.facets.triangles[s]);
        let grid = &self.reference.grid;
        let is_visible = |to: Vec3| normal.dot(to) > 0.0 && !grid.is_blocked(self.origins[s], to, triangle);
        if !is_visible(o) {
            return 0.0;
        }
        let material = &self.reference.materials[self.reference.material_of_slot[usize::from(self.facets.slots[s])]];
        let weight = material.color * self.facets.colors[s] * self.facets.areas[s];
        for (sum, &i) in sums.iter_mut().zip(lights) {
            if i.z > 0.0 && is_visible(i) {
                *sum += (material.brdf.f(normal, i, o) * weight).as_dvec3();
            }
        }
        f64::from(self.facets.areas[s] * normal.dot(o))
    }
}

/// Hash of a direction. Directions that differ in few bits have unrelated hashes.
fn hash(direction: Vec3, seed: u64) -> u64 {
    let mix = |state: u64, word: u64| (state ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    let state = direction.to_array().iter().fold(seed, |state, x| mix(state, u64::from(x.to_bits())));
    mix(state, 0xd1b5_4a32) >> 20
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::mirror_biased_pairs;
    use crate::pipeline::Pipeline;
    use crate::reference::ReferenceSettings;

    #[test]
    fn the_mean_of_stochastic_references_is_the_reference() {
        for name in ["fig4b_bicolor_cup", "fig8a_hammered", "fig6a_velvet_spread"] {
            let loaded = crate::scene::open(name, &[]).unwrap().without_interreflection();
            let pairs = mirror_biased_pairs(24, 5);
            let settings = ReferenceSettings { facets: 8192, max_passes: 4, target: 0.0, seed: 3 };
            let mean_of = |reference: &Reference<'_>, seeds: std::ops::Range<u64>| -> Vec<Vec3> {
                let part = 1.0 / (seeds.end - seeds.start) as f32;
                let mut means = vec![Vec3::ZERO; pairs.len()];
                for seed in seeds {
                    let stochastic_reference = reference.stochastic_reference(seed, &Cancel::default()).unwrap();
                    for (mean, pair) in means.iter_mut().zip(&pairs) {
                        let mut value = [Vec3::ZERO];
                        stochastic_reference.eval_lights(&[pair.i], pair.o, &mut value);
                        *mean += value[0] * part;
                    }
                }
                means
            };
            let estimate = |reference: &Reference<'_>| {
                (
                    reference.estimate(&pairs, &settings, |_, _| true),
                    [0..32, 32..64].map(|seeds| mean_of(reference, seeds)),
                )
            };
            let (exact, [a, b]) = Pipeline::new().with_reference(&loaded, estimate).unwrap();
            let (mut error, mut noise, mut norm) = (0.0, 0.0, 0.0);
            for (exact, (a, b)) in exact.iter().zip(a.iter().zip(&b)) {
                error += exact.f_bar.distance_squared(0.5 * (*a + *b));
                noise += 0.25 * a.distance_squared(*b);
                norm += exact.f_bar.length_squared();
            }
            let (error, noise) = ((error / norm).sqrt(), (noise / norm).sqrt());
            // 3 % allow for interpolated normals, which change the projected area, and for the error of the reference.
            assert!(error < 2.5 * noise + 0.03 && noise < 0.25, "{name}: {error} with a noise of {noise}");
        }
    }
}
