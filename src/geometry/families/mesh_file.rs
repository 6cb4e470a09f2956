//! A tile mesh from an OBJ file in tile coordinates.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::triangulate::triangulate;
use crate::base::Result;
use crate::base::obj::{self, Grammar, ObjCorner, ObjFile, Rules};
use crate::geometry::{TileMesh, closure};
use crate::scene::{MeshFile, files};

/// Usual ratios of the area that a mesh covers to that of its tile. Others suggest different units.
const USUAL_COVER: std::ops::Range<f64> = 0.01..10.0;

/// Maximum size of a file, in bytes.
const MAX_FILE: u64 = 1 << 30;

/// Rules for the OBJ files of tiles. A tile stores the slot of a triangle in 16 bits.
const RULES: Rules = Rules { grammar: Grammar::Tolerant, max_elements: 1 << 26, max_materials: 1 << 16 };

pub fn build(spec: &MeshFile, size: Vec2, base_dir: &Path) -> Result<TileMesh> {
    let bytes = files::read(base_dir, &spec.path, MAX_FILE)?;
    let path = files::resolve(base_dir, &spec.path);
    let file = obj::read(&String::from_utf8_lossy(&bytes), RULES).map_err(|error| error.in_file(&path))?;
    let (triangles, triangle_slot) = triangles(&file);
    let mut mesh = TileMesh {
        size,
        triangles: triangles.iter().map(|triangle| triangle.map(|corner| corner.position)).collect(),
        triangle_slot,
        slots: file.materials,
        ..TileMesh::default()
    };
    if triangles.iter().flatten().any(|corner| corner.normal.is_some()) {
        // If a corner of a triangle has no normal, all its corners get the geometric normal.
        let shading = |triangle: &[ObjCorner; 3]| -> [Vec3; 3] {
            let [a, b, c] = triangle.map(|corner| file.positions[corner.position as usize]);
            let flat = (b - a).as_dvec3().cross((c - a).as_dvec3()).try_normalize().unwrap_or_default().as_vec3();
            let from_file =
                triangle.map(|corner| corner.normal.and_then(|normal| file.normals[normal as usize].try_normalize()));
            match from_file {
                [Some(a), Some(b), Some(c)] => [a, b, c],
                _ => [flat; 3],
            }
        };
        mesh.corner_normals = Some(triangles.iter().map(shading).collect());
    }
    mesh.positions = file.positions;
    crate::geometry::check_extent(&mesh).map_err(|error| error.in_file(&path))?;
    mesh.closes_plane = closure::is_closed_sheet(&mesh);
    let covered = closure::signed_projected_area(&mesh) / f64::from(mesh.base_area());
    // Rounding leaves a closed solid without a floor a little above or below 0.
    if covered < -1e-3 {
        let name = spec.path.display();
        mesh.notes.push(format!(
            "the triangles of {name} face down and reflect nothing upwards: reverse the order of their corners"
        ));
    } else if !mesh.closes_plane {
        mesh.notes.push(format!(
            "{} is not one closed sheet over the tile ({} open edges, {covered:.4} of the base area): its projected area is measured, \
             and the BRDF is that of its surface, without what is seen through holes",
            spec.path.display(),
            closure::open_edges(&mesh),
        ));
        if !USUAL_COVER.contains(&covered) {
            let span = |axis: usize| {
                let values = mesh.positions.iter().map(|position| position[axis]);
                values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
            };
            let Vec2 { x, y } = mesh.size;
            mesh.notes.push(format!(
                "{} spans {} x {}, and the tile {x} x {y}: check that both have the same unit",
                spec.path.display(),
                span(0),
                span(1)
            ));
        }
    }
    Ok(mesh)
}

/// Returns the triangles of all faces and the material slot of each.
fn triangles(file: &ObjFile) -> (Vec<[ObjCorner; 3]>, Vec<u16>) {
    let mut triangles = Vec::new();
    let mut slots = Vec::new();
    for face in &file.faces {
        let corners = &file.corners[face.corners.clone()];
        let outline: Vec<Vec3> = corners.iter().map(|corner| file.positions[corner.position as usize]).collect();
        for triangle in triangulate(&outline) {
            triangles.push(triangle.map(|k| corners[k]));
            slots.push(face.material as u16);
        }
    }
    (triangles, slots)
}

#[cfg(test)]
#[path = "mesh_file_tests.rs"]
mod tests;
