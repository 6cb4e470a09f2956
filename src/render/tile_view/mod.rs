//! The small scale as a picture: the tile's own triangles, repeated without end, with its shadows.
//!
//! What the pixels of one whole tile show on average is what the effective BRDF says of it: a pixel at a facet is
//! `Σ_k E_k f_r (n·i_k)+ V(i_k)`, and weighted with the projected areas that is `Σ_k E_k f̄(i_k, o)` (Wu et al. 2011, Eq. 4
//! and 5).

pub mod on_object;
mod shade;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::{DirectionalLight, Image};
use crate::base::{Cancel, Error, Result};
use crate::effective::Material;
use crate::geometry::{PeriodicGrid, TileMesh};
use crate::math::directions::from_angles;

pub use crate::geometry::Hit;

/// A tile ready to be looked at.
#[derive(Debug)]
pub struct CloseUp {
    pub mesh: Arc<TileMesh>,
    grid: PeriodicGrid,
    bottom: f32,
}

/// A parallel view of the tile from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileView {
    /// From +x towards +y, to the viewer [rad].
    pub azimuth: f32,
    /// Above the horizon [rad]; π/2 looks straight down with +x to the right and +y up.
    pub elevation: f32,
    /// Tile coordinates of the picture's centre.
    pub center: Vec2,
    /// Tile units across the shorter side of the picture.
    pub span: f32,
    pub size: [usize; 2],
}

/// What the pixels show.
#[derive(Debug, Clone, PartialEq)]
pub enum Look {
    /// Matte under one lamp, in the materials' colours: the shape is read best (Wu et al. 2011, Fig. 1).
    Clay,
    /// The materials under these lights (tile frame).
    Materials(Vec<DirectionalLight>),
    /// Normals as colours: x, y, z from -1..1 to 0..1.
    Normals,
    /// What a facet adds to `f̄(i, o)`, dark to bright; `scale` [1/sr] is bright.
    Contribution { i: Vec3, o: Vec3, scale: f32 },
    /// Green where a facet sees the direction, red where something is in the way, grey where it is turned away.
    Visibility(Vec3),
}

/// The materials by slot, as [`crate::pipeline::Pipeline::sum_materials`] gives them.
#[derive(Debug, Clone, Copy)]
pub struct ShadedMaterials<'a> {
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
}

impl TileView {
    /// To the viewer, and the picture's axes to the right and up, in the tile frame.
    pub fn axes(&self) -> [Vec3; 3] {
        let to_viewer = from_angles(std::f32::consts::FRAC_PI_2 - self.elevation, self.azimuth);
        let right = Vec3::new(-self.azimuth.sin(), self.azimuth.cos(), 0.0);
        [to_viewer, right, to_viewer.cross(right)]
    }

    /// Extent of a pixel in tile units.
    pub fn pixel(&self) -> f32 {
        self.span / self.size[0].min(self.size[1]).max(1) as f32
    }

    /// A point of the plane z = `level` at pixel coordinates.
    pub fn ray_start(&self, at: Vec2, level: f32) -> Vec3 {
        let [to_viewer, right, up] = self.axes();
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) / 2.0;
        let offset = (at - half) * self.pixel();
        let start = self.center.extend(0.0) + right * offset.x - up * offset.y;
        start + to_viewer * ((level - start.z) / to_viewer.z.max(1e-3))
    }

    /// Pixel coordinates of a point.
    pub fn pixel_of(&self, point: Vec3) -> Vec2 {
        let [_, right, up] = self.axes();
        let offset = point - self.center.extend(0.0);
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) / 2.0;
        half + Vec2::new(offset.dot(right), -offset.dot(up)) / self.pixel()
    }
}

impl CloseUp {
    pub fn new(mesh: Arc<TileMesh>) -> Self {
        let grid = PeriodicGrid::new(&mesh);
        let (low, high) = mesh.z_range();
        let bottom = low - 1e-3 * (high - low).max(mesh.size.max_element());
        Self { mesh, grid, bottom }
    }

    /// What is at a pixel of a view.
    pub fn hit(&self, view: &TileView, at: Vec2) -> Option<Hit> {
        let [to_viewer, ..] = view.axes();
        let start = view.ray_start(at, self.grid.top());
        self.grid.nearest(start, -to_viewer, self.bottom)
    }

    /// Heights seen straight from above at texel centres, row 0 at y = 0; the lowest z in holes.
    pub fn heights(&self, size: UVec2) -> Vec<f32> {
        let (low, _) = self.mesh.z_range();
        let at = |k: u32| {
            let place = (Vec2::new((k % size.x) as f32, (k / size.x) as f32) + 0.5) / size.as_vec2() * self.mesh.size;
            let hit = self.grid.nearest(place.extend(self.grid.top()), Vec3::NEG_Z, self.bottom);
            hit.map_or(low, |hit| hit.position.z)
        };
        (0..size.x * size.y).into_par_iter().map(at).collect()
    }

    /// The picture, in linear radiance; what shows nothing is `background`.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn image(
        &self,
        view: &TileView,
        look: &Look,
        wearing: ShadedMaterials<'_>,
        background: Vec3,
        cancel: &Cancel,
    ) -> Result<Image> {
        let [width, height] = view.size;
        if width == 0 || height == 0 || width.saturating_mul(height) > 1 << 25 {
            return Err(Error::failed(format!("a picture of {width} x {height} pixels")));
        }
        let palette = shade::Palette::new(wearing);
        let mut pixels = vec![background; width * height];
        pixels.par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            if cancel.is_set() {
                return;
            }
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if let Some(hit) = self.hit(view, at) {
                    *pixel = self.shade(&hit, view.axes()[0], look, &palette);
                }
            }
        });
        cancel.check()?;
        Ok(Image { width, height, pixels })
    }
}
