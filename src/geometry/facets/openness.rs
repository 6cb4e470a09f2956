//! Openness: how much of the hemisphere each part of the surface sees. Facets are dense where the surface is open,
//! because closed parts reflect little.

use std::f32::consts::TAU;

use glam::Vec3;
use rayon::prelude::*;

use super::{FacetSampler, Facets, REPLICATES, SampleShift};
use crate::geometry::{PeriodicGrid, TileMesh, is_facet_visible};

/// Facets and directions whose visibility is tested. They bound the time of the measurement, which is part of the stage
/// `facets` of `biscale profile --edit geometry`; the grid and its hierarchy are the stages `cells` and `hierarchy`.
const TESTED_FACETS: usize = 256;
const TESTED_DIRECTIONS: usize = 12;
/// Intervals of height, and classes of normals: up, sideways and down.
const HEIGHTS: usize = 8;
const TILTS: usize = 3;
const BINS: usize = HEIGHTS * TILTS;
/// Smallest openness in multiples of the mean, so that no part of the surface is left out.
const MIN_OPENNESS: f64 = 0.2;
/// Candidates per facet. A part of the surface gets at most so many times its share of the facets by area.
const CANDIDATES: usize = 4;

/// Mean openness by material slot, height and tilt. The openness of a facet is the mean of `V (n·ω)²` over the directions
/// of the hemisphere: its reflection is weighted by visibility and cosine of both directions.
#[derive(Debug, Clone)]
pub(crate) struct Openness {
    low: f32,
    height: f32,
    /// One value per slot and bin.
    values: Vec<f64>,
}

impl Openness {
    /// Measures the openness with rays from a few facets.
    pub fn measure(sampler: &FacetSampler, mesh: &TileMesh, grid: &PeriodicGrid) -> Self {
        let facets = sampler.sample(mesh, TESTED_FACETS, SampleShift::from_seed(0));
        grid.prepare_rays();
        let directions: Vec<Vec3> = (0..TESTED_DIRECTIONS).map(direction).collect();
        let seen = |facet: usize| {
            let normal = facets.normals[facet];
            let visible = |to: &&Vec3| is_facet_visible(grid, &facets, facet, **to);
            directions.iter().filter(visible).map(|to| f64::from(normal.dot(*to).powi(2))).sum::<f64>()
        };
        let seen: Vec<f64> = (0..facets.len()).into_par_iter().map(seen).collect();
        let mean = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        let (low, high) = mesh.z_range();
        let mut openness = Self { low, height: high - low, values: vec![0.0; mesh.slots.len().max(1) * BINS] };
        // Bins with few facets are close to the mean: half a facet of the mean openness is added to each.
        let mut sums = vec![(0.5 * mean, 0.5); openness.values.len()];
        for (facet, seen) in seen.into_iter().enumerate() {
            let (sum, count) = &mut sums[openness.bin(&facets, facet)];
            *sum += seen;
            *count += 1.0;
        }
        openness.values = sums.into_iter().map(|(sum, count)| (sum / count).max(MIN_OPENNESS * mean)).collect();
        openness
    }

    /// The openness of the part of the surface that holds a facet, above 0.
    pub fn of(&self, facets: &Facets, facet: usize) -> f64 {
        let openness = self.values[self.bin(facets, facet)];
        // All values are 0 if no tested facet is visible.
        if openness > 0.0 { openness } else { 1.0 }
    }

    fn bin(&self, facets: &Facets, facet: usize) -> usize {
        let (position, normal) = (facets.positions[facet], facets.normals[facet]);
        let height = ((position.z - self.low) / self.height.max(f32::MIN_POSITIVE) * HEIGHTS as f32) as usize;
        let tilt = usize::from(normal.z > -0.1) + usize::from(normal.z > 0.5);
        (usize::from(facets.slots[facet]) * TILTS + tilt) * HEIGHTS + height.min(HEIGHTS - 1)
    }
}

/// Direction k of the tested ones: cosines are evenly spread above 0.08, azimuths by the golden ratio.
fn direction(k: usize) -> Vec3 {
    const MIN_COSINE: f32 = 0.08;
    const GOLDEN: f32 = 0.618_034;
    let z = 1.0 - (1.0 - MIN_COSINE) * (k as f32 + 0.5) / TESTED_DIRECTIONS as f32;
    let (sin, cos) = (TAU * (k as f32 * GOLDEN).fract()).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// Candidates of equal area and openness, in the order of the sampler.
struct Group {
    candidates: Vec<usize>,
    openness: f64,
}

impl FacetSampler {
    /// Takes samples as [`FacetSampler::sample`], but in proportion to openness as well as to area. The areas of the facets
    /// keep the sum unbiased: facets of one group share the area of all its candidates.
    pub(crate) fn sample_by_openness(
        &self,
        mesh: &TileMesh,
        count: usize,
        shift: SampleShift,
        openness: &Openness,
    ) -> Facets {
        let candidates = self.sample(mesh, CANDIDATES * count, shift);
        let groups = groups(&candidates, openness);
        if groups.len() > count {
            return self.sample(mesh, count, shift);
        }
        let (mut indices, mut areas) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (group, count) in groups.iter().zip(shares(&groups, count)) {
            let members = &group.candidates;
            let area = f64::from(candidates.areas[members[0]]) * members.len() as f64 / count as f64;
            let step = members.len() as f64 / count as f64;
            let member = |k: usize| ((k as f64 + f64::from(shift.along)) * step) as usize;
            indices.extend((0..count).map(|k| members[member(k).min(members.len() - 1)]));
            areas.extend(std::iter::repeat_n(area as f32, count));
        }
        let mut facets = candidates.subset(&indices);
        facets.areas = areas;
        facets.replicates = (0..facets.len()).map(|facet| (facet % REPLICATES) as u8).collect();
        facets
    }
}

/// Groups candidates by stratum and bin. Candidates of one stratum follow each other and have one area.
fn groups(candidates: &Facets, openness: &Openness) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut start = 0;
    for stratum in candidates.areas.chunk_by(|a, b| a.to_bits() == b.to_bits()) {
        let mut bins = vec![Vec::new(); openness.values.len()];
        (start..start + stratum.len()).for_each(|facet| bins[openness.bin(candidates, facet)].push(facet));
        let filled = bins.into_iter().zip(&openness.values).filter(|(candidates, _)| !candidates.is_empty());
        groups.extend(filled.map(|(candidates, &openness)| Group { candidates, openness }));
        start += stratum.len();
    }
    groups
}

/// Divides `count` facets among groups in proportion to candidates times openness. Each group gets at least one facet, and
/// at most all of its candidates.
fn shares(groups: &[Group], count: usize) -> Vec<usize> {
    let wanted = |group: &Group, scale: f64| {
        let most = group.candidates.len() as f64;
        (most * group.openness * scale).clamp(1.0, most)
    };
    let total = |scale: f64| groups.iter().map(|group| wanted(group, scale)).sum::<f64>();
    let largest = groups.iter().map(|group| group.openness.recip()).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, largest);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if total(middle) < count as f64 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let (mut sum, mut given) = (0.0, 0);
    let share = |group: &Group| {
        sum += wanted(group, high);
        let upto = (sum + 1e-6).round() as usize;
        let share = (upto - given).clamp(1, group.candidates.len());
        given += share;
        share
    };
    groups.iter().map(share).collect()
}

#[cfg(test)]
#[path = "openness_tests.rs"]
mod tests;
