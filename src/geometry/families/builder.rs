//! A builder of a [`TileMesh`] from polygons.

use glam::{DVec2, DVec3, Vec2};

use crate::geometry::TileMesh;

/// Collects polygons and moves each by whole tiles so that its centre lies in the tile. Positions are f64 until a
/// polygon is stored, so copies that meet over the tile's edge agree to f32 rounding.
pub struct MeshBuilder {
    mesh: TileMesh,
    size: DVec2,
}

impl MeshBuilder {
    /// Starts an empty mesh. Polygons refer to the slots by index.
    pub fn new(size: Vec2, slots: &[&str]) -> Self {
        let mesh = TileMesh {
            size,
            slots: slots.iter().map(|&slot| slot.to_owned()).collect(),
            closes_plane: true,
            ..TileMesh::default()
        };
        Self { mesh, size: size.as_dvec2() }
    }

    /// Adds a convex polygon as a triangle fan. Corners are counter-clockwise seen from the side that reflects.
    pub fn polygon(&mut self, corners: &[DVec3], slot: u16) {
        let centre = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let shift = (centre.truncate() / self.size).floor() * self.size;
        let first = self.mesh.positions.len() as u32;
        self.mesh.positions.extend(corners.iter().map(|corner| (*corner - shift.extend(0.0)).as_vec3()));
        for k in 1..corners.len().saturating_sub(1) as u32 {
            self.mesh.triangles.push([first, first + k, first + k + 1]);
            self.mesh.triangle_slot.push(slot);
        }
    }

    pub fn note(&mut self, note: String) {
        self.mesh.notes.push(note);
    }

    /// Marks the mesh as one that does not close the plane.
    pub fn leave_holes(&mut self) {
        self.mesh.closes_plane = false;
    }

    pub fn finish(self) -> TileMesh {
        self.mesh
    }
}
