//! The `wu2011` preset: the choices of Wu et al. 2011 as printed, to be compared with ours.
//!
//! Paraboloid maps for all directions and normals; N on nearest normals, M in streamed blocks, both reduced by random
//! projection, mean subtraction and a small SVD, weighted against the map's distortion; their product tabulated on M's
//! pairs and interpolated bilinearly. What the paper leaves open: which mean is subtracted (here: over rows, the pairs), and
//! the random rows for M, whose ranks exceed the 50 it names for N (here 160).

mod material;
mod product;
mod projection;
mod sampling;
#[cfg(test)]
mod tests;
mod visible_normals;

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Vec3};

use super::SumMaterial;
use crate::directions::{ParaboloidMap, Tap};
use crate::error::{Error, InputError, Result};
use crate::geometry::Facets;
use crate::visibility::PackedVisibility;
pub use material::MaterialFactors;
use product::{PairTable, product};
use visible_normals::BinnedFacets;

/// Truncation and sampling; the defaults are the paper's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wu2011Settings {
    /// Power of M that is kept.
    pub keep_m: f64,
    /// Power of N that is kept.
    pub keep_n: f64,
    /// Rows of the random projection of N; M is given at least 160.
    pub projection_rows: usize,
    /// Colour directions of a BRDF, 1 to 3.
    pub colors: usize,
    /// Directions of M; `None`: by Table 3's rule, capped.
    pub m_directions: Option<usize>,
    pub seed: u64,
}

impl Default for Wu2011Settings {
    fn default() -> Self {
        Self { keep_m: 0.98, keep_n: 0.995, projection_rows: 50, colors: 1, m_directions: None, seed: 0 }
    }
}

impl Wu2011Settings {
    /// Directions of visibility that the paper uses at most (Sec. 6); the nearest map has 137.
    pub const VISIBILITY_DIRECTIONS: usize = 132;

    fn check(&self) -> Result<()> {
        let complaint = |place: &str, found: String, expected: &str| Err(InputError::new(place, found, expected).into());
        let part = |kept: f64| kept > 0.0 && kept <= 1.0;
        if !part(self.keep_m) || !part(self.keep_n) {
            return complaint("quality.keep", format!("{}, {}", self.keep_m, self.keep_n), "parts of the power in (0, 1]");
        }
        if !(1..=2000).contains(&self.projection_rows) {
            return complaint("quality.projection_rows", self.projection_rows.to_string(), "1 to 2000");
        }
        if !(1..=3).contains(&self.colors) {
            return complaint("quality.colors", self.colors.to_string(), "1 to 3");
        }
        match self.m_directions {
            Some(count) if !(4..=2000).contains(&count) => complaint("quality.m_directions", count.to_string(), "4 to 2000"),
            _ => Ok(()),
        }
    }
}

/// Facets and what they see at the directions of a paraboloid map.
#[derive(Debug, Clone, Copy)]
pub struct VisibleFacets<'a> {
    pub facets: &'a Facets,
    /// Row `d` is the visibility along `directions.directions()[d]`.
    pub visibility: &'a PackedVisibility,
    pub directions: &'a ParaboloidMap,
    /// Base area `A` of the tile.
    pub base_area: f64,
}

/// One material's row, as in Table 3, and what the product made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialReport {
    /// Index into the materials.
    pub material: usize,
    pub m_rows: usize,
    pub m_columns: usize,
    pub m_directions: usize,
    /// Directions that the paper's sampling asks for; more than `m_directions` where the cap cut in.
    pub wanted_m_directions: usize,
    pub m_rank: usize,
    /// Power of M that was kept, measured over all of M (the lowest colour).
    pub m_kept: f64,
    pub m_bytes: usize,
    pub m_seconds: f64,
    /// Normal bins in use.
    pub n_columns: usize,
    pub n_rank: usize,
    /// Power of the projected N that was kept.
    pub n_kept: f64,
}

/// What was built and how long it took.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wu2011Report {
    pub n_rows: usize,
    pub materials: Vec<MaterialReport>,
    /// Everything but M, which is precomputed.
    pub product_seconds: f64,
}

/// The effective BRDF as the paper holds it.
#[derive(Debug, Clone)]
pub struct Wu2011 {
    groups: Vec<Group>,
    directions: ParaboloidMap,
    /// `a_v / A` at the directions of visibility (Eq. 10).
    projected_area: Vec<f32>,
    base_area: f64,
    pub report: Wu2011Report,
}

/// `G` of the facets of one material.
#[derive(Debug, Clone)]
struct Group {
    map: Arc<ParaboloidMap>,
    tables: Vec<PairTable>,
}

/// Number of unordered pairs of `count` things; also the row of M at which the pairs `(0..=count, count)` start.
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
    /// Factors the materials and forms the product. Facets as sorted by [`Facets::sort_for_sums`].
    pub fn build(
        facets: &Facets,
        visibility: &PackedVisibility,
        directions: &ParaboloidMap,
        base_area: f64,
        material_of_slot: &[usize],
        materials: &[SumMaterial],
        settings: &Wu2011Settings,
    ) -> Result<Self> {
        settings.check()?;
        let groups = group_facets(facets, material_of_slot, materials.len())?;
        let factors: Vec<Option<Arc<MaterialFactors>>> = materials
            .iter()
            .zip(&groups)
            .map(|(material, group)| (!group.is_empty()).then(|| MaterialFactors::new(material, settings).map(Arc::new)).transpose())
            .collect::<Result<_>>()?;
        let tile = VisibleFacets { facets, visibility, directions, base_area };
        Self::from_factors(&tile, material_of_slot, materials, &factors, settings)
    }

    /// The product alone: what an edit of the geometry or of a colour costs. `factors[m]` is of `materials[m]`, and may be
    /// missing where no facet has that material.
    pub fn from_factors(
        tile: &VisibleFacets<'_>,
        material_of_slot: &[usize],
        materials: &[SumMaterial],
        factors: &[Option<Arc<MaterialFactors>>],
        settings: &Wu2011Settings,
    ) -> Result<Self> {
        settings.check()?;
        let started = Instant::now();
        let VisibleFacets { facets, visibility, directions, base_area } = *tile;
        if visibility.facet_count != facets.len() || visibility.direction_count != directions.len() {
            return Err(Error::failed("the visibility is of other facets or directions"));
        }
        if !(base_area > 0.0 && base_area.is_finite()) {
            return Err(InputError::new("tile.size", base_area, "a tile with an area").into());
        }
        let mut report = Wu2011Report { n_rows: rows_of(directions.len()), ..Default::default() };
        let mut groups = Vec::new();
        for (material, members) in group_facets(facets, material_of_slot, materials.len())?.iter().enumerate() {
            if members.is_empty() {
                continue;
            }
            let factors = factors.get(material).and_then(Option::as_ref).ok_or_else(|| Error::failed("a material without factors"))?;
            let (group, row) = Group::new(tile, members, &materials[material], factors, settings)?;
            report.materials.push(MaterialReport { material, ..row });
            groups.push(group);
        }
        let projected_area = (0..directions.len())
            .map(|node| {
                let o = directions.directions()[node];
                let seen = (0..facets.len()).filter(|&s| visibility.is_visible(node, s));
                let sum: f64 = seen.map(|s| f64::from(facets.normals[s].dot(o).max(0.0)) * f64::from(facets.areas[s])).sum();
                (sum / base_area) as f32
            })
            .collect();
        report.product_seconds = started.elapsed().as_secs_f64();
        Ok(Self { groups, directions: directions.clone(), projected_area, base_area, report })
    }

    /// `a_v(o)` and, for each light, `a_v f̄` into `out`.
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
            // Truncated factors may fall a little below zero; no BRDF does.
            out(k, total.max(DVec3::ZERO) * self.base_area);
        }
        let relative: f32 = self.directions.taps(o).iter().map(|&(node, w)| w * self.projected_area[node]).sum();
        f64::from(relative) * self.base_area
    }

    /// Bytes of the tables that a query reads.
    pub fn bytes(&self) -> usize {
        let tables = self.groups.iter().flat_map(|group| &group.tables);
        4 * (tables.map(|table| table.values.len()).sum::<usize>() + self.projected_area.len())
    }
}

/// The facets of each material.
fn group_facets(facets: &Facets, material_of_slot: &[usize], materials: usize) -> Result<Vec<Vec<usize>>> {
    let mut groups = vec![Vec::new(); materials];
    for (s, &slot) in facets.slots.iter().enumerate() {
        let group = material_of_slot.get(usize::from(slot)).and_then(|&material| groups.get_mut(material));
        group.ok_or_else(|| Error::failed(format_args!("slot {slot} has no material")))?.push(s);
    }
    Ok(groups)
}

impl Group {
    fn new(
        tile: &VisibleFacets<'_>,
        members: &[usize],
        material: &SumMaterial,
        factors: &MaterialFactors,
        settings: &Wu2011Settings,
    ) -> Result<(Self, MaterialReport)> {
        let (facets, directions) = (tile.facets, tile.directions);
        let visibility: Vec<f32> = (0..directions.len())
            .flat_map(|node| members.iter().map(move |&s| f32::from(u8::from(tile.visibility.is_visible(node, s)))))
            .collect();
        let nearest: Vec<usize> = members.iter().map(|&s| factors.normals.nearest(facets.normals[s])).collect();
        let binned = BinnedFacets::new(directions, &visibility, &nearest, &factors.normals);
        // Colour weights that all facets share are a multiplication; others take an N for each channel (Sec. 3.7).
        let shared = members.iter().all(|&s| facets.colors[s] == facets.colors[members[0]]);
        let masks = if shared { vec![facets.colors[members[0]].as_dvec3()] } else { DVec3::AXES.to_vec() };
        let mut tables = Vec::new();
        let (mut n_rank, mut n_kept) = (0, 1.0_f64);
        for (c, mask) in masks.into_iter().enumerate() {
            let weight = |s: &usize| facets.areas[*s] * if shared { 1.0 } else { facets.colors[*s][c] };
            let weights: Vec<f32> = members.iter().map(weight).collect();
            let n = binned.factor(&weights, settings)?;
            (n_rank, n_kept) = (n_rank.max(n.rank), n_kept.min(n.kept));
            for m in &factors.channels {
                let values = product(&n, directions, &binned.bins, m, &factors.directions, tile.base_area);
                tables.push(PairTable { values, tint: m.tint(material.color) * mask });
            }
        }
        let report = MaterialReport {
            material: 0,
            m_rows: factors.rows(),
            m_columns: factors.columns(),
            m_directions: factors.directions.len(),
            wanted_m_directions: factors.wanted_directions,
            m_rank: factors.rank(),
            m_kept: factors.channels.iter().map(|channel| channel.kept).fold(1.0, f64::min),
            m_bytes: factors.bytes(),
            m_seconds: factors.seconds,
            n_columns: binned.bins.len(),
            n_rank,
            n_kept,
        };
        Ok((Self { map: Arc::clone(&factors.directions), tables }, report))
    }
}
