//! Truth of filtered colour maps: quadrature, supersampling and ray casting.

use glam::{DVec2, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Reference;
use crate::color_map::statistics::{DriverGrid, Footprint};
use crate::color_map::{Normal, StopMap, normal};
use crate::geometry::relief::slope_of;
use crate::geometry::{FacetSampler, SampleShift, lifted_origins};

/// Nodes of a quadrature over a distribution.
const NODES: usize = 100_000;
/// Samples of a footprint: strata along each axis, and samples whose spread gives the standard error.
const STRATA: usize = 64;
/// Facets and passes from which visible slopes and lit parts are estimated.
const FACETS: usize = 6144;
const PASSES: u64 = 8;

/// The mean of a map under a normal distribution by the midpoint rule over quantiles.
pub fn normal_mean(map: &StopMap, at: &Normal) -> DVec3 {
    let z = |k: usize| normal::quantile((k as f64 + 0.5) / NODES as f64);
    (0..NODES).map(|k| map.color(at.mean + at.deviation * z(k))).sum::<DVec3>() / NODES as f64
}

/// Moments of visible heights (Eq. 16) and the mean of a map under them: quantiles of the largest of `a + 1` normals.
pub fn heights_mean(map: &StopMap, exponent: f64) -> (Normal, DVec3) {
    let (mut first, mut second, mut color) = (0.0, 0.0, DVec3::ZERO);
    for k in 0..NODES {
        // Φ(h)^(a+1) = u, in terms of 1 - Φ(h), which does not round to 0.
        let u = (k as f64 + 0.5) / NODES as f64;
        let above = -(u.ln() / (exponent + 1.0)).exp_m1();
        let h = -normal::quantile(above);
        first += h / NODES as f64;
        second += h * h / NODES as f64;
        color += map.color(h) / NODES as f64;
    }
    (Normal { mean: first, deviation: (second - first * first).max(0.0).sqrt() }, color)
}

/// What a Gaussian footprint of a driver has: moments of the driver, mean colour, and the colour's standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootprintTruth {
    pub moments: Normal,
    pub color: DVec3,
    pub standard_error: DVec3,
}

/// Supersamples a footprint at stratified points. `map` is over deviations.
pub fn footprint(grid: &DriverGrid, map: &StopMap, at: &Footprint, seed: u64) -> FootprintTruth {
    let (axes, deviations) = crate::color_map::statistics::principal(at.covariance);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut first, mut second) = (0.0, 0.0);
    let (mut color, mut square) = (DVec3::ZERO, DVec3::ZERO);
    let count = (STRATA * STRATA) as f64;
    for k in 0..STRATA * STRATA {
        let mut draw = |cell: usize| {
            let u: f64 = random.random();
            normal::quantile(((cell as f64 + u) / STRATA as f64).clamp(1e-12, 1.0 - 1e-12))
        };
        let (x, y) = (deviations[0] * draw(k % STRATA), deviations[1] * draw(k / STRATA));
        let value = grid.at(at.centre + axes[0] * x + axes[1] * y);
        first += value / count;
        second += value * value / count;
        let sample = map.color(value);
        color += sample / count;
        square += sample * sample / count;
    }
    // Strata only reduce the error of independent samples.
    let variance = (square - color * color).max(DVec3::ZERO) / count;
    let standard_error = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt());
    let moments = Normal { mean: first, deviation: (second - first * first).max(0.0).sqrt() };
    FootprintTruth { moments, color, standard_error }
}

/// Facets that rays find visible.
#[derive(Debug, Clone, Default)]
pub struct SeenFacets {
    /// Slope, colour weight and projected area of each facet that the viewer sees.
    pub seen: Vec<(DVec2, DVec3, f64)>,
    /// Lit part of what is seen, of facets that face the light; 0 without a light.
    pub lit: f64,
}

impl Reference<'_> {
    /// What a viewer sees of the tile, by rays, and which part of it a light reaches.
    pub fn seen(&self, light: Option<Vec3>, o: Vec3) -> SeenFacets {
        let sampler = FacetSampler::new(self.mesh);
        let mut result = SeenFacets::default();
        let (mut facing, mut lit) = (0.0, 0.0);
        for pass in 0..PASSES {
            let facets = sampler.sample(self.mesh, FACETS, SampleShift::from_seed(pass));
            let origins = lifted_origins(&facets, self.mesh.size);
            for s in 0..facets.len() {
                let (n, triangle) = (facets.normals[s], facets.triangles[s]);
                let sees = |to: Vec3| to.z > 0.0 && n.dot(to) > 0.0 && !self.grid.is_blocked(origins[s], to, triangle);
                if !sees(o) {
                    continue;
                }
                let area = f64::from(facets.areas[s] * n.dot(o));
                result.seen.push((slope_of(n), facets.colors[s].as_dvec3(), area));
                if let Some(i) = light.filter(|i| n.dot(*i) > 0.0) {
                    facing += area;
                    lit += if sees(i) { area } else { 0.0 };
                }
            }
        }
        result.lit = if facing > 0.0 { lit / facing } else { 0.0 };
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color_map::heights::Largest;
    use crate::color_map::stops::tests::{MAPS, map};

    #[test]
    fn quantiles_of_a_normal_and_of_visible_heights_agree_with_the_closed_forms() {
        for name in MAPS {
            let at = Normal { mean: 0.2, deviation: 0.7 };
            assert!((normal_mean(&map(name), &at) - map(name).mean(&at)).abs().max_element() < 5e-5, "{name}");
            for exponent in [0.0, 0.5, 12.0, 1e5] {
                let (moments, color) = heights_mean(&map(name), exponent);
                let largest = Largest { exponent };
                assert!((color - map(name).mean(&largest)).abs().max_element() < 5e-5, "{name} {exponent}");
                assert!((moments.mean - largest.exact_moments().mean).abs() < 1e-3);
            }
        }
    }
}
