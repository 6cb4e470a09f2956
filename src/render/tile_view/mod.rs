//! Images of the small scale: the periodic tiling of the tile's own triangles, with shadows.
//!
//! The radiance of a pixel at a facet is `Σ_k E_k f_r (n·i_k)+ V(i_k)`. An average over the pixels of one tile weights
//! the facets with their projected areas. The average is therefore `Σ_k E_k f̄(i_k, o)`, the radiance of the effective
//! BRDF (Wu et al. 2011, Eq. 4 and 5).

pub mod filtered;
pub mod on_object;
mod shade;
#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};

use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::{DirectionalLight, Image};
use crate::base::{Cancel, Error, Result};
use crate::brdf::Material;
use crate::geometry::{PeriodicGrid, TileMesh};
use crate::math::directions::from_angles;

pub use crate::geometry::Hit;
use filtered::FilteredTile;

/// A tile mesh with its ray-casting grid, ready to be rendered.
#[derive(Debug)]
pub struct TileScene {
    pub mesh: Arc<TileMesh>,
    grid: PeriodicGrid,
    bottom: f32,
    /// The tile at every distance, computed when it is first needed; `None` without a colour map.
    filtered: OnceLock<Option<FilteredTile>>,
}

/// An orthographic view of the tile from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileView {
    /// Azimuth of the viewer, from +x towards +y [rad].
    pub azimuth: f32,
    /// Elevation of the viewer above the horizon [rad]; π/2 is straight above.
    pub elevation: f32,
    /// Tile coordinates of the image centre.
    pub center: Vec2,
    /// Tile units across the shorter side of the image.
    pub span: f32,
    pub size: [usize; 2],
}

/// The quantity that the pixels of a tile image display.
#[derive(Debug, Clone, PartialEq)]
pub enum TileShading {
    /// Diffuse shading under one fixed light in the hues of the materials, which shows the shape best (Wu et al. 2011,
    /// Fig. 1).
    Clay,
    /// The materials under these lights, in the tile frame.
    Materials(Vec<DirectionalLight>),
    /// Normals as colours: x, y, z from -1..1 to 0..1.
    Normals,
    /// The contribution of a point to `f̄(i, o)`, from dark to bright; the value `scale` [1/sr] is the brightest.
    Contribution { i: Vec3, o: Vec3, scale: f32 },
    /// Visibility along a direction: green if visible, red if blocked, grey if the surface faces away.
    Visibility(Vec3),
}

/// The materials of a tile and their assignment to slots.
#[derive(Debug, Clone, Copy)]
pub struct ShadedMaterials<'a> {
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
}

impl TileView {
    /// Returns the view direction and the image axes to the right and up, in the tile frame.
    pub fn axes(&self) -> [Vec3; 3] {
        let to_viewer = from_angles(std::f32::consts::FRAC_PI_2 - self.elevation, self.azimuth);
        let right = Vec3::new(-self.azimuth.sin(), self.azimuth.cos(), 0.0);
        [to_viewer, right, to_viewer.cross(right)]
    }

    /// Returns the extent of a pixel in tile units.
    pub fn pixel_size(&self) -> f32 {
        self.span / self.size[0].min(self.size[1]).max(1) as f32
    }

    /// Returns the point of the plane z = `level` at pixel coordinates.
    pub fn ray_start(&self, at: Vec2, level: f32) -> Vec3 {
        let [to_viewer, right, up] = self.axes();
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) / 2.0;
        let offset = (at - half) * self.pixel_size();
        let start = self.center.extend(0.0) + right * offset.x - up * offset.y;
        start + to_viewer * ((level - start.z) / to_viewer.z.max(1e-3))
    }

    /// Returns the pixel coordinates of a point.
    pub fn pixel_of(&self, point: Vec3) -> Vec2 {
        let [_, right, up] = self.axes();
        let offset = point - self.center.extend(0.0);
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) / 2.0;
        half + Vec2::new(offset.dot(right), -offset.dot(up)) / self.pixel_size()
    }
}

impl TileScene {
    pub fn new(mesh: Arc<TileMesh>) -> Self {
        let grid = PeriodicGrid::new(&mesh);
        grid.prepare_rays();
        let (low, high) = mesh.z_range();
        let bottom = low - 1e-3 * (high - low).max(mesh.size.max_element());
        Self { mesh, grid, bottom, filtered: OnceLock::new() }
    }

    /// The tile under its colour map at every distance; `None` without a map.
    pub fn filtered(&self) -> Option<&FilteredTile> {
        self.filtered.get_or_init(|| FilteredTile::new(self)).as_ref()
    }

    /// Returns the surface point that is visible at pixel coordinates of a view.
    pub fn hit(&self, view: &TileView, at: Vec2) -> Option<Hit> {
        let [to_viewer, ..] = view.axes();
        let start = view.ray_start(at, self.grid.top());
        self.grid.nearest(start, -to_viewer, self.bottom)
    }

    /// Returns the heights visible from straight above at texel centres, row 0 at y = 0; the lowest z in holes.
    pub fn heights(&self, size: UVec2) -> Vec<f32> {
        let (low, _) = self.mesh.z_range();
        let at = |k: u32| {
            let point = (Vec2::new((k % size.x) as f32, (k / size.x) as f32) + 0.5) / size.as_vec2() * self.mesh.size;
            let hit = self.grid.nearest(point.extend(self.grid.top()), Vec3::NEG_Z, self.bottom);
            hit.map_or(low, |hit| hit.position.z)
        };
        (0..size.x * size.y).into_par_iter().map(at).collect()
    }

    /// Renders an image in linear radiance; pixels without a surface are `background`.
    ///
    /// # Errors
    /// [`Error::Cancelled`], or a size that is zero or too large.
    pub fn image(
        &self,
        view: &TileView,
        shading: &TileShading,
        materials: ShadedMaterials<'_>,
        background: Vec3,
        cancel: &Cancel,
    ) -> Result<Image> {
        let [width, height] = view.size;
        if width == 0 || height == 0 || width.saturating_mul(height) > 1 << 25 {
            return Err(Error::failed(format!("an image of {width} x {height} pixels is empty or too large")));
        }
        let mut pixels = vec![background; width * height];
        pixels.par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            if cancel.is_set() {
                return;
            }
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if let Some(hit) = self.hit(view, at) {
                    *pixel = self.shade(&hit, view.axes()[0], shading, &materials);
                }
            }
        });
        cancel.check()?;
        Ok(Image { width, height, pixels })
    }
}
