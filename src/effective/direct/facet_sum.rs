//! The sum over facets, `Σ_s ΔA_s V_s(i) V_s(o) f(n_s, i, o)` (Wu et al. 2011, Eq. 5 and 10). Analytic lobes run over
//! contiguous normals, all facets that share a normal share one lobe, and tints are applied outside the loop.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::facet_groups::{FacetGroup, NormalCluster, cluster_value, normal_clusters, rgb_areas};
use crate::brdf::{LobeAngles, Material, Measured, Term, analytic_lobe};
use crate::geometry::Facets;
use crate::math::simd;
use crate::math::simd::{Lobe, PairVectors};

/// Facets grouped by slot, in arrays that the inner loops read.
#[derive(Debug, Clone)]
pub struct FacetSum {
    normals: [Vec<f32>; 3],
    areas: Vec<f32>,
    groups: Vec<FacetGroup>,
    /// True if groups of black materials are summed, too.
    sums_black_groups: bool,
}

impl FacetSum {
    /// Makes a sum. Facets must be sorted by slot ([`Facets::sort_for_sums`]); `material_of_slot[slot]` indexes
    /// `materials`.
    pub fn new(facets: &Facets, material_of_slot: &[usize], materials: &[Material]) -> Self {
        let component = |pick: fn(&Vec3) -> f32| facets.normals.iter().map(pick).collect();
        let mut sum = Self {
            normals: [component(|n| n.x), component(|n| n.y), component(|n| n.z)],
            areas: facets.areas.clone(),
            groups: Vec::new(),
            sums_black_groups: false,
        };
        let mut start = 0;
        while start < facets.len() {
            let slot = facets.slots[start];
            let end = start + facets.slots[start..].iter().take_while(|&&other| other == slot).count();
            sum.groups.push(FacetGroup::new(facets, start..end));
            start = end;
        }
        sum.set_materials(facets, material_of_slot, materials);
        sum
    }

    fn set_materials(&mut self, facets: &Facets, material_of_slot: &[usize], materials: &[Material]) {
        for group in &mut self.groups {
            let material = &materials[material_of_slot[usize::from(facets.slots[group.range.start])]];
            group.color = material.color;
            group.is_black = material.is_black();
            group.lobes = material
                .brdf
                .terms
                .iter()
                .filter_map(|term| analytic_lobe(term).map(|lobe| (lobe, term.clone())))
                .collect();
            group.measured = material
                .brdf
                .terms
                .iter()
                .filter_map(|term| if let Term::Measured(table) = term { Some(table.clone()) } else { None })
                .collect();
        }
    }

    pub fn facet_count(&self) -> usize {
        self.areas.len()
    }

    /// Sets whether groups of black materials are summed, too.
    pub(crate) fn sum_black_groups(&mut self, enabled: bool) {
        self.sums_black_groups = enabled;
    }

    /// Evaluates one lobe per facet.
    pub(crate) fn clear_clusters(&mut self) {
        self.groups.iter_mut().for_each(|group| group.clusters = None);
    }

    /// Evaluates one lobe per normal cluster, regardless of the number of clusters.
    pub(crate) fn group_by_normal(&mut self, facets: &Facets) {
        for group in &mut self.groups {
            group.clusters = Some(normal_clusters(facets, group.range.clone()));
        }
    }

    /// Sums each colour channel with its own weights.
    pub(crate) fn sum_each_channel(&mut self, facets: &Facets) {
        for group in &mut self.groups {
            group.rgb_areas = Some(rgb_areas(facets, group.range.clone()));
        }
    }

    /// Visible projected area `a_v(d)` for the visibility `v` along `d` (Eq. 10).
    pub fn projected_area(&self, v: &[f32], d: Vec3) -> f64 {
        simd::projected_area(self.normals(0..self.areas.len()), &self.areas, v, d)
    }

    /// `Σ_s ΔA_s V_s(i) V_s(o) f(n_s, i, o)`, from the visibilities along `i` and `o`.
    pub fn sum(&self, i: Vec3, o: Vec3, v_i: &[f32], v_o: &[f32]) -> DVec3 {
        let pair = PairVectors::new(i, o);
        let mut total = DVec3::ZERO;
        for group in &self.groups {
            if self.sums_black_groups || !group.is_black {
                total += group.color.as_dvec3() * self.group_sum(group, &pair, v_i, v_o);
            }
        }
        total
    }

    /// Number of analytic lobes that one query evaluates, for the cost model: one per term and facet, or per term and
    /// cluster.
    pub fn lobe_count(&self) -> usize {
        self.groups
            .iter()
            .map(|group| group.clusters.as_ref().map_or(group.range.len(), Vec::len) * group.lobes.len().max(1))
            .sum()
    }

    /// Number of measured values that one query reads, for the cost model: one per measured term and facet or cluster.
    pub fn measured_count(&self) -> usize {
        self.groups
            .iter()
            .map(|group| group.clusters.as_ref().map_or(group.range.len(), Vec::len) * group.measured.len())
            .sum()
    }

    /// Returns true if colour weights differ between facets of one slot.
    pub fn colors_vary(&self) -> bool {
        self.groups.iter().any(|group| group.rgb_areas.is_some())
    }

    /// Number of normal clusters; `None` if a group has none.
    pub fn normal_count(&self) -> Option<usize> {
        self.groups.iter().map(|group| group.clusters.as_ref().map(Vec::len)).sum()
    }

    /// The groups of facets, for the GPU's twin of the sum.
    pub(crate) fn groups(&self) -> &[FacetGroup] {
        &self.groups
    }

    /// Normal and area of a facet.
    pub(crate) fn facet(&self, s: usize) -> (Vec3, f32) {
        (Vec3::new(self.normals[0][s], self.normals[1][s], self.normals[2][s]), self.areas[s])
    }

    pub(crate) fn areas(&self, range: Range<usize>) -> &[f32] {
        &self.areas[range]
    }

    pub(crate) fn normals(&self, range: Range<usize>) -> [&[f32]; 3] {
        [&self.normals[0][range.clone()], &self.normals[1][range.clone()], &self.normals[2][range]]
    }

    /// The sum of one measured BRDF over a group's facets, each channel with its own colour weights. `v_i` and `v_o`
    /// are the visibilities of all facets.
    pub(crate) fn measured_sum(
        &self,
        group: &FacetGroup,
        table: &dyn Measured,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
    ) -> DVec3 {
        const MAX: usize = 64;
        let mut angles = Vec::with_capacity(MAX);
        let mut weights = Vec::with_capacity(MAX);
        let mut values = [Vec3::ZERO; MAX];
        let mut total = DVec3::ZERO;
        let Range { start, end } = group.range;
        for first in (start..end).step_by(MAX) {
            angles.clear();
            weights.clear();
            for s in first..(first + MAX).min(end) {
                let visible = v_i[s] * v_o[s];
                if visible <= 0.0 {
                    continue;
                }
                let facet = LobeAngles::new(self.facet(s).0, pair.i, pair.o, pair.h);
                if facet.n_dot_i > 0.0 && facet.n_dot_o > 0.0 {
                    let weight = match &group.rgb_areas {
                        None => Vec3::splat(self.areas[s]),
                        Some([r, g, b]) => Vec3::new(r[s - start], g[s - start], b[s - start]),
                    };
                    weights.push(weight * (facet.n_dot_i * facet.n_dot_o * visible));
                    angles.push(facet);
                }
            }
            table.f_r_many(&angles, &mut values);
            total += values.iter().zip(&weights).map(|(value, weight)| (*value * *weight).as_dvec3()).sum::<DVec3>();
        }
        total
    }

    fn group_sum(&self, group: &FacetGroup, pair: &PairVectors, v_i: &[f32], v_o: &[f32]) -> DVec3 {
        if let Some(clusters) = &group.clusters {
            return clusters.iter().map(|cluster| self.cluster_sum(group, cluster, pair, v_i, v_o)).sum();
        }
        let mut total = DVec3::ZERO;
        for (lobe, term) in &group.lobes {
            total += term.tint(pair.i_dot_h).as_dvec3() * self.lobe_sum(group, *lobe, pair, v_i, v_o);
        }
        for table in &group.measured {
            total += self.measured_sum(group, table.as_ref(), pair, v_i, v_o);
        }
        total
    }

    fn cluster_sum(
        &self,
        group: &FacetGroup,
        cluster: &NormalCluster,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
    ) -> DVec3 {
        let Some(value) = cluster_value(group, cluster, pair) else { return DVec3::ZERO };
        self.visible_area(group, cluster, v_i, v_o) * value.as_dvec3()
    }

    /// The sum of one lobe over a group's facets, without its tint and the group's colour: by channel where the colour weights
    /// of facets differ, else three times the same. `v_i` and `v_o` are the visibilities of all facets.
    pub(crate) fn lobe_sum(
        &self,
        group: &FacetGroup,
        lobe: Lobe,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
    ) -> DVec3 {
        let range = group.range.clone();
        let (v_i, v_o) = (&v_i[range.clone()], &v_o[range.clone()]);
        let normals = self.normals(range.clone());
        match &group.rgb_areas {
            None => DVec3::splat(simd::lobe_sums(lobe, pair, normals, [&self.areas[range]], v_i, v_o)[0]),
            Some([r, g, b]) => DVec3::from_array(simd::lobe_sums(lobe, pair, normals, [r, g, b], v_i, v_o)),
        }
    }

    /// The area of one normal cluster that is visible from both directions, by channel as in [`FacetSum::lobe_sum`].
    pub(crate) fn visible_area(&self, group: &FacetGroup, cluster: &NormalCluster, v_i: &[f32], v_o: &[f32]) -> DVec3 {
        let range = cluster.range.clone();
        let (v_i, v_o) = (&v_i[range.clone()], &v_o[range.clone()]);
        match &group.rgb_areas {
            None => DVec3::splat(simd::masked_sum([&self.areas[range]], v_i, v_o)[0]),
            Some(rgb) => {
                let inside = range.start - group.range.start..range.end - group.range.start;
                let [r, g, b] = rgb.each_ref().map(|areas| &areas[inside.clone()]);
                DVec3::from_array(simd::masked_sum([r, g, b], v_i, v_o))
            }
        }
    }

    /// Number of normal clusters of the reflecting groups; `None` if one of these groups has none.
    pub(crate) fn reflecting_normal_count(&self) -> Option<usize> {
        let reflecting = self.groups.iter().filter(|group| !group.is_black);
        reflecting.map(|group| group.clusters.as_ref().map(Vec::len)).sum()
    }

    /// Returns true if every reflecting group has normal clusters and uniform colour weights, as a clustered sum
    /// requires.
    pub(crate) fn supports_clustered_sum(&self) -> bool {
        let is_clustered = |group: &FacetGroup| group.clusters.is_some() && group.rgb_areas.is_none();
        self.groups.iter().all(|group| group.is_black || is_clustered(group))
    }

    /// A sum over other facets with the same materials.
    pub(crate) fn over(&self, normals: [Vec<f32>; 3], areas: Vec<f32>, groups: Vec<FacetGroup>) -> Self {
        Self { normals, areas, groups, sums_black_groups: self.sums_black_groups }
    }
}
