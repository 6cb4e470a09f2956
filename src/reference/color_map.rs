//! Truth of filtered colour maps: quadrature, supersampling and ray casting.

use std::sync::{LazyLock, OnceLock};

use glam::{DMat2, DVec2, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Reference;
use crate::color_map::statistics::{DriverGrid, Footprint, HistogramMips, MIN_DEVIATION};
use crate::color_map::{Normal, StopMap, normal};
use crate::geometry::relief::slope_of;
use crate::geometry::{FacetSampler, SampleShift, lifted_origins};

/// Nodes of a quadrature over a distribution.
const NODES: usize = 100_000;
/// Strata of a footprint along each axis: of queries, and of the pixels of an image.
pub const QUERY_STRATA: usize = 64;
pub const IMAGE_STRATA: usize = 16;
/// Entries of the table of normal quantiles, from which samples are drawn.
const QUANTILES: usize = 1 << 14;
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

/// Statistics of a Gaussian footprint: moments of the driver, mean colour, and the colour's standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootprintTruth {
    pub moments: Normal,
    pub color: DVec3,
    pub standard_error: DVec3,
}

/// Supersamples a footprint at stratified points. `map` is over deviations.
pub fn supersampled(grid: &DriverGrid, map: &StopMap, at: &Footprint, strata: usize, seed: u64) -> FootprintTruth {
    static TABLE: LazyLock<Vec<f64>> =
        LazyLock::new(|| (0..QUANTILES).map(|k| normal::quantile((k as f64 + 0.5) / QUANTILES as f64)).collect());
    let (axes, deviations) = crate::color_map::statistics::principal(at.covariance);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut first, mut second) = (0.0, 0.0);
    let (mut color, mut square) = (DVec3::ZERO, DVec3::ZERO);
    let count = (strata * strata) as f64;
    for k in 0..strata * strata {
        let mut draw = |cell: usize| {
            let u: f64 = random.random();
            TABLE[(((cell as f64 + u) / strata as f64 * QUANTILES as f64) as usize).min(QUANTILES - 1)]
        };
        let (x, y) = (deviations[0] * draw(k % strata), deviations[1] * draw(k / strata));
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

/// The truth of a footprint: from histograms where it is large enough for them, else supersampled. The error of
/// histograms is below 0.01 and counts as no standard error.
pub fn footprint(
    grid: &DriverGrid,
    histograms: &OnceLock<HistogramMips>,
    map: &StopMap,
    at: &Footprint,
    strata: usize,
    seed: u64,
) -> FootprintTruth {
    let scale = grid.size.as_dvec2() * f64::from(grid.repeat);
    let scale = DMat2::from_diagonal(scale);
    let covariance = scale * at.covariance * scale;
    let (_, deviations) = crate::color_map::statistics::principal(covariance);
    // Up to a few correlation lengths the supersamples are exact enough, and histograms blur at their bins.
    if deviations[1] < LARGE * MIN_DEVIATION {
        return supersampled(grid, map, at, strata, seed);
    }
    let mips = histograms.get_or_init(|| HistogramMips::new(grid));
    let parts = mips.read(grid.texels(at.centre), covariance);
    FootprintTruth { moments: mips.moments(&parts), color: mips.mean(map, &parts), standard_error: DVec3::ZERO }
}

/// Footprints whose shorter deviation is this many times the smallest one of histograms take their truth from them.
const LARGE: f64 = 4.0;

/// The sine of the lowest elevation of rays.
const LOWEST: f32 = 2e-3;

/// A direction at least [`LOWEST`] above the horizon.
fn lifted(direction: Vec3) -> Vec3 {
    direction.with_z(direction.z.max(LOWEST))
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
    /// Casts rays to find the part of the tile that a viewer sees and the part of it that a light reaches. A direction
    /// that is closer to the horizon than [`LOWEST`] is lifted there, because its rays would cross thousands of tiles.
    pub fn seen(&self, light: Option<Vec3>, o: Vec3) -> SeenFacets {
        let (light, o) = (light.map(lifted), lifted(o));
        let sampler = FacetSampler::new(self.mesh);
        let mut result = SeenFacets::default();
        let (mut facing, mut lit) = (0.0, 0.0);
        for pass in 0..PASSES {
            let facets = sampler.sample(self.mesh, FACETS, SampleShift::from_seed(pass));
            let origins = lifted_origins(&facets, self.mesh.size);
            for (s, &origin) in origins.iter().enumerate() {
                let (n, triangle) = (facets.normals[s], facets.triangles[s]);
                let sees = |to: Vec3| to.z > 0.0 && n.dot(to) > 0.0 && !self.grid.is_blocked(origin, to, triangle);
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
