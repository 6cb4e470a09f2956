//! Interreflection of the reference by path tracing: random walks from the viewer, with the light evaluated at every
//! hit. It shares its walks with [`crate::interreflection`].

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::geometry::{Facets, SurfacePoint};
use crate::interreflection::{WalkPoint, WalkedTile};
use crate::metrics::Pair;

/// Smallest cosine in a denominator.
const MIN_COSINE: f32 = 1e-4;
/// Most walks per pair and pass, which take about as long as the rays of direct reflection.
const MAX_WALKS: usize = 2048;

/// Traces the paths of one set of facets.
#[derive(Debug)]
pub(super) struct Paths<'a> {
    tile: WalkedTile<'a>,
    bottom: f32,
    bounces: usize,
}

impl<'a> Paths<'a> {
    pub fn new(tile: WalkedTile<'a>, bounces: usize) -> Self {
        Self { bottom: tile.mesh.z_range().0, tile, bounces }
    }

    /// `Σ ΔA L (n·o)` over the facets that are visible from the viewer (`v_o`). `L` is the radiance after one bounce or
    /// more under unit irradiance. Walks start from every n-th of many facets.
    pub fn trace(&self, facets: &Facets, origins: &[Vec3], v_o: &[f32], pair: Pair, seed: u64) -> DVec3 {
        if pair.i.z <= 0.0 || pair.o.z <= 0.0 {
            return DVec3::ZERO;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let stride = facets.len().div_ceil(MAX_WALKS).max(1);
        let starts = (rng.random_range(0..stride)..facets.len()).step_by(stride).filter(|s| v_o[*s] > 0.0);
        let sum: DVec3 = starts.map(|s| self.walk_from(facets, origins[s], s, pair, &mut rng)).sum();
        sum * stride as f64
    }

    /// `ΔA L (n·o)` of a facet by one walk.
    pub fn walk_from(&self, facets: &Facets, origin: Vec3, s: usize, pair: Pair, rng: &mut ChaCha8Rng) -> DVec3 {
        let material = self.tile.material_of_slot[usize::from(facets.slots[s])];
        let surface = SurfacePoint {
            position: facets.positions[s],
            origin,
            normal: facets.normals[s],
            geometric_normal: facets.geometric_normals[s],
            triangle: facets.triangles[s],
            slot: facets.slots[s],
        };
        let color = facets.colors[s] * self.tile.materials[material].color;
        let start = WalkPoint { surface, material, color };
        // The cosine between the first vertex and the viewer is a factor of the sum.
        let cosine = facets.normals[s].dot(pair.o).max(0.0);
        (self.walk(start, pair, rng) * (facets.areas[s] * cosine)).as_dvec3()
    }

    /// Radiance towards the viewer due to light that other facets reflected first.
    fn walk(&self, mut at: WalkPoint, pair: Pair, rng: &mut ChaCha8Rng) -> Vec3 {
        let (mut towards, mut weight, mut radiance) = (pair.o, Vec3::ONE, Vec3::ZERO);
        for bounce in 0..self.bounces {
            let Some((from, factor)) = self.tile.reflect(&at, towards, rng) else { break };
            weight *= factor * if bounce == 0 { at.color } else { self.tile.color_between(&at) };
            if weight.max_element() <= 0.0 {
                break;
            }
            let hit = self.tile.first_hit(&at, from, self.bottom);
            let Some(next) = hit.and_then(|hit| self.tile.point(&hit, from)) else { break };
            (at, towards) = (next, -from);
            let SurfacePoint { normal, origin, triangle, .. } = at.surface;
            let lit = normal.dot(pair.i) > 0.0 && !self.tile.grid.is_blocked(origin, pair.i, triangle);
            if lit {
                let reflected = self.tile.materials[at.material].brdf.f(normal, pair.i, towards) * at.color;
                radiance += weight * reflected / normal.dot(towards).max(MIN_COSINE);
            }
        }
        radiance
    }
}
