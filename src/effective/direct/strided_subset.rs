//! A live sum over part of its facets, for tiles of few normals: pictures ask millions of times, and there every facet of a
//! normal shares one lobe, so that few of them tell the visible area well.

use std::sync::Arc;

use super::facet_groups::NormalCluster;
use crate::effective::{Direct, FacetSum};
use crate::visibility::Visibility;

/// Facets that a normal keeps at least.
const MIN: usize = 16;

impl Direct {
    /// Every `step`-th facet of each normal, weighted to the same area; `None` where normals are many or visibility is not held
    /// as horizons.
    pub fn strided_subset(&self, step: usize) -> Option<Self> {
        let Visibility::HorizonMap(horizons) = &*self.visibility else { return None };
        let (sum, kept) = self.sum.has_few_normals().then(|| self.sum.strided_subset(step))??;
        Some(Self::new(Arc::new(sum), Arc::new(Visibility::HorizonMap(horizons.picked(&kept)))))
    }
}

impl FacetSum {
    /// Every `step`-th facet of each normal, weighted to the same area, and the places of those. `None` if a group that reflects
    /// has many normals.
    pub(crate) fn strided_subset(&self, step: usize) -> Option<(Self, Vec<usize>)> {
        let (mut kept, mut areas, mut groups) = (Vec::new(), Vec::new(), Vec::new());
        for group in self.groups() {
            let first = kept.len();
            let whole = [NormalCluster { range: group.range.clone(), normal: glam::Vec3::Z }];
            let mut patches = Vec::new();
            for patch in group.patches.as_deref().unwrap_or(&whole) {
                let (start, range) = (kept.len(), patch.range.clone());
                let step = step.min(range.len() / MIN).max(1);
                kept.extend(range.clone().skip(step / 2).step_by(step));
                let area = |places: &mut dyn Iterator<Item = usize>| -> f64 {
                    places.map(|s| f64::from(self.facet(s).1)).sum()
                };
                let scale = area(&mut range.clone()) / area(&mut kept[start..].iter().copied()).max(f64::MIN_POSITIVE);
                areas.extend(kept[start..].iter().map(|&s| (f64::from(self.facet(s).1) * scale) as f32));
                patches.push(NormalCluster { range: start..kept.len(), normal: patch.normal });
            }
            groups.push(group.over(first..kept.len(), patches)?);
        }
        let normals = [0, 1, 2].map(|axis| kept.iter().map(|&s| self.facet(s).0[axis]).collect());
        Some((self.over(normals, areas, groups), kept))
    }
}
