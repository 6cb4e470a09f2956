//! Facets of a sum, grouped by material, and runs of one normal within a group.

use std::ops::Range;

use glam::Vec3;

use crate::brdf::{LobeAngles, Measured, Term};
use crate::geometry::{Facets, SAME_NORMAL};
use crate::math::simd::{Lobe, PairVectors};

/// A run of facets with one material.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub(crate) range: Range<usize>,
    pub(crate) color: Vec3,
    pub(crate) is_black: bool,
    pub(crate) lobes: Vec<(Lobe, Term)>,
    pub(crate) measured: Vec<std::sync::Arc<dyn Measured>>,
    /// Areas times colour weights, where those differ between the facets of the group.
    pub(crate) rgb_areas: Option<[Vec<f32>; 3]>,
    /// Runs of facets with one normal, where there are few of them.
    pub(crate) patches: Option<Vec<NormalCluster>>,
}

/// A run of facets with one normal.
#[derive(Debug, Clone)]
pub(crate) struct NormalCluster {
    pub(crate) range: Range<usize>,
    pub(crate) normal: Vec3,
}

/// A run must be this long on average for one lobe a run to pay.
const FACETS_A_PATCH: usize = 8;

impl Group {
    /// The same materials over other facets; `None` where they have colours of their own, or normals that matter.
    pub(crate) fn over(&self, range: Range<usize>, patches: Vec<NormalCluster>) -> Option<Self> {
        (self.is_black || self.rgb_areas.is_none() && self.patches.is_some()).then(|| Self {
            range,
            rgb_areas: None,
            patches: self.patches.is_some().then_some(patches),
            ..self.clone()
        })
    }

    pub(crate) fn new(facets: &Facets, range: Range<usize>) -> Self {
        let colors = &facets.colors[range.clone()];
        let uniform = colors.iter().all(|&color| color == Vec3::ONE);
        let rgb_areas = (!uniform).then(|| rgb_areas(facets, range.clone()));
        let patches = patches(facets, range.clone());
        let few = patches.len() * FACETS_A_PATCH <= range.len();
        Self {
            range,
            color: Vec3::ONE,
            is_black: false,
            lobes: Vec::new(),
            measured: Vec::new(),
            rgb_areas,
            patches: few.then_some(patches),
        }
    }
}

/// What facets of one normal reflect; `None` where it faces away.
pub(crate) fn patch_value(group: &Group, patch: &NormalCluster, pair: &PairVectors) -> Option<Vec3> {
    let angles = LobeAngles::new(patch.normal, pair.i, pair.o, pair.h);
    if angles.n_dot_i <= 0.0 || angles.n_dot_o <= 0.0 {
        return None;
    }
    let mut value = Vec3::ZERO;
    for (_, term) in &group.lobes {
        value += term.tint(pair.i_dot_h) * term.lobe_cos(&angles);
    }
    for table in &group.measured {
        value += table.f_r(&angles) * (angles.n_dot_i * angles.n_dot_o);
    }
    Some(value)
}

/// Areas times colour weights.
pub(crate) fn rgb_areas(facets: &Facets, range: Range<usize>) -> [Vec<f32>; 3] {
    let pairs = || facets.colors[range.clone()].iter().zip(&facets.areas[range.clone()]);
    std::array::from_fn(|c| pairs().map(|(color, area)| color[c] * area).collect())
}

/// Runs of facets with one normal.
pub(crate) fn patches(facets: &Facets, range: Range<usize>) -> Vec<NormalCluster> {
    let mut patches: Vec<NormalCluster> = Vec::new();
    for s in range {
        let normal = facets.normals[s];
        match patches.last_mut() {
            Some(patch) if (patch.normal - normal).abs().max_element() < SAME_NORMAL => patch.range.end = s + 1,
            _ => patches.push(NormalCluster { range: s..s + 1, normal }),
        }
    }
    patches
}
