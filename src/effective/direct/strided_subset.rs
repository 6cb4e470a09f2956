//! A sum over every n-th facet of each normal cluster, for rendering tiles with few distinct normals. The facets of a
//! cluster share one lobe, so a subset of them estimates the visible area well.

use std::sync::Arc;

use super::facet_groups::NormalCluster;
use crate::effective::{Direct, FacetSum};
use crate::visibility::Visibility;

/// Smallest number of facets per cluster in a subset.
const MIN: usize = 16;

impl Direct {
    /// Takes every `step`-th facet of each normal cluster, weighted to the cluster's area. `None` if a reflecting group
    /// has no clusters or visibility is not a horizon map.
    pub fn strided_subset(&self, step: usize) -> Option<Self> {
        let Visibility::HorizonMap(horizon_map) = &*self.visibility else { return None };
        let (sum, subset) = self.sum.supports_clustered_sum().then(|| self.sum.strided_subset(step))??;
        Some(Self::new(Arc::new(sum), Arc::new(Visibility::HorizonMap(horizon_map.subset(&subset)))))
    }
}

impl FacetSum {
    /// Takes every `step`-th facet of each normal cluster, weighted to the cluster's area, and returns the sum over
    /// them and their indices. `None` if a reflecting group has no clusters.
    pub(crate) fn strided_subset(&self, step: usize) -> Option<(Self, Vec<usize>)> {
        let (mut subset, mut areas, mut groups) = (Vec::new(), Vec::new(), Vec::new());
        for group in self.groups() {
            let first = subset.len();
            let whole = [NormalCluster { range: group.range.clone(), normal: glam::Vec3::Z }];
            let mut clusters = Vec::new();
            for cluster in group.clusters.as_deref().unwrap_or(&whole) {
                let (start, range) = (subset.len(), cluster.range.clone());
                let step = step.min(range.len() / MIN).max(1);
                subset.extend(range.clone().skip(step / 2).step_by(step));
                let area = |facets: &mut dyn Iterator<Item = usize>| -> f64 {
                    facets.map(|s| f64::from(self.facet(s).1)).sum()
                };
                let scale =
                    area(&mut range.clone()) / area(&mut subset[start..].iter().copied()).max(f64::MIN_POSITIVE);
                areas.extend(subset[start..].iter().map(|&s| (f64::from(self.facet(s).1) * scale) as f32));
                clusters.push(NormalCluster { range: start..subset.len(), normal: cluster.normal });
            }
            groups.push(group.over(first..subset.len(), clusters)?);
        }
        let normals = [0, 1, 2].map(|axis| subset.iter().map(|&s| self.facet(s).0[axis]).collect());
        Some((self.over(normals, areas, groups), subset))
    }
}
