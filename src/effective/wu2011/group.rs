//! N and the product for the facets of one material (Wu et al. 2011, Sec. 3.7, "Multiple Materials").

use std::sync::Arc;

use glam::DVec3;

use super::product::{NodePairTable, product};
use super::visible_normals::BinnedFacets;
use crate::base::{Error, Result};
use crate::brdf::Material;
use crate::effective::{MaterialFactors, VisibleFacets, Wu2011Settings};
use crate::geometry::Facets;
use crate::math::directions::ParaboloidMap;

/// `G` of the facets of one material.
#[derive(Debug, Clone)]
pub(super) struct MaterialTables {
    pub map: Arc<ParaboloidMap>,
    pub tables: Vec<NodePairTable>,
    /// Rank of the projected N, the largest of all channels.
    pub rank: usize,
}

/// The facet indices of each material.
pub(super) fn group_facets(facets: &Facets, material_of_slot: &[usize], materials: usize) -> Result<Vec<Vec<usize>>> {
    let mut groups = vec![Vec::new(); materials];
    for (s, &slot) in facets.slots.iter().enumerate() {
        let group = material_of_slot.get(usize::from(slot)).and_then(|&material| groups.get_mut(material));
        group.ok_or_else(|| Error::failed(format_args!("slot {slot} has no material")))?.push(s);
    }
    Ok(groups)
}

impl MaterialTables {
    pub fn new(
        tile: &VisibleFacets<'_>,
        members: &[usize],
        material: &Material,
        factors: &MaterialFactors,
        settings: &Wu2011Settings,
    ) -> Result<Self> {
        let (facets, directions) = (tile.facets, tile.directions);
        let visibility: Vec<f32> = (0..directions.len())
            .flat_map(|node| members.iter().map(move |&s| f32::from(u8::from(tile.visibility.is_visible(node, s)))))
            .collect();
        let nearest: Vec<usize> = members.iter().map(|&s| factors.normals.nearest(facets.normals[s])).collect();
        let binned = BinnedFacets::new(directions, &visibility, &nearest, &factors.normals);
        // Colour weights that all facets share multiply the result; others need an N for each channel (Sec. 3.7).
        let shared = members.iter().all(|&s| facets.colors[s] == facets.colors[members[0]]);
        let masks = if shared { vec![facets.colors[members[0]].as_dvec3()] } else { DVec3::AXES.to_vec() };
        let mut tables = Vec::new();
        let mut rank = 0;
        for (c, mask) in masks.into_iter().enumerate() {
            let weight = |s: &usize| facets.areas[*s] * if shared { 1.0 } else { facets.colors[*s][c] };
            let weights: Vec<f32> = members.iter().map(weight).collect();
            let n = binned.factor(&weights, settings)?;
            rank = rank.max(n.rank);
            for m in &factors.channels {
                let values = product(&n, directions, &binned.bins, m, &factors.directions, tile.base_area);
                tables.push(NodePairTable { values, tint: m.tint(material.color) * mask });
            }
        }
        Ok(Self { map: Arc::clone(&factors.directions), tables, rank })
    }
}
