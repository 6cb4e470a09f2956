//! Rays between points of the surface.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::base::{Cancel, Result};
use crate::geometry::facets::kd_tree::KdTree;
use crate::geometry::{Facets, PeriodicGrid, TileMesh, lifted_origins};
use crate::math::directions::from_angles;

/// Marker of a ray without a hit: it leaves the tile or hits the back of a triangle, which does not reflect.
pub const NO_HIT: u32 = u32::MAX;

/// Elements, which are a subset of the facets, and rays between them.
#[derive(Debug, Clone)]
pub struct Transport {
    /// The facet of each element.
    pub facets: Vec<u32>,
    /// Surface area that each element represents.
    pub areas: Vec<f32>,
    /// Rays per element. All have equal weight, because their density follows the cosine.
    pub rays: usize,
    /// Direction of ray `element * rays + k`, away from the element.
    pub directions: Vec<Vec3>,
    /// The element that each ray hits, or [`NO_HIT`].
    pub hits: Vec<u32>,
}

impl Transport {
    /// Casts `rays` rays from each of about `elements` facets.
    ///
    /// # Errors
    /// Returns [`crate::base::Error::Cancelled`] if `cancel` is set.
    pub fn new(mesh: &TileMesh, facets: &Facets, elements: usize, rays: usize, cancel: &Cancel) -> Result<Self> {
        let stride = facets.len().div_ceil(elements.max(1)).max(1);
        // Facets are sorted by normal, so every n-th facet is an even sample of them.
        let chosen: Vec<u32> = (stride / 2..facets.len()).step_by(stride).map(|s| s as u32).collect();
        let total: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
        // Each element represents the facets around it, whose areas are nearly equal to its own.
        let chosen_area: f64 = chosen.iter().map(|facet| f64::from(facets.areas[*facet as usize])).sum();
        let scale = total / chosen_area.max(f64::MIN_POSITIVE);
        let areas = chosen.iter().map(|facet| (f64::from(facets.areas[*facet as usize]) * scale) as f32).collect();
        let area = (total / chosen.len().max(1) as f64) as f32;
        let grid = PeriodicGrid::new(mesh);
        let bottom = mesh.z_range().0;
        let origins = lifted_origins(facets, mesh.size);
        // Points are moved off the surface so that a search for the nearest element keeps the two sides of a thin
        // sheet, or the two walls of a crease, apart.
        let offset = area.max(0.0).sqrt();
        let tree = {
            let position = |&s: &u32| {
                let s = s as usize;
                wrap(facets.positions[s] + facets.geometric_normals[s] * offset, mesh.size)
            };
            KdTree::new(&chosen.iter().map(position).collect::<Vec<_>>(), mesh.size)
        };
        let normals: Vec<Vec3> = (0..mesh.triangles.len()).map(|t| mesh.geometric_normal(t)).collect();
        let mut directions = vec![Vec3::Z; chosen.len() * rays];
        let mut hits = vec![NO_HIT; chosen.len() * rays];
        directions.par_chunks_mut(rays).zip(hits.par_chunks_mut(rays)).zip(&chosen).enumerate().for_each(
            |(element, ((directions, hits), &facet))| {
                if cancel.is_set() {
                    return;
                }
                let s = facet as usize;
                let (normal, geometric) = (facets.normals[s], facets.geometric_normals[s]);
                for (k, (direction, hit)) in directions.iter_mut().zip(hits).enumerate() {
                    *direction = cosine_direction(normal, k, rays, element);
                    if direction.dot(geometric) <= 0.0 {
                        continue;
                    }
                    let Some(found) = grid.first_hit(origins[s], *direction, facets.triangles[s], bottom) else {
                        continue;
                    };
                    let facing = normals[found.triangle as usize];
                    if facing.dot(*direction) < 0.0 {
                        *hit = tree.nearest(wrap(found.position + facing * offset, mesh.size)).unwrap_or(NO_HIT);
                    }
                }
            },
        );
        cancel.check()?;
        Ok(Self { facets: chosen, areas, rays, directions, hits })
    }

    /// Fraction of all rays that hit an element.
    pub fn hit_fraction(&self) -> f64 {
        self.hits.iter().filter(|hit| **hit != NO_HIT).count() as f64 / self.hits.len().max(1) as f64
    }
}

/// The k-th of `rays` cosine-weighted directions about `normal`. The set of directions is rotated and shifted from
/// element to element.
fn cosine_direction(normal: Vec3, k: usize, rays: usize, element: usize) -> Vec3 {
    // The R2 sequence shifts the set of each element; the golden angle separates the azimuths within a set.
    let shift = |step: f64| ((element as f64 + 0.5) * step).fract();
    let height = ((k as f64 + shift(0.754_877_666_246_692_8)) / rays as f64).min(1.0 - 1e-6);
    let turns = (k as f64 * 0.618_033_988_749_895 + shift(0.569_840_290_998_053_3)).fract();
    let local = from_angles((height.sqrt().asin()) as f32, turns as f32 * std::f32::consts::TAU);
    let (x, y) = normal.any_orthonormal_pair();
    (x * local.x + y * local.y + normal * local.z).normalize_or(normal)
}

fn wrap(position: Vec3, size: Vec2) -> Vec3 {
    let wrapped = position.truncate() - size * (position.truncate() / size).floor();
    wrapped.clamp(Vec2::ZERO, size).extend(position.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_between_facets_pass_the_chi_squared_test_for_the_cosine() {
        const RAYS: usize = 16;
        for normal in [Vec3::Z, crate::math::directions::from_angles(1.1, 2.0)] {
            let (x, y) = normal.any_orthonormal_pair();
            let mut counts = vec![0.0; 8 * 16];
            for (element, k) in (0..8192).flat_map(|element| (0..RAYS).map(move |k| (element, k))) {
                let d = cosine_direction(normal, k, RAYS, element);
                let at = |axis: Vec3| f64::from(d.dot(axis));
                let ring = (8.0 * (at(x).powi(2) + at(y).powi(2))).clamp(0.0, 7.0) as usize;
                let sector = (16.0 * (at(y).atan2(at(x)) / std::f64::consts::TAU + 1.0).fract()) as usize;
                counts[16 * ring + sector.min(15)] += 1.0;
            }
            // Šidák's correction: two tests at a joint level of 0.01.
            let p = crate::testing::chi_square::p_value(&counts, &vec![1.0; counts.len()]);
            assert!(p > 1.0 - 0.99_f64.sqrt(), "{normal}: {p}");
        }
    }
}
