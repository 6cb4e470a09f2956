//! Facets of a sum, grouped by slot, and normal clusters within a group.

use std::ops::Range;

use glam::Vec3;

use crate::brdf::{LobeAngles, Measured, Term};
use crate::geometry::{Facets, SAME_NORMAL};
use crate::math::simd::{Lobe, PairVectors};

/// Consecutive facets of one slot, which share a material.
#[derive(Debug, Clone)]
pub(crate) struct FacetGroup {
    pub(crate) range: Range<usize>,
    pub(crate) color: Vec3,
    pub(crate) is_black: bool,
    pub(crate) lobes: Vec<(Lobe, Term)>,
    pub(crate) measured: Vec<std::sync::Arc<dyn Measured>>,
    /// Areas times colour weights, if colour weights differ between the facets of the group.
    pub(crate) rgb_areas: Option<[Vec<f32>; 3]>,
    /// Normal clusters; `None` if each facet has a lobe of its own.
    pub(crate) clusters: Option<Vec<NormalCluster>>,
}

/// Consecutive facets that share a normal.
#[derive(Debug, Clone)]
pub(crate) struct NormalCluster {
    pub(crate) range: Range<usize>,
    pub(crate) normal: Vec3,
}

/// Smallest mean number of facets per cluster at which one lobe per cluster pays. A loop over fewer facets takes as long as
/// one over this number, so that a single cluster always pays.
const FACETS_PER_CLUSTER: usize = 8;

impl FacetGroup {
    /// Returns the group's materials over other facets; `None` if the group has colour weights or reflects without
    /// clusters.
    pub(crate) fn over(&self, range: Range<usize>, clusters: Vec<NormalCluster>) -> Option<Self> {
        (self.is_black || self.rgb_areas.is_none() && self.clusters.is_some()).then(|| Self {
            range,
            rgb_areas: None,
            clusters: self.clusters.is_some().then_some(clusters),
            ..self.clone()
        })
    }

    pub(crate) fn new(facets: &Facets, range: Range<usize>) -> Self {
        let colors = &facets.colors[range.clone()];
        let uniform = colors.iter().all(|&color| color == Vec3::ONE);
        let rgb_areas = (!uniform).then(|| rgb_areas(facets, range.clone()));
        let clusters = normal_clusters(facets, range.clone());
        let is_clustered = clusters.len() * FACETS_PER_CLUSTER <= range.len().max(FACETS_PER_CLUSTER);
        Self {
            range,
            color: Vec3::ONE,
            is_black: false,
            lobes: Vec::new(),
            measured: Vec::new(),
            rgb_areas,
            clusters: is_clustered.then_some(clusters),
        }
    }
}

/// The value of all lobes of a group at the normal of a cluster; `None` if the normal faces away from light or view.
pub(crate) fn cluster_value(group: &FacetGroup, cluster: &NormalCluster, pair: &PairVectors) -> Option<Vec3> {
    let angles = LobeAngles::new(cluster.normal, pair.i, pair.o, pair.h);
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

/// Areas times colour weights, one array per channel.
pub(crate) fn rgb_areas(facets: &Facets, range: Range<usize>) -> [Vec<f32>; 3] {
    let pairs = || facets.colors[range.clone()].iter().zip(&facets.areas[range.clone()]);
    std::array::from_fn(|c| pairs().map(|(color, area)| color[c] * area).collect())
}

/// Divides facets into runs that share a normal.
pub(crate) fn normal_clusters(facets: &Facets, range: Range<usize>) -> Vec<NormalCluster> {
    let mut clusters: Vec<NormalCluster> = Vec::new();
    for s in range {
        let normal = facets.normals[s];
        match clusters.last_mut() {
            Some(cluster) if (cluster.normal - normal).abs().max_element() < SAME_NORMAL => {
                cluster.range.end = s + 1;
            }
            _ => clusters.push(NormalCluster { range: s..s + 1, normal }),
        }
    }
    clusters
}
