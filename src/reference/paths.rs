//! Interreflection of the reference by path tracing: random walks from the viewer, with the light evaluated at every
//! hit. It shares only the ray casting with [`crate::interreflection`].

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::brdf::Material;
use crate::geometry::{Facets, Hit, PeriodicGrid, TileMesh};
use crate::math::directions::from_angles;
use crate::metrics::Pair;

/// Distance by which the origin of a ray is lifted off the surface, in units of the tile's diagonal. The rays of facets
/// use the same distance.
const LIFT: f32 = 2e-6;
/// Smallest cosine in a denominator.
const MIN_COSINE: f32 = 1e-4;

/// Traces the paths of one set of facets.
#[derive(Debug)]
pub(super) struct Paths<'a> {
    mesh: &'a TileMesh,
    grid: &'a PeriodicGrid,
    material_of_slot: &'a [usize],
    materials: &'a [Material],
    normals: Vec<Vec3>,
    bottom: f32,
    bounces: usize,
}

/// A vertex of a path, at which light is reflected.
struct Vertex<'a> {
    origin: Vec3,
    geometric: Vec3,
    normal: Vec3,
    triangle: u32,
    material: &'a Material,
    color: Vec3,
}

impl<'a> Paths<'a> {
    pub fn new(
        mesh: &'a TileMesh,
        grid: &'a PeriodicGrid,
        material_of_slot: &'a [usize],
        materials: &'a [Material],
        bounces: usize,
    ) -> Self {
        let normals = (0..mesh.triangles.len()).map(|triangle| mesh.geometric_normal(triangle)).collect();
        Self { mesh, grid, material_of_slot, materials, normals, bottom: mesh.z_range().0, bounces }
    }

    /// `Σ ΔA L (n·o)` over the facets that are visible from the viewer (`v_o`). `L` is the radiance after one bounce or
    /// more under unit irradiance.
    pub fn trace(&self, facets: &Facets, origins: &[Vec3], v_o: &[f32], pair: Pair, seed: u64) -> DVec3 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut total = DVec3::ZERO;
        if pair.i.z <= 0.0 || pair.o.z <= 0.0 {
            return total;
        }
        for s in 0..facets.len() {
            if v_o[s] <= 0.0 {
                continue;
            }
            let material = &self.materials[self.material_of_slot[usize::from(facets.slots[s])]];
            let start = Vertex {
                origin: origins[s],
                geometric: facets.geometric_normals[s],
                normal: facets.normals[s],
                triangle: facets.triangles[s],
                material,
                color: facets.colors[s] * material.color,
            };
            // The cosine between the first vertex and the viewer is a factor of the sum.
            let cosine = facets.normals[s].dot(pair.o).max(0.0);
            total += (self.walk(start, pair, &mut rng) * (facets.areas[s] * cosine)).as_dvec3();
        }
        total
    }

    /// Radiance towards the viewer due to light that other facets reflected first.
    fn walk(&self, mut at: Vertex<'a>, pair: Pair, rng: &mut ChaCha8Rng) -> Vec3 {
        let (mut towards, mut weight, mut radiance) = (pair.o, Vec3::ONE, Vec3::ZERO);
        for _ in 0..self.bounces {
            let from = cosine_direction(at.normal, rng.random(), rng.random());
            if from.dot(at.geometric) <= 0.0 {
                break;
            }
            let to_cosine = at.normal.dot(towards).max(MIN_COSINE);
            let from_cosine = at.normal.dot(from).max(MIN_COSINE);
            weight *= at.material.brdf.f(at.normal, from, towards) * at.color * (PI / (to_cosine * from_cosine));
            if weight.max_element() <= 0.0 {
                break;
            }
            let Some(hit) = self.grid.first_hit(at.origin, from, at.triangle, self.bottom) else { break };
            if self.normals[hit.triangle as usize].dot(from) >= 0.0 {
                break;
            }
            at = self.vertex(&hit);
            towards = -from;
            let cosine = at.normal.dot(towards);
            if cosine <= 0.0 {
                break;
            }
            let lit = at.normal.dot(pair.i) > 0.0 && !self.grid.is_blocked(at.origin, pair.i, at.triangle);
            if lit {
                let reflected = at.material.brdf.f(at.normal, pair.i, towards) * at.color / cosine.max(MIN_COSINE);
                radiance += weight * reflected;
            }
        }
        radiance
    }

    fn vertex(&self, hit: &Hit) -> Vertex<'a> {
        let triangle = hit.triangle as usize;
        let geometric = self.normals[triangle];
        let [v, w] = hit.barycentric;
        let smooth = self.mesh.corner_normals.as_ref().and_then(|normals| {
            let [a, b, c] = normals[triangle];
            (a * (1.0 - v - w) + b * v + c * w).try_normalize()
        });
        let normal = smooth.unwrap_or(geometric);
        let size = self.mesh.size;
        let flat = hit.position.truncate();
        let position = (flat - size * (flat / size).floor()).clamp(Vec2::ZERO, size).extend(hit.position.z);
        let material = &self.materials[self.material_of_slot[usize::from(self.mesh.slot_at(triangle, flat))]];
        let color = material.color * self.mesh.color.at(position, normal, size);
        let origin = position + geometric * (LIFT * size.length());
        Vertex { origin, geometric, normal, triangle: hit.triangle, material, color }
    }
}

fn cosine_direction(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let local = from_angles(u.sqrt().min(1.0 - 1e-6).asin(), v * TAU);
    let (x, y) = normal.any_orthonormal_pair();
    (x * local.x + y * local.y + normal * local.z).normalize_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    // With the density cos θ / π, the squared sine and the azimuth are uniform.
    #[test]
    fn directions_of_paths_pass_the_chi_squared_test_for_the_cosine() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        for normal in [Vec3::Z, Vec3::NEG_Z, from_angles(1.1, 2.0), Vec3::X] {
            let (x, y) = normal.any_orthonormal_pair();
            let mut counts = vec![0.0; 16 * 32];
            for _ in 0..1_000_000 {
                let d = cosine_direction(normal, rng.random(), rng.random());
                let at = |axis: Vec3| f64::from(d.dot(axis));
                let ring = (16.0 * (at(x).powi(2) + at(y).powi(2))).clamp(0.0, 15.0) as usize;
                let azimuth = (32.0 * (at(y).atan2(at(x)) / std::f64::consts::TAU + 1.0).fract()) as usize;
                counts[32 * ring + azimuth.min(31)] += 1.0;
            }
            let p = crate::testing::chi_square::p_value(&counts, &vec![1.0; counts.len()]);
            // Šidák: four tests at 0.01 together.
            assert!(p > 1.0 - 0.99_f64.powf(0.25), "{normal}: {p}");
        }
    }
}
