//! The sum over a tile with few distinct normals, for many lights at once. One lobe per normal cluster, evaluated for
//! all lights together, multiplies the area that is visible from light and view. That area needs no sum over facets if
//! the light is above or below all horizons of the cluster.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::facet_groups::NormalCluster;
use crate::brdf::LobeAngles;
use crate::effective::{FacetGroup, FacetSum};
use crate::math::simd;
use crate::math::simd::{HorizonTaps, LightPairs};
use crate::visibility::{HorizonMap, Visibility};

/// Horizon bounds of all normal clusters, which are computed once for all directions.
#[derive(Debug, Clone)]
pub(crate) struct ClusteredSum {
    clusters: usize,
    /// `[azimuth][cluster]`: the lowest and the highest slope of a horizon.
    horizon_bounds: Vec<[f32; 2]>,
}

/// One view of a tile.
#[derive(Clone, Copy)]
pub(crate) struct SumView<'a> {
    pub sum: &'a FacetSum,
    pub horizon_map: &'a HorizonMap,
    pub o: Vec3,
    /// Area times visibility along `o`, of all facets.
    pub areas: &'a [f32],
}

/// Normal clusters of all reflecting groups, with their groups.
fn clusters(sum: &FacetSum) -> impl Iterator<Item = (&FacetGroup, &NormalCluster)> {
    let reflecting = sum.groups().iter().filter(|group| !group.is_black);
    reflecting.flat_map(|group| group.clusters.iter().flatten().map(move |cluster| (group, cluster)))
}

impl ClusteredSum {
    /// Computes the horizon bounds. `None` if a reflecting group has no clusters, colours vary over the facets of one
    /// slot, or visibility is not a horizon map.
    pub(crate) fn of(sum: &FacetSum, visibility: &Visibility) -> Option<Self> {
        let Visibility::HorizonMap(horizon_map) = visibility else { return None };
        let ranges: Vec<Range<usize>> =
            sum.supports_clustered_sum().then(|| clusters(sum).map(|(_, cluster)| cluster.range.clone()).collect())?;
        Some(Self { clusters: ranges.len(), horizon_bounds: horizon_map.horizon_bounds(&ranges) })
    }

    /// Writes `a_v f̄` of each light to `out`.
    pub(crate) fn sums(
        &self,
        view: SumView,
        lights: &[Vec3],
        pairs: &mut LightPairs,
        mut out: impl FnMut(usize, DVec3),
    ) {
        for (part, lights) in lights.chunks(LightPairs::MAX).enumerate() {
            pairs.set(lights, view.o);
            let mut taps = [HorizonTaps::ABOVE_ALL; LightPairs::MAX];
            for (k, taps) in taps.iter_mut().enumerate().take(lights.len()) {
                *taps = view.horizon_map.taps_at(pairs.light(k), pairs.azimuths[k], pairs.cosines[k]);
            }
            let mut totals = [DVec3::ZERO; LightPairs::MAX];
            for (index, (group, cluster)) in clusters(view.sum).enumerate() {
                if cluster.normal.dot(view.o) > 0.0 {
                    let areas = self.visible_areas(view, (index, cluster), pairs, &taps[..lights.len()]);
                    add(group, cluster.normal, pairs, &areas[..lights.len()], &mut totals);
                }
            }
            for (k, (total, light)) in totals.into_iter().zip(lights).enumerate() {
                out(part * LightPairs::MAX + k, if light.z > 0.0 { total } else { DVec3::ZERO });
            }
        }
    }

    /// The area of a cluster that is visible from each light and from the view.
    fn visible_areas(
        &self,
        view: SumView,
        (index, cluster): (usize, &NormalCluster),
        pairs: &LightPairs,
        lights: &[HorizonTaps],
    ) -> [f64; LightPairs::MAX] {
        let areas = &view.areas[cluster.range.clone()];
        let along = |taps: &HorizonTaps| view.horizon_map.visible_sum(taps, cluster.range.clone(), areas);
        let mut all = None;
        let mut visible = [0.0; LightPairs::MAX];
        for (k, (visible, taps)) in visible.iter_mut().zip(lights).enumerate() {
            if cluster.normal.dot(pairs.light(k)) <= 0.0 {
                continue;
            }
            let [a, b] = taps.azimuths.map(|azimuth| self.horizon_bounds[azimuth * self.clusters + index]);
            *visible = if taps.between(a[1], b[1]) >= 1.0 {
                *all.get_or_insert_with(|| along(&HorizonTaps::ABOVE_ALL))
            } else if taps.between(a[0], b[0]) <= 0.0 {
                0.0
            } else {
                along(taps)
            };
        }
        visible
    }
}

/// Adds the reflection of one cluster, with its visible area for each light, to `totals`.
fn add(group: &FacetGroup, normal: Vec3, pairs: &LightPairs, areas: &[f64], totals: &mut [DVec3; LightPairs::MAX]) {
    if areas.iter().all(|&area| area == 0.0) {
        return;
    }
    let color = group.color.as_dvec3();
    let mut values = [0.0; LightPairs::MAX];
    for (lobe, term) in &group.lobes {
        simd::light_lobes(*lobe, pairs, normal, &mut values);
        for (k, (area, total)) in areas.iter().zip(&mut *totals).enumerate().filter(|(_, (area, _))| **area > 0.0) {
            *total += color * term.tint(pairs.i_dot_h[k]).as_dvec3() * (f64::from(values[k]) * area);
        }
    }
    for table in &group.measured {
        for (k, (area, total)) in areas.iter().zip(&mut *totals).enumerate().filter(|(_, (area, _))| **area > 0.0) {
            let h = Vec3::new(pairs.h[0][k], pairs.h[1][k], pairs.h[2][k]);
            let angles = LobeAngles::new(normal, pairs.light(k), pairs.o, h);
            if angles.n_dot_i > 0.0 && angles.n_dot_o > 0.0 {
                let value = table.f_r(&angles) * (angles.n_dot_i * angles.n_dot_o);
                *total += color * value.as_dvec3() * *area;
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
        let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
        assert!(ClusteredSum::of(&direct.sum, &direct.visibility).is_some());
        let facets = direct.sum.facet_count();
        let visibility = |d: Vec3| {
            let mut v = vec![0.0; facets];
            direct.visibility.fill(d, 0..facets, &mut v);
            v
        };
        let lights: Vec<Vec3> = (0..90_u8).map(|k| from_angles(f32::from(k) * 0.0174, f32::from(k) * 2.4)).collect();
        for o in [from_angles(0.2, 1.0), from_angles(0.9, 4.0), from_angles(1.4, 2.0)] {
            let v_o = visibility(o);
            let plain: Vec<DVec3> = lights.iter().map(|&i| direct.sum.sum(i, o, &visibility(i), &v_o)).collect();
            let peak = plain.iter().map(|sum| sum.max_element()).fold(0.0, f64::max);
            direct.sums(&lights, o, |k, sum| {
                assert!((sum - plain[k]).abs().max_element() < 1e-5 * peak, "{k}: {sum} {}", plain[k]);
            });
        }
    }
}
