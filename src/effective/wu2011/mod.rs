//! The `wu2011` preset: the method of Wu et al. 2011 as published, for comparison.
//!
//! All directions and normals are nodes of paraboloid maps. N uses nearest normals, and M is computed in streamed
//! blocks. Both are reduced by random projection, mean subtraction and a small SVD, with weights that compensate for
//! the map's distortion. Their product is tabulated on M's pairs and interpolated bilinearly.
//!
//! The paper leaves two choices open. The mean that is subtracted is here the mean over rows, which are the direction
//! pairs. M is projected onto 160 random rows, because its ranks exceed the 50 rows that the paper names for N.

mod group;
mod material;
mod product;
mod projection;
mod rows;
mod sampling;
mod settings;
#[cfg(test)]
mod tests;
mod visible_normals;

use std::sync::Arc;

use glam::{DVec3, Vec3};

use self::group::{MaterialTables, group_facets};
use crate::base::{Error, InputError, Result};
use crate::brdf::Material;
use crate::geometry::Facets;
use crate::math::directions::{ParaboloidMap, Tap};
use crate::visibility::PackedVisibility;
pub use material::MaterialFactors;
pub use settings::Wu2011Settings;

/// Facets and their visibility at the directions of a paraboloid map.
#[derive(Debug, Clone, Copy)]
pub struct VisibleFacets<'a> {
    pub facets: &'a Facets,
    /// Row `d` is the visibility along `directions.directions()[d]`.
    pub visibility: &'a PackedVisibility,
    pub directions: &'a ParaboloidMap,
    /// Base area `A` of the tile.
    pub base_area: f64,
}

/// The effective BRDF in the paper's representation.
#[derive(Debug, Clone)]
pub struct Wu2011 {
    groups: Vec<MaterialTables>,
    directions: ParaboloidMap,
    /// `a_v / A` at the directions of visibility (Eq. 10).
    projected_area: Vec<f32>,
    base_area: f64,
}

/// Number of unordered pairs of `count` items; also the row of M at which the pairs `(0..=count, count)` start.
fn rows_of(count: usize) -> usize {
    count * (count + 1) / 2
}

/// The pair `i <= o` of a row.
fn pair_of_row(row: usize) -> (usize, usize) {
    let mut o = (((8 * row + 1) as f64).sqrt() as usize).saturating_sub(1) / 2;
    while rows_of(o + 1) <= row {
        o += 1;
    }
    (row - rows_of(o), o)
}

impl Wu2011 {
    /// Factors the materials and computes the product. Facets must be sorted by [`Facets::sort_for_sums`].
    ///
    /// # Errors
    /// Settings out of range, a slot without a material, or a factorization that fails.
    pub fn build(
        facets: &Facets,
        visibility: &PackedVisibility,
        directions: &ParaboloidMap,
        base_area: f64,
        material_of_slot: &[usize],
        materials: &[Material],
        settings: &Wu2011Settings,
    ) -> Result<Self> {
        settings.check()?;
        let groups = group_facets(facets, material_of_slot, materials.len())?;
        let factors: Vec<Option<Arc<MaterialFactors>>> = materials
            .iter()
            .zip(&groups)
            .map(|(material, group)| {
                (!group.is_empty()).then(|| MaterialFactors::new(material, settings).map(Arc::new)).transpose()
            })
            .collect::<Result<_>>()?;
        let tile = VisibleFacets { facets, visibility, directions, base_area };
        Self::from_factors(&tile, material_of_slot, materials, &factors, settings)
    }

    /// Computes the product from factored materials, as an edit of the geometry or of a colour requires. `factors[m]`
    /// belongs to `materials[m]` and may be missing if no facet has that material.
    ///
    /// # Errors
    /// As [`Wu2011::build`], and a visibility that does not fit the facets or directions.
    pub fn from_factors(
        tile: &VisibleFacets<'_>,
        material_of_slot: &[usize],
        materials: &[Material],
        factors: &[Option<Arc<MaterialFactors>>],
        settings: &Wu2011Settings,
    ) -> Result<Self> {
        settings.check()?;
        let VisibleFacets { facets, visibility, directions, base_area } = *tile;
        if visibility.facet_count != facets.len() || visibility.direction_count != directions.len() {
            return Err(Error::failed("the visibility belongs to other facets or directions"));
        }
        if !(base_area > 0.0 && base_area.is_finite()) {
            return Err(InputError::new("tile.size", base_area, "a tile with an area").into());
        }
        let mut groups = Vec::new();
        for (material, members) in group_facets(facets, material_of_slot, materials.len())?.iter().enumerate() {
            if members.is_empty() {
                continue;
            }
            let factors = factors
                .get(material)
                .and_then(Option::as_ref)
                .ok_or_else(|| Error::failed("a material has no factors"))?;
            groups.push(MaterialTables::new(tile, members, &materials[material], factors, settings)?);
        }
        let projected_area = (0..directions.len())
            .map(|node| {
                let o = directions.directions()[node];
                let visible = (0..facets.len()).filter(|&s| visibility.is_visible(node, s));
                let sum: f64 =
                    visible.map(|s| f64::from(facets.normals[s].dot(o).max(0.0)) * f64::from(facets.areas[s])).sum();
                (sum / base_area) as f32
            })
            .collect();
        Ok(Self { groups, directions: directions.clone(), projected_area, base_area })
    }

    /// Returns `a_v(o)` and writes `a_v f̄` of each light to `out`.
    pub fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if o.z <= 0.0 {
            (0..lights.len()).for_each(|k| out(k, DVec3::ZERO));
            return 0.0;
        }
        let views: Vec<[Tap; 4]> = self.groups.iter().map(|group| group.map.taps(o)).collect();
        for (k, &i) in lights.iter().enumerate() {
            let mut total = DVec3::ZERO;
            if i.z > 0.0 {
                for (group, view) in self.groups.iter().zip(&views) {
                    let light = group.map.taps(i);
                    total += group.tables.iter().map(|table| table.tint * table.eval(&light, view)).sum::<DVec3>();
                }
            }
            // Truncated factors may be slightly below zero; no BRDF is.
            out(k, total.max(DVec3::ZERO) * self.base_area);
        }
        let relative: f32 = self.directions.taps(o).iter().map(|&(node, w)| w * self.projected_area[node]).sum();
        f64::from(relative) * self.base_area
    }

    /// Rank of the projected N of each material that facets carry.
    pub fn ranks(&self) -> Vec<usize> {
        self.groups.iter().map(|group| group.rank).collect()
    }

    /// Number of directions of visibility.
    pub fn direction_count(&self) -> usize {
        self.directions.len()
    }

    /// Size of the tables that a query reads, in bytes.
    pub fn bytes(&self) -> usize {
        let tables = self.groups.iter().flat_map(|group| &group.tables);
        4 * (tables.map(|table| table.values.len()).sum::<usize>() + self.projected_area.len())
    }
}
