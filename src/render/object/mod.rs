//! Large-scale objects: triangle meshes with smooth normals and a continuous tangent frame that the tile follows.

mod cloth;
mod curves;
mod figures;
mod frames;
mod lathed;
mod obj;
mod parametric;
mod teapot;

use std::path::Path;

use glam::Vec3;

use crate::base::{InputError, Result};
use crate::scene;

/// Names that `object.kind` accepts.
pub const KINDS: [&str; 11] =
    ["sphere", "plate", "cup", "cylinder", "pillow", "skirt", "teapot", "bear", "snake", "sheet", "mesh"];

/// An object in the world frame: y up, about two units in size. OBJ files are centred and scaled to radius 1.
///
/// The tangent frame of a vertex is `x = tangents[k]` (along ∂P/∂u), `z = normals[k]`, `y = z × x`. The frame is always
/// right-handed, because a tile is a physical surface and cannot be mirrored.
#[derive(Debug, Clone, Default)]
pub struct ObjectMesh {
    pub positions: Vec<Vec3>,
    /// Unit shading normals that point outwards.
    pub normals: Vec<Vec3>,
    /// Unit tangents, perpendicular to the normals.
    pub tangents: Vec<Vec3>,
    /// Vertex indices, counter-clockwise as viewed from outside.
    pub triangles: Vec<[u32; 3]>,
    /// True if the surface is open, so that its back is visible and has the same material. Back faces of a closed
    /// surface are culled.
    pub two_sided: bool,
    pub bounds: Bounds,
    /// Warnings about the mesh: no UVs, mirrored UVs, triangles without area.
    pub warnings: Vec<String>,
}

/// The centre of the bounding box, and the radius of the sphere about it that contains every vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub center: Vec3,
    pub radius: f32,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { center: Vec3::ZERO, radius: 1.0 }
    }
}

impl Bounds {
    /// Returns the bounds of points; the unit sphere at the origin if there are none.
    pub fn of(positions: &[Vec3]) -> Self {
        let Some(&first) = positions.first() else {
            return Self::default();
        };
        let (low, high) = positions.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
        let center = 0.5 * low + 0.5 * high;
        let radius = positions.iter().map(|p| p.distance(center)).fold(0.0, f32::max);
        Self { center, radius: radius.max(f32::MIN_POSITIVE) }
    }
}

impl ObjectMesh {
    /// Returns the corner positions of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|index| self.positions[index as usize])
    }
}

/// Builds the object of a scene; paths are relative to `base_dir`.
pub fn build(object: &scene::Object, base_dir: &Path) -> Result<ObjectMesh> {
    if object.kind != "mesh"
        && let Some(path) = &object.path
    {
        let found = format!("a path ({}) with kind \"{}\"", path.display(), object.kind);
        return Err(InputError::new("object.path", found, "no path, or kind = \"mesh\"").into());
    }
    match object.kind.as_str() {
        "sphere" => Ok(lathed::sphere()),
        "plate" => Ok(lathed::plate()),
        "cup" => Ok(lathed::cup()),
        "cylinder" => Ok(lathed::cylinder()),
        "pillow" => Ok(cloth::pillow()),
        "skirt" => Ok(cloth::skirt()),
        "teapot" => Ok(teapot::teapot()),
        "bear" => Ok(figures::bear()),
        "snake" => Ok(figures::snake()),
        "sheet" => Ok(parametric::sheet()),
        "mesh" => match &object.path {
            Some(path) => obj::load(&base_dir.join(path)),
            None => {
                Err(InputError::new("object.path", "nothing", "the path of an .obj file, because kind is \"mesh\"")
                    .into())
            }
        },
        unknown => Err(unknown_kind(unknown).into()),
    }
}

fn unknown_kind(kind: &str) -> InputError {
    let error = InputError::new("object.kind", format!("\"{kind}\""), format!("one of {}", KINDS.join(", ")));
    let nearest = KINDS.iter().min_by_key(|known| strsim::damerau_levenshtein(kind, known));
    match nearest {
        Some(known) if strsim::damerau_levenshtein(kind, known) <= 3 => {
            error.with_hint(format!("did you mean \"{known}\"?"))
        }
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_kind(kind: &str) -> ObjectMesh {
        build(&scene::Object { kind: kind.to_owned(), path: None }, Path::new(".")).unwrap()
    }

    #[test]
    fn every_object_has_an_orthonormal_right_handed_frame_that_faces_along_its_triangles() {
        for kind in KINDS.iter().filter(|kind| **kind != "mesh") {
            let mesh = of_kind(kind);
            assert!(mesh.triangles.len() > 500, "{kind}");
            for (n, t) in mesh.normals.iter().zip(&mesh.tangents) {
                assert!((n.length() - 1.0).abs() < 1e-5 && (t.length() - 1.0).abs() < 1e-5, "{kind}");
                assert!(n.dot(*t).abs() < 1e-5, "{kind}");
            }
            for (k, triangle) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = mesh.corners(k);
                let geometric = (b - a).cross(c - a);
                let shading: Vec3 = triangle.iter().map(|&v| mesh.normals[v as usize]).sum();
                assert!(geometric.dot(shading) > 0.0, "{kind}: triangle {k} faces away from its normals");
            }
        }
    }

    #[test]
    fn normals_and_tangents_are_continuous_across_the_seams_of_the_parameterisation() {
        // Vertices that coincide must agree, except at the poles of a lathe (every tangent occurs) and at creases
        // between parts.
        for kind in ["sphere", "cylinder", "skirt"] {
            let mesh = of_kind(kind);
            let mut by_position = std::collections::HashMap::<[i64; 3], Vec<usize>>::new();
            for (k, p) in mesh.positions.iter().enumerate() {
                by_position.entry(p.to_array().map(|x| (f64::from(x) * 1e5).round() as i64)).or_default().push(k);
            }
            let seams: Vec<_> = by_position.values().filter(|group| group.len() == 2).collect();
            assert!(seams.len() > 20, "{kind}: {} seam vertices", seams.len());
            for group in seams {
                let (a, b) = (group[0], group[1]);
                assert!(mesh.normals[a].dot(mesh.normals[b]) > 0.999_99, "{kind}");
                assert!(mesh.tangents[a].dot(mesh.tangents[b]) > 0.999_99, "{kind}");
            }
        }
    }

    #[test]
    fn closed_objects_enclose_a_positive_volume_near_the_closed_form() {
        let volume = |mesh: &ObjectMesh| -> f64 {
            (0..mesh.triangles.len())
                .map(|k| {
                    let [a, b, c] = mesh.corners(k).map(|p| p.as_dvec3());
                    a.dot(b.cross(c)) / 6.0
                })
                .sum()
        };
        let sphere = volume(&of_kind("sphere"));
        assert!((sphere / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.005, "{sphere}");
        let cylinder = volume(&of_kind("cylinder"));
        assert!((cylinder / (std::f64::consts::PI * 0.6 * 0.6 * 1.6) - 1.0).abs() < 0.02, "{cylinder}");
    }

    #[test]
    fn an_unknown_kind_names_the_nearest() {
        let error = build(&scene::Object { kind: "teapod".to_owned(), path: None }, Path::new(".")).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("did you mean \"teapot\""), "{error}");
        let far = build(&scene::Object { kind: "xylophones".to_owned(), path: None }, Path::new(".")).unwrap_err();
        assert!(!far.to_string().contains("did you mean"), "{far}");
    }
}
