//! Importance sampling of an environment: directional lights, each with the energy of its own region.
//!
//! The map is cut into rectangles. Each step applies the cut that reduces `Σ E |d - d̄|²` most, the energy-weighted
//! spread of directions within regions. This is the criterion of Viriyothai and Debevec 2009, applied greedily over all
//! regions and cuts. A region's light has the region's mean direction and energy, so the total is conserved. Each texel
//! with more energy than an average light becomes a light of its own first. The result is deterministic.

use glam::{DVec3, Vec3};

use super::{LatLongMap, luminance};
use crate::render::DirectionalLight;

/// Sums over a rectangle: energy (luminance), its first moment, and RGB energy.
#[derive(Clone, Copy, Default)]
struct EnergyMoments {
    energy: f64,
    direction: DVec3,
    rgb: DVec3,
}

impl EnergyMoments {
    fn of(direction: DVec3, rgb: DVec3) -> Self {
        let energy = luminance(rgb);
        Self { energy, direction: direction * energy, rgb }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            energy: self.energy + other.energy,
            direction: self.direction + other.direction,
            rgb: self.rgb + other.rgb,
        }
    }

    fn minus(self, other: Self) -> Self {
        Self {
            energy: self.energy - other.energy,
            direction: self.direction - other.direction,
            rgb: self.rgb - other.rgb,
        }
    }

    /// Returns `Σ E |d - d̄|²`, using `|d| = 1`.
    fn spread(&self) -> f64 {
        if self.energy > 0.0 { (self.energy - self.direction.length_squared() / self.energy).max(0.0) } else { 0.0 }
    }

    fn light(&self) -> DirectionalLight {
        let direction = self.direction.try_normalize().unwrap_or(DVec3::Y).as_vec3();
        DirectionalLight { direction, irradiance: self.rgb.max(DVec3::ZERO).as_vec3() }
    }
}

/// Half-open rectangle of texels.
#[derive(Clone, Copy)]
struct Region {
    columns: [usize; 2],
    rows: [usize; 2],
}

/// A region with its best cut: the spread that the cut removes, and the two halves.
struct RegionCut {
    region: Region,
    gain: f64,
    halves: [Region; 2],
}

/// Returns at most `count` lights whose irradiances sum to `∫ L dω`; none for a black map.
pub fn split(map: &LatLongMap, count: usize) -> Vec<DirectionalLight> {
    let total = luminance(map.total());
    if count == 0 || map.texels.is_empty() || total <= 0.0 {
        return Vec::new();
    }
    let mut lights = Vec::with_capacity(count);
    let brightest = brightest_texels(map, total / count as f64, count);
    lights.extend(brightest.iter().map(|&(_, moments)| moments.light()));
    let sums = SummedMoments::new(map, &brightest.iter().map(|(texel, _)| *texel).collect::<Vec<_>>());
    let whole = Region { columns: [0, map.width], rows: [0, map.height] };
    if count == lights.len() || sums.over(whole).energy <= total * 1e-12 {
        return lights;
    }
    let mut regions = vec![sums.best_cut(whole)];
    while lights.len() + regions.len() < count {
        // The first of the largest, so that the result is deterministic.
        let Some(widest) = (0..regions.len()).reduce(|a, b| if regions[b].gain > regions[a].gain { b } else { a })
        else {
            break;
        };
        if regions[widest].gain <= total * 1e-12 {
            break;
        }
        let [one, other] = regions[widest].halves;
        regions[widest] = sums.best_cut(one);
        regions.push(sums.best_cut(other));
    }
    lights.extend(regions.iter().map(|cut| sums.over(cut.region).light()).filter(|l| l.irradiance != Vec3::ZERO));
    lights
}

/// Returns the texels that alone hold more energy than an average light. At least one light is left for the other
/// texels.
fn brightest_texels(map: &LatLongMap, average: f64, count: usize) -> Vec<(usize, EnergyMoments)> {
    let mut found = Vec::new();
    for (row, texels) in map.texels.chunks_exact(map.width).enumerate() {
        let solid_angle = map.solid_angle(row);
        for (column, texel) in texels.iter().enumerate() {
            let rgb = texel.as_dvec3() * solid_angle;
            if luminance(rgb) > average {
                let direction = map.direction(column as f64 + 0.5, row as f64 + 0.5);
                found.push((row * map.width + column, EnergyMoments::of(direction, rgb)));
            }
        }
    }
    found.sort_by(|a, b| b.1.energy.total_cmp(&a.1.energy).then(a.0.cmp(&b.0)));
    let whole = map.texels.len();
    found.truncate(if whole <= count { count } else { count - 1 });
    found
}

/// Summed-area table of energy moments, in f64.
struct SummedMoments {
    stride: usize,
    table: Vec<EnergyMoments>,
}

impl SummedMoments {
    fn new(map: &LatLongMap, excluded_texels: &[usize]) -> Self {
        let stride = map.width + 1;
        let mut is_excluded = vec![false; map.texels.len()];
        excluded_texels.iter().for_each(|&texel| is_excluded[texel] = true);
        let mut table = vec![EnergyMoments::default(); stride * (map.height + 1)];
        for row in 0..map.height {
            let solid_angle = map.solid_angle(row);
            let mut in_row = EnergyMoments::default();
            for column in 0..map.width {
                let texel = row * map.width + column;
                if !is_excluded[texel] {
                    let direction = map.direction(column as f64 + 0.5, row as f64 + 0.5);
                    in_row = in_row.plus(EnergyMoments::of(direction, map.texels[texel].as_dvec3() * solid_angle));
                }
                table[(row + 1) * stride + column + 1] = table[row * stride + column + 1].plus(in_row);
            }
        }
        Self { stride, table }
    }

    fn over(&self, region: Region) -> EnergyMoments {
        let [left, right] = region.columns;
        let [top, bottom] = region.rows;
        let at = |row: usize, column: usize| self.table[row * self.stride + column];
        at(bottom, right).minus(at(top, right)).minus(at(bottom, left)).plus(at(top, left))
    }

    fn best_cut(&self, region: Region) -> RegionCut {
        let spread = self.over(region).spread();
        let mut best = RegionCut { region, gain: 0.0, halves: [region; 2] };
        let mut consider = |one: Region, other: Region| {
            let gain = spread - self.over(one).spread() - self.over(other).spread();
            if gain > best.gain {
                best = RegionCut { region, gain, halves: [one, other] };
            }
        };
        for cut in region.columns[0] + 1..region.columns[1] {
            consider(
                Region { columns: [region.columns[0], cut], ..region },
                Region { columns: [cut, region.columns[1]], ..region },
            );
        }
        for cut in region.rows[0] + 1..region.rows[1] {
            consider(
                Region { rows: [region.rows[0], cut], ..region },
                Region { rows: [cut, region.rows[1]], ..region },
            );
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::lighting::environment::load;
    use std::path::Path;

    fn sum(lights: &[DirectionalLight]) -> DVec3 {
        lights.iter().map(|l| l.irradiance.as_dvec3()).sum()
    }

    #[test]
    fn energy_is_conserved_per_channel_for_any_count() {
        for name in ["studio", "clear_sky", "overcast_sky", "sun"] {
            let map = load(name, Path::new(".")).unwrap().map;
            for count in [1, 2, 7, 32, 200] {
                let lights = split(&map, count);
                assert!(lights.len() <= count, "{name} {count}");
                let relative = (sum(&lights) - map.total()).length() / map.total().length();
                assert!(relative < 1e-6, "{name} {count}: {relative}");
                assert!(lights.iter().all(|l| (l.direction.length() - 1.0).abs() < 1e-5));
            }
        }
    }

    #[test]
    fn a_single_pixel_sun_gets_its_own_light_with_its_exact_energy() {
        let mut map = LatLongMap::from_fn(128, 64, |d| DVec3::splat(0.3 + 0.2 * d.y));
        let (row, column) = (20, 77);
        map.texels[row * 128 + column] = Vec3::new(9e4, 8e4, 6e4);
        let lights = split(&map, 16);
        let direction = map.direction(77.5, 20.5).as_vec3();
        let suns: Vec<_> = lights.iter().filter(|l| l.direction.dot(direction) > 0.999_999).collect();
        assert_eq!(suns.len(), 1);
        let expected = DVec3::new(9e4, 8e4, 6e4) * map.solid_angle(row);
        assert!((suns[0].irradiance.as_dvec3() - expected).length() / expected.length() < 1e-6);
        assert_eq!(lights.len(), 16);
    }

    #[test]
    fn a_black_map_gives_no_lights_and_a_lone_texel_one() {
        assert!(split(&LatLongMap::from_fn(16, 8, |_| DVec3::ZERO), 32).is_empty());
        assert!(split(&LatLongMap::default(), 32).is_empty());
        let one = split(&LatLongMap::from_fn(1, 1, |_| DVec3::ONE), 32);
        assert_eq!(one.len(), 1);
        assert!((one[0].irradiance.x - 4.0 * std::f32::consts::PI).abs() < 1e-5);
    }

    #[test]
    fn irradiance_on_any_normal_approaches_the_integral_as_lights_are_added() {
        let map = load("studio", Path::new(".")).unwrap().map;
        let normals: Vec<_> = (0..60)
            .map(|k| {
                let (y, phi) = (1.0 - (f64::from(k) + 0.5) / 30.0, 2.399_963 * f64::from(k));
                let s = (1.0 - y * y).sqrt();
                DVec3::new(s * phi.cos(), y, s * phi.sin())
            })
            .collect();
        let exact: Vec<f64> = normals
            .iter()
            .map(|n| {
                let all = map.texels.iter().enumerate();
                all.map(|(k, t)| {
                    let (row, column) = (k / map.width, k % map.width);
                    let cosine = map.direction(column as f64 + 0.5, row as f64 + 0.5).dot(*n).max(0.0);
                    luminance(t.as_dvec3()) * cosine * map.solid_angle(row)
                })
                .sum()
            })
            .collect();
        let error = |count: usize| {
            let lights = split(&map, count);
            let of = |n: &DVec3| -> f64 {
                lights
                    .iter()
                    .map(|l| luminance(l.irradiance.as_dvec3()) * l.direction.as_dvec3().dot(*n).max(0.0))
                    .sum()
            };
            let square: f64 = normals.iter().zip(&exact).map(|(n, exact)| (of(n) - exact).powi(2)).sum();
            (square / exact.iter().map(|e| e * e).sum::<f64>()).sqrt()
        };
        let errors = [8, 32, 128].map(error);
        eprintln!("studio: relative irradiance error with 8, 32, 128 lights: {errors:?}");
        assert!(errors[0] < 0.15 && errors[1] < 0.05 && errors[2] < 0.02, "{errors:?}");
    }
}
