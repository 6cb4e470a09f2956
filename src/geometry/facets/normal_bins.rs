//! Binning of facet normals: facets of one bin share a normal, so one lobe serves them all.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::geometry::Facets;
use crate::math::directions::to_angles;

impl Facets {
    /// Sets the normals of all facets of a slot within a bin to their mean. About `bins` cells of equal size cover the
    /// sphere.
    ///
    /// Areas are multiplied by the length of the mean normal, which preserves the projected area of each bin in all
    /// directions. The factor is about `1 - Δθ²/8` for bins of width `Δθ`.
    pub(crate) fn bin_normals(&mut self, bins: usize) {
        let step = (4.0 * PI / bins.max(1) as f32).sqrt();
        let mut sums: BTreeMap<(u16, u32, u32), (DVec3, f64)> = BTreeMap::new();
        let keys: Vec<_> =
            self.slots.iter().zip(&self.normals).map(|(slot, normal)| cell(*slot, *normal, step)).collect();
        for (key, (normal, area)) in keys.iter().zip(self.normals.iter().zip(&self.areas)) {
            let sum = sums.entry(*key).or_default();
            sum.0 += normal.as_dvec3() * f64::from(*area);
            sum.1 += f64::from(*area);
        }
        for (s, key) in keys.iter().enumerate() {
            let (normal, area) = sums[key];
            if let Some(mean) = normal.try_normalize() {
                self.normals[s] = mean.as_vec3();
                self.areas[s] *= (normal.length() / area) as f32;
            }
        }
    }
}

/// The bin of a normal: rings of equal width are divided into cells that are about as long as wide.
fn cell(slot: u16, normal: Vec3, step: f32) -> (u16, u32, u32) {
    let (theta, phi) = to_angles(normal);
    let rings = (PI / step).ceil().max(1.0);
    let ring = (theta / PI * rings).floor().min(rings - 1.0);
    let around = (TAU * ((ring + 0.5) / rings * PI).sin() / step).round().max(1.0);
    (slot, ring as u32, (phi / TAU * around).floor() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Pipeline;

    fn facets(bins: Option<usize>) -> Facets {
        let loaded = crate::scene::open("fig8a_hammered", &[]).unwrap();
        let mesh = Pipeline::new().mesh(&loaded).unwrap();
        let mut facets = Facets::sample(&mesh, 4096, 1);
        if let Some(bins) = bins {
            facets.bin_normals(bins);
        }
        facets
    }

    #[test]
    fn bins_preserve_the_projected_area_and_limit_the_number_of_normals() {
        let (exact, binned) = (facets(None), facets(Some(512)));
        let projected = |facets: &Facets| -> DVec3 {
            facets.normals.iter().zip(&facets.areas).map(|(n, area)| n.as_dvec3() * f64::from(*area)).sum()
        };
        assert!((projected(&exact) - projected(&binned)).length() < 1e-6 * projected(&exact).length());
        let mut normals: Vec<[u32; 3]> = binned.normals.iter().map(|n| n.to_array().map(f32::to_bits)).collect();
        normals.sort_unstable();
        normals.dedup();
        assert!(normals.len() > 16 && normals.len() < 512, "{}", normals.len());
        let step = (4.0 * PI / 512.0).sqrt();
        let max_angle = exact.normals.iter().zip(&binned.normals).map(|(a, b)| a.angle_between(*b)).fold(0.0, f32::max);
        assert!(max_angle < 1.6 * step, "{max_angle}");
    }
}
