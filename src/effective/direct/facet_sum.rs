//! The plain sum over facets, `Σ_s ΔA_s V_s(i) V_s(o) f(n_s, i, o)` (Wu et al. 2011, Eq. 5 and 10), made fast:
//! analytic lobes over contiguous normals, one lobe for all facets that share a normal, tints outside the loop.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::facet_groups::{NormalCluster, patch_value, patches, rgb_areas};
use crate::brdf::{Brdf, LobeAngles, Measured, Term};
use crate::cache::KeyBuilder;
use crate::effective::Group;
use crate::geometry::Facets;
use crate::math::simd;
use crate::math::simd::{Lobe, PairVectors};

/// A material as the sum sees it.
#[derive(Debug, Clone)]
pub struct Material {
    pub brdf: Brdf,
    /// Multiplies the sum of the terms.
    pub color: Vec3,
}

/// A term that reflects nothing, whatever the angles.
fn is_zero(term: &Term) -> bool {
    // A tint is a line in (1 - i·h)⁵.
    !matches!(term, Term::Measured(_)) && term.tint(0.0) == Vec3::ZERO && term.tint(1.0) == Vec3::ZERO
}

impl Material {
    /// Does it reflect nothing?
    pub fn is_black(&self) -> bool {
        self.color == Vec3::ZERO || self.brdf.terms.iter().all(is_zero)
    }

    /// Do two materials differ in nothing but their colour?
    pub fn same_brdf(&self, other: &Self) -> bool {
        // A tint is a line in (1 - i·h)⁵: two points tell it.
        let tints = |material: &Self| -> Vec<[Vec3; 2]> {
            material.brdf.terms.iter().map(|term| [0.0, 1.0].map(|i_dot_h| term.tint(i_dot_h))).collect()
        };
        self.same_lobes(other) && tints(self) == tints(other)
    }

    /// Do two materials differ in nothing but colours and tints? Then what was factored for one serves the other.
    pub fn same_lobes(&self, other: &Self) -> bool {
        let same = |a: &Term, b: &Term| match (a, b) {
            (Term::Measured(a), Term::Measured(b)) => std::sync::Arc::ptr_eq(a, b),
            _ => analytic_lobe(a).is_some_and(|lobe| Some(lobe) == analytic_lobe(b)),
        };
        let (a, b) = (&self.brdf.terms, &other.brdf.terms);
        self.is_black() == other.is_black() && a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
    }
}

/// Facets grouped by material, in arrays that the inner loops walk.
#[derive(Debug, Clone)]
pub struct FacetSum {
    normals: [Vec<f32>; 3],
    areas: Vec<f32>,
    groups: Vec<Group>,
    /// Black materials are summed too.
    keep_black: bool,
}

impl FacetSum {
    /// Facets must be sorted by slot ([`Facets::sort_for_sums`]); `material_of_slot[slot]` indexes `materials`.
    pub fn new(facets: &Facets, material_of_slot: &[usize], materials: &[Material]) -> Self {
        let component = |pick: fn(&Vec3) -> f32| facets.normals.iter().map(pick).collect();
        let mut sum = Self {
            normals: [component(|n| n.x), component(|n| n.y), component(|n| n.z)],
            areas: facets.areas.clone(),
            groups: Vec::new(),
            keep_black: false,
        };
        let mut start = 0;
        while start < facets.len() {
            let slot = facets.slots[start];
            let end = start + facets.slots[start..].iter().take_while(|&&other| other == slot).count();
            sum.groups.push(Group::new(facets, start..end));
            start = end;
        }
        sum.set_materials(facets, material_of_slot, materials);
        sum
    }

    /// Swaps the materials and keeps the facets: all that an edit of a BRDF or a colour costs.
    pub fn set_materials(&mut self, facets: &Facets, material_of_slot: &[usize], materials: &[Material]) {
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

    pub(crate) fn keep_black(&mut self, keep: bool) {
        self.keep_black = keep;
    }

    pub(crate) fn one_lobe_a_facet(&mut self) {
        self.groups.iter_mut().for_each(|group| group.patches = None);
    }

    /// One lobe a normal, however many there are.
    pub(crate) fn group_by_normal(&mut self, facets: &Facets) {
        for group in &mut self.groups {
            group.patches = Some(patches(facets, group.range.clone()));
        }
    }

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
            let black = !self.keep_black && group.is_black;
            if !black {
                total += group.color.as_dvec3() * self.group_sum(group, &pair, v_i, v_o);
            }
        }
        total
    }

    /// Analytic terms that an evaluation touches, for the cost model: lobes times facets, and patches count once.
    pub fn lobe_count(&self) -> usize {
        self.groups
            .iter()
            .map(|group| group.patches.as_ref().map_or(group.range.len(), Vec::len) * group.lobes.len().max(1))
            .sum()
    }

    /// Facets that carry a measured BRDF.
    pub fn measured_count(&self) -> usize {
        self.groups
            .iter()
            .map(|group| group.patches.as_ref().map_or(group.range.len(), Vec::len) * group.measured.len())
            .sum()
    }

    /// Do colour weights differ between facets of one material?
    pub fn colors_vary(&self) -> bool {
        self.groups.iter().any(|group| group.rgb_areas.is_some())
    }

    /// Number of distinct normals, where they are few enough for one lobe each.
    pub fn patch_count(&self) -> Option<usize> {
        self.groups.iter().map(|group| group.patches.as_ref().map(Vec::len)).sum()
    }

    /// The runs of facets, for twins of the sum on other devices.
    pub(crate) fn groups(&self) -> &[Group] {
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

    /// One measured BRDF over a group's facets, each channel with its own colour weights. Visibilities are those of all facets.
    pub(crate) fn measured_sum(
        &self,
        group: &Group,
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
                let seen = v_i[s] * v_o[s];
                if seen <= 0.0 {
                    continue;
                }
                let facet = LobeAngles::new(self.facet(s).0, pair.i, pair.o, pair.h);
                if facet.n_dot_i > 0.0 && facet.n_dot_o > 0.0 {
                    let weight = match &group.rgb_areas {
                        None => Vec3::splat(self.areas[s]),
                        Some([r, g, b]) => Vec3::new(r[s - start], g[s - start], b[s - start]),
                    };
                    weights.push(weight * (facet.n_dot_i * facet.n_dot_o * seen));
                    angles.push(facet);
                }
            }
            table.f_r_many(&angles, &mut values);
            total += values.iter().zip(&weights).map(|(value, weight)| (*value * *weight).as_dvec3()).sum::<DVec3>();
        }
        total
    }

    fn group_sum(&self, group: &Group, pair: &PairVectors, v_i_all: &[f32], v_o_all: &[f32]) -> DVec3 {
        if let Some(patches) = &group.patches {
            return patches.iter().map(|patch| self.patch_sum(group, patch, pair, v_i_all, v_o_all)).sum();
        }
        let range = group.range.clone();
        let (v_i, v_o) = (&v_i_all[range.clone()], &v_o_all[range.clone()]);
        let normals = self.normals(range.clone());
        let mut total = DVec3::ZERO;
        for (lobe, term) in &group.lobes {
            let tint = term.tint(pair.i_dot_h).as_dvec3();
            total += tint
                * match &group.rgb_areas {
                    None => {
                        DVec3::splat(simd::lobe_sums(*lobe, pair, normals, [&self.areas[range.clone()]], v_i, v_o)[0])
                    }
                    Some([r, g, b]) => DVec3::from_array(simd::lobe_sums(*lobe, pair, normals, [r, g, b], v_i, v_o)),
                };
        }
        for table in &group.measured {
            total += self.measured_sum(group, table.as_ref(), pair, v_i_all, v_o_all);
        }
        total
    }

    fn patch_sum(&self, group: &Group, patch: &NormalCluster, pair: &PairVectors, v_i: &[f32], v_o: &[f32]) -> DVec3 {
        let Some(value) = patch_value(group, patch, pair) else { return DVec3::ZERO };
        let range = patch.range.clone();
        let seen = match &group.rgb_areas {
            None => DVec3::splat(simd::masked_sum([&self.areas[range.clone()]], &v_i[range.clone()], &v_o[range])[0]),
            Some(rgb) => {
                let inside = range.start - group.range.start..range.end - group.range.start;
                let [r, g, b] = rgb.each_ref().map(|areas| &areas[inside.clone()]);
                DVec3::from_array(simd::masked_sum([r, g, b], &v_i[range.clone()], &v_o[range]))
            }
        };
        seen * value.as_dvec3()
    }

    /// All that the sums of single lobes depend on: not colours and tints, which are multiplied on afterwards.
    pub(crate) fn hash_into(&self, key: &mut KeyBuilder) {
        for axis in &self.normals {
            key.numbers("normals", axis);
        }
        key.numbers("areas", &self.areas).flags("black ones too", [self.keep_black]);
        for group in &self.groups {
            key.counts("group", [group.range.start, group.range.end]).flags("black", [group.is_black]);
            for (lobe, _) in &group.lobes {
                key.numbers("lobe", &lobe.numbers());
            }
            for table in &group.measured {
                key.numbers("measured", table.content().bytes());
            }
            for areas in group.rgb_areas.iter().flatten() {
                key.numbers("colored areas", areas);
            }
            key.flags("few normals", [group.patches.is_some()]);
            for patch in group.patches.iter().flatten() {
                key.counts("patch", [patch.range.start, patch.range.end]).numbers("normal", &[patch.normal]);
            }
        }
    }

    /// Normals of the groups that reflect, where each has few.
    pub(crate) fn distinct_normals(&self) -> Option<usize> {
        let lit = self.groups.iter().filter(|group| !group.is_black);
        lit.map(|group| group.patches.as_ref().map(Vec::len)).sum()
    }

    /// Whether every group has few normals and one colour: then `ClusteredSum` serves.
    pub(crate) fn has_few_normals(&self) -> bool {
        let few = |group: &Group| group.patches.is_some() && group.rgb_areas.is_none();
        self.groups.iter().all(|group| group.is_black || few(group))
    }

    /// Other facets of the same materials.
    pub(crate) fn over(&self, normals: [Vec<f32>; 3], areas: Vec<f32>, groups: Vec<Group>) -> Self {
        Self { normals, areas, groups, keep_black: self.keep_black }
    }
}

/// The inner-loop form of an analytic term; `None` for a measured one.
pub fn analytic_lobe(term: &Term) -> Option<Lobe> {
    Some(match *term {
        Term::Lambertian { .. } => Lobe::Lambertian,
        Term::BlinnPhong { exponent, .. } => Lobe::blinn_phong(exponent),
        Term::CookTorrance { roughness, .. } => Lobe::cook_torrance(roughness),
        Term::Ward { roughness, .. } => Lobe::ward(roughness),
        Term::Ggx { roughness, .. } => Lobe::ggx(roughness),
        Term::Measured(_) => return None,
    })
}
