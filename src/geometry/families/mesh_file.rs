//! A tile mesh from an OBJ file in tile coordinates.

use std::path::Path;

use glam::{Vec2, Vec3};

use crate::base::Result;
use crate::geometry::{TileMesh, closure, obj};
use crate::scene::{MeshFile, files};

/// Maximum size of a file, in bytes.
const MAX_FILE: u64 = 1 << 30;

pub fn build(spec: &MeshFile, size: Vec2, base_dir: &Path) -> Result<TileMesh> {
    let bytes = files::read(base_dir, &spec.path, MAX_FILE)?;
    let file = obj::parse(&bytes, &spec.path)?;
    let mut mesh = TileMesh {
        size,
        triangles: file.triangles.iter().map(|triangle| triangle.map(|corner| corner.position)).collect(),
        triangle_slot: file.triangle_material,
        slots: file.materials,
        ..TileMesh::default()
    };
    if file.triangles.iter().flatten().any(|corner| corner.normal.is_some()) {
        // If a corner of a triangle has no normal, all its corners get the geometric normal.
        let shading = |triangle: &[obj::ObjCorner; 3]| -> [Vec3; 3] {
            let [a, b, c] = triangle.map(|corner| file.positions[corner.position as usize]);
            let flat = (b - a).as_dvec3().cross((c - a).as_dvec3()).try_normalize().unwrap_or_default().as_vec3();
            let own =
                triangle.map(|corner| corner.normal.and_then(|normal| file.normals[normal as usize].try_normalize()));
            match own {
                [Some(a), Some(b), Some(c)] => [a, b, c],
                _ => [flat; 3],
            }
        };
        mesh.corner_normals = Some(file.triangles.iter().map(shading).collect());
    }
    mesh.positions = file.positions;
    crate::geometry::check_extent(&mesh).map_err(|error| error.in_file(&spec.path))?;
    mesh.closes_plane = closure::is_closed_sheet(&mesh);
    if !mesh.closes_plane {
        mesh.notes.push(format!(
            "{} is not one closed sheet over the tile ({} open edges, {:.4} of the base area): its projected area is measured",
            spec.path.display(),
            closure::open_edges(&mesh),
            closure::signed_projected_area(&mesh) / f64::from(mesh.base_area()),
        ));
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str) -> Result<TileMesh> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tile.obj"), text).unwrap();
        build(&MeshFile { path: "tile.obj".into() }, Vec2::ONE, folder.path())
    }

    const PLANE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

    #[test]
    fn a_plane_with_a_closed_solid_above_it_closes_the_plane() {
        let tetrahedron = "v .4 .4 .2\nv .6 .4 .2\nv .5 .6 .2\nv .5 .5 .5\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 7 5 8\n";
        let mesh = load(&format!("{PLANE}{tetrahedron}")).unwrap();
        assert!(mesh.closes_plane && !mesh.is_height_field(), "{:?}", mesh.notes);
        assert!(load(PLANE).unwrap().is_height_field());
    }

    #[test]
    fn a_mesh_with_holes_has_a_note() {
        let mesh = load("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").unwrap();
        assert!(!mesh.closes_plane);
        assert!(mesh.notes[0].contains("open edges"));
    }

    #[test]
    fn corner_normals_come_only_from_the_file() {
        assert_eq!(load(PLANE).unwrap().corner_normals, None);
        let tilted = "vn 1 0 1\nusemtl a\nf 1//1 2//1 3//1\nf 1 3 4\n";
        let normals = load(&format!("{PLANE}{tilted}")).unwrap().corner_normals.unwrap();
        let slanted = Vec3::new(0.5f32.sqrt(), 0.0, 0.5f32.sqrt());
        let is = |expected: Vec3| {
            normals.iter().filter(|corners| corners.iter().all(|n| (*n - expected).length() < 1e-6)).count()
        };
        assert_eq!((normals.len(), is(Vec3::Z), is(slanted)), (4, 3, 1));
    }
}
