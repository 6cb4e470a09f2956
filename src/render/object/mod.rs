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
mod tests;
