//! Interreflection of the reference by path tracing: random walks from the viewer, with the light evaluated at every
//! hit. It shares the ray casting and the sampling of lobes with [`crate::interreflection`].

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::brdf::Material;
use crate::geometry::{Facets, Hit, PeriodicGrid, SurfacePoint, TileMesh};
use crate::interreflection::LobeSampler;
use crate::metrics::Pair;

/// Smallest cosine in a denominator.
const MIN_COSINE: f32 = 1e-4;
/// Most walks per pair and pass, which take about as long as the rays of direct reflection.
const MAX_WALKS: usize = 2048;

/// Traces the paths of one set of facets.
#[derive(Debug)]
pub(super) struct Paths<'a> {
    mesh: &'a TileMesh,
    grid: &'a PeriodicGrid,
    material_of_slot: &'a [usize],
    materials: &'a [Material],
    samplers: &'a [LobeSampler],
    bottom: f32,
    bounces: usize,
}

/// A vertex of a path, at which light is reflected.
struct Vertex {
    origin: Vec3,
    geometric: Vec3,
    normal: Vec3,
    triangle: u32,
    /// Index of the material.
    material: usize,
    color: Vec3,
}

impl<'a> Paths<'a> {
    pub fn new(
        mesh: &'a TileMesh,
        grid: &'a PeriodicGrid,
        material_of_slot: &'a [usize],
        (materials, samplers): (&'a [Material], &'a [LobeSampler]),
        bounces: usize,
    ) -> Self {
        Self { mesh, grid, material_of_slot, materials, samplers, bottom: mesh.z_range().0, bounces }
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
        let material = self.material_of_slot[usize::from(facets.slots[s])];
        let start = Vertex {
            origin,
            geometric: facets.geometric_normals[s],
            normal: facets.normals[s],
            triangle: facets.triangles[s],
            material,
            color: facets.colors[s] * self.materials[material].color,
        };
        // The cosine between the first vertex and the viewer is a factor of the sum.
        let cosine = facets.normals[s].dot(pair.o).max(0.0);
        (self.walk(start, pair, rng) * (facets.areas[s] * cosine)).as_dvec3()
    }

    /// Radiance towards the viewer due to light that other facets reflected first.
    fn walk(&self, mut at: Vertex, pair: Pair, rng: &mut ChaCha8Rng) -> Vec3 {
        let (mut towards, mut weight, mut radiance) = (pair.o, Vec3::ONE, Vec3::ZERO);
        for _ in 0..self.bounces {
            let numbers = [rng.random(), rng.random(), rng.random()];
            let brdf = &self.materials[at.material].brdf;
            let Some((from, factor)) = self.samplers[at.material].sample(brdf, at.normal, towards, numbers) else {
                break;
            };
            weight *= factor * at.color;
            if from.dot(at.geometric) <= 0.0 || weight.max_element() <= 0.0 {
                break;
            }
            let Some(hit) = self.grid.first_hit(at.origin, from, at.triangle, self.bottom) else { break };
            at = self.vertex(&hit);
            towards = -from;
            let cosine = at.normal.dot(towards);
            if at.geometric.dot(from) >= 0.0 || cosine <= 0.0 {
                break;
            }
            let lit = at.normal.dot(pair.i) > 0.0 && !self.grid.is_blocked(at.origin, pair.i, at.triangle);
            if lit {
                let brdf = &self.materials[at.material].brdf;
                let reflected = brdf.f(at.normal, pair.i, towards) * at.color / cosine.max(MIN_COSINE);
                radiance += weight * reflected;
            }
        }
        radiance
    }

    fn vertex(&self, hit: &Hit) -> Vertex {
        let SurfacePoint { position, origin, normal, geometric_normal, triangle, slot } = self.mesh.surface_point(hit);
        let material = self.material_of_slot[usize::from(slot)];
        let color = self.materials[material].color * self.mesh.color.at(position, normal, self.mesh.size);
        Vertex { origin, geometric: geometric_normal, normal, triangle, material, color }
    }
}
