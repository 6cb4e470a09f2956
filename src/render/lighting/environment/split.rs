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
#[path = "split_tests.rs"]
mod tests;
