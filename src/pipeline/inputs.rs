//! The first stages: the tile's shape and the materials of its slots.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::stage::Version;
use super::{MaterialAssignment, Pipeline, StageTimes, TileShape};
use crate::base::Result;
use crate::brdf::Brdf;
use crate::effective::Material;
use crate::geometry::{self, TileMesh};
use crate::scene::LoadedScene;

impl Pipeline {
    pub(super) fn shape(&mut self, loaded: &LoadedScene, times: &mut StageTimes) -> Result<(Arc<TileShape>, Version)> {
        let key = (loaded.scene.tile.clone(), loaded.base_dir.clone(), loaded.painted.clone());
        self.shape.get("geometry", key, times, &self.cancel, || {
            let mesh = geometry::build_painted(&loaded.scene.tile, &loaded.base_dir, &loaded.painted)?;
            let (low, high) = mesh.z_range();
            let flat = high - low <= 1e-7 * mesh.size.max_element();
            let height_field = mesh.is_height_field() || mesh.closes_plane && nothing_faces_down(&mesh);
            let steepest = steepest(&mesh);
            Ok(TileShape { mesh, flat, height_field, steepest })
        })
    }

    pub(super) fn materials(
        &mut self,
        loaded: &LoadedScene,
        mesh: &TileMesh,
        times: &mut StageTimes,
    ) -> Result<(Arc<MaterialAssignment>, Version)> {
        let key = (loaded.scene.materials.clone(), mesh.slots.clone(), loaded.base_dir.clone());
        let cache = &mut self.cache;
        self.materials.get("materials", key, times, &self.cancel, || {
            let mut material_of_slot = Vec::with_capacity(mesh.slots.len());
            let mut materials: Vec<Material> = Vec::new();
            let mut made: Vec<Option<usize>> = Vec::new();
            for slot in &mesh.slots {
                let found = loaded.scene.material_for_slot(slot)?;
                if let Some(at) = made.iter().position(|index| *index == found.index) {
                    material_of_slot.push(at);
                    continue;
                }
                let brdf = Brdf::from_specs(found.brdf, &loaded.base_dir, cache)?;
                materials.push(Material { brdf, color: found.color });
                made.push(found.index);
                material_of_slot.push(materials.len() - 1);
            }
            Ok((material_of_slot, materials))
        })
    }
}

/// Without a surface that faces down, what blocks a point blocks everything below it too: one horizon tells all.
fn nothing_faces_down(mesh: &TileMesh) -> bool {
    (0..mesh.triangles.len()).all(|triangle| mesh.geometric_normal(triangle).z > -1e-6)
}

/// The largest angle between a normal and z [rad].
fn steepest(mesh: &TileMesh) -> f32 {
    let normals = (0..mesh.triangles.len()).into_par_iter().with_min_len(2048).map(|t| mesh.geometric_normal(t));
    let cosines = normals.filter(|normal| *normal != Vec3::ZERO).map(|normal| normal.z);
    cosines.reduce(|| 1.0, f32::min).clamp(-1.0, 1.0).acos()
}
