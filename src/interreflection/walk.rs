//! Random walks of light over a surface, which follow the BRDF at every point.

use glam::Vec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::sampler::LobeSampler;
use crate::brdf::Material;
use crate::geometry::{Hit, PeriodicGrid, SurfacePoint, TileMesh};

/// A tile with what walks over it need.
#[derive(Debug, Clone, Copy)]
pub struct WalkedTile<'a> {
    pub mesh: &'a TileMesh,
    pub grid: &'a PeriodicGrid,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    pub samplers: &'a [LobeSampler],
}

/// A point at which a walk is reflected.
#[derive(Debug, Clone, Copy)]
pub struct WalkPoint {
    pub surface: SurfacePoint,
    /// Index of the material.
    pub material: usize,
    /// Colour of the material at the point.
    pub color: Vec3,
}

impl WalkedTile<'_> {
    /// The point that a walk along `direction` meets; `None` if it meets a side that does not reflect.
    pub fn point(&self, hit: &Hit, direction: Vec3) -> Option<WalkPoint> {
        let surface = self.mesh.surface_point(hit);
        let faces = surface.geometric_normal.dot(direction) < 0.0 && surface.normal.dot(direction) < 0.0;
        let material = self.material_of_slot[usize::from(surface.slot)];
        let color = || self.mesh.color.at(surface.position, surface.normal, self.mesh.size);
        faces.then(|| WalkPoint { surface, material, color: self.materials[material].color * color() })
    }

    /// Draws a direction by the BRDF for light that leaves along `to`, and what the walk's weight is multiplied by, without the
    /// colour. `None` if the walk ends.
    pub fn reflect(&self, at: &WalkPoint, to: Vec3, random: &mut ChaCha8Rng) -> Option<(Vec3, Vec3)> {
        let numbers = [random.random(), random.random(), random.random()];
        let brdf = &self.materials[at.material].brdf;
        let sampler = &self.samplers[at.material];
        let (direction, factor) = sampler.sample(brdf, at.surface.normal, to, numbers)?;
        (direction.dot(at.surface.geometric_normal) > 0.0).then_some((direction, factor))
    }

    /// The colour with which a point reflects from facet to facet. At its first and its last facet, light has the point's own
    /// colour.
    pub fn color_between(&self, at: &WalkPoint) -> Vec3 {
        self.samplers[at.material].color_of_walk(at.color)
    }

    /// The first hit of a ray from a point. `bottom` is the lowest z of the tile.
    pub fn first_hit(&self, at: &WalkPoint, direction: Vec3, bottom: f32) -> Option<Hit> {
        self.grid.first_hit(at.surface.origin, direction, at.surface.triangle, bottom)
    }
}
