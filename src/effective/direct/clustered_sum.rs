//! The sum over a tile of few normals for many lights at once: one lobe a normal, worked out for all lights together, times
//! the area that light and view both see. That area needs no sum where the light is above or below all horizons of a normal.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::facet_groups::NormalCluster;
use crate::brdf::LobeAngles;
use crate::effective::{FacetSum, Group};
use crate::math::simd;
use crate::math::simd::LightPairs;
use crate::visibility::{HorizonMap, Visibility};

/// What is known of each run of facets with one normal before any direction is asked for.
#[derive(Debug, Clone)]
pub(crate) struct ClusteredSum {
    runs: usize,
    /// `[azimuth][run]`: elevations [rad] up to which no facet and from which on every facet sees a direction.
    reach: Vec<[f32; 2]>,
}

/// One view of a tile.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub sum: &'a FacetSum,
    pub horizons: &'a HorizonMap,
    pub o: Vec3,
    /// Of all facets, the area times the visibility along `o`.
    pub areas: &'a [f32],
}

/// Runs of one normal with their groups; black groups have none.
fn runs(sum: &FacetSum) -> impl Iterator<Item = (&Group, &NormalCluster)> {
    let lit = sum.groups().iter().filter(|group| !group.is_black);
    lit.flat_map(|group| group.patches.iter().flatten().map(move |patch| (group, patch)))
}

impl ClusteredSum {
    /// `None` where normals are many, colours vary over facets of one material, or visibility is not held as horizons.
    pub(crate) fn of(sum: &FacetSum, visibility: &Visibility) -> Option<Self> {
        let Visibility::HorizonMap(horizons) = visibility else { return None };
        let ranges: Vec<Range<usize>> =
            sum.has_few_normals().then(|| runs(sum).map(|(_, patch)| patch.range.clone()).collect())?;
        Some(Self { runs: ranges.len(), reach: horizons.reach(&ranges) })
    }

    /// `a_v f̄` of each light into `out`.
    pub(crate) fn sums(&self, view: View, lights: &[Vec3], pairs: &mut LightPairs, mut out: impl FnMut(usize, DVec3)) {
        for (part, lights) in lights.chunks(LightPairs::MAX).enumerate() {
            pairs.set(lights, view.o);
            let mut totals = [DVec3::ZERO; LightPairs::MAX];
            for (run, (group, patch)) in runs(view.sum).enumerate() {
                if patch.normal.dot(view.o) > 0.0 {
                    let seen = self.seen(view, (run, patch), pairs, lights.len());
                    add(group, patch.normal, pairs, &seen[..lights.len()], &mut totals);
                }
            }
            for (k, (total, light)) in totals.into_iter().zip(lights).enumerate() {
                out(part * LightPairs::MAX + k, if light.z > 0.0 { total } else { DVec3::ZERO });
            }
        }
    }

    /// The area of a run that each light and the view see.
    fn seen(
        &self,
        view: View,
        (run, patch): (usize, &NormalCluster),
        pairs: &LightPairs,
        lights: usize,
    ) -> [f64; LightPairs::MAX] {
        let areas = &view.areas[patch.range.clone()];
        let along =
            |azimuth: f32, elevation: f32| view.horizons.seen_along([azimuth, elevation], patch.range.clone(), areas);
        let mut all = None;
        let mut seen = [0.0; LightPairs::MAX];
        for (k, seen) in seen.iter_mut().enumerate().take(lights) {
            let (azimuth, elevation) = (pairs.azimuths[k], pairs.elevations[k]);
            if patch.normal.dot(pairs.light(k)) <= 0.0 {
                continue;
            }
            let [a, b] = view.horizons.taps(azimuth).map(|(azimuth, _)| self.reach[azimuth * self.runs + run]);
            *seen = if elevation >= a[1].max(b[1]) {
                *all.get_or_insert_with(|| along(azimuth, ABOVE_ALL))
            } else if elevation <= a[0].min(b[0]) {
                0.0
            } else {
                along(azimuth, elevation)
            };
        }
        seen
    }
}

/// Higher than any horizon [rad].
const ABOVE_ALL: f32 = 4.0;

/// Adds what facets of one normal reflect of each light.
fn add(group: &Group, normal: Vec3, pairs: &LightPairs, seen: &[f64], totals: &mut [DVec3; LightPairs::MAX]) {
    if seen.iter().all(|&seen| seen == 0.0) {
        return;
    }
    let color = group.color.as_dvec3();
    let mut values = [0.0; LightPairs::MAX];
    for (lobe, term) in &group.lobes {
        simd::light_lobes(*lobe, pairs, normal, &mut values);
        for (k, (seen, total)) in seen.iter().zip(&mut *totals).enumerate().filter(|(_, (seen, _))| **seen > 0.0) {
            *total += color * term.tint(pairs.i_dot_h[k]).as_dvec3() * (f64::from(values[k]) * seen);
        }
    }
    for table in &group.measured {
        for (k, (seen, total)) in seen.iter().zip(&mut *totals).enumerate().filter(|(_, (seen, _))| **seen > 0.0) {
            let h = Vec3::new(pairs.h[0][k], pairs.h[1][k], pairs.h[2][k]);
            let angles = LobeAngles::new(normal, pairs.light(k), pairs.o, h);
            if angles.n_dot_i > 0.0 && angles.n_dot_o > 0.0 {
                let value = table.f_r(&angles) * (angles.n_dot_i * angles.n_dot_o);
                *total += color * value.as_dvec3() * *seen;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effective::Representation;
    use crate::math::directions::from_angles;
    use crate::pipeline::Pipeline;

    #[test]
    fn sums_for_many_lights_are_the_plain_sums_whether_a_light_is_high_low_or_between() {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &["quality.preset=draft".to_owned()]).unwrap();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let Representation::Direct(direct) = &outcome.brdf.form else { panic!("not a sum") };
        assert!(ClusteredSum::of(&direct.sum, &direct.visibility).is_some());
        let facets = direct.sum.facet_count();
        let seen = |d: Vec3| {
            let mut v = vec![0.0; facets];
            direct.visibility.fill(d, 0..facets, &mut v);
            v
        };
        let lights: Vec<Vec3> = (0..90_u8).map(|k| from_angles(f32::from(k) * 0.0174, f32::from(k) * 2.4)).collect();
        for o in [from_angles(0.2, 1.0), from_angles(0.9, 4.0), from_angles(1.4, 2.0)] {
            let v_o = seen(o);
            let plain: Vec<DVec3> = lights.iter().map(|&i| direct.sum.sum(i, o, &seen(i), &v_o)).collect();
            let peak = plain.iter().map(|sum| sum.max_element()).fold(0.0, f64::max);
            direct.sums(&lights, o, |k, sum| {
                assert!((sum - plain[k]).abs().max_element() < 1e-5 * peak, "{k}: {sum} {}", plain[k]);
            });
        }
    }
}
