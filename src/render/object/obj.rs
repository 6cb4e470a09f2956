//! Large-scale objects from OBJ files.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::{Bounds, frames};
use crate::base::obj::{self, Grammar, ObjCorner, ObjFace, ObjFile, Rules};
use crate::base::{Error, InputError, Result, regular_file};
use crate::render::ObjectMesh;

/// Maximum size of a file, in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Rules for the OBJ files of objects. Only the size of the file is bounded.
const RULES: Rules = Rules { grammar: Grammar::Strict, max_elements: usize::MAX, max_materials: usize::MAX };

/// Loads an OBJ file as one mesh. Normals are the file's, or area-weighted means if the file has none. Tangents follow
/// the UVs, or the horizontal with a warning. A surface with open edges is two-sided.
pub(super) fn load(path: &Path) -> Result<ObjectMesh> {
    let unreadable = |what: &dyn std::fmt::Display| {
        Error::from(InputError::new("object.path", what, "a readable OBJ file").in_file(path))
    };
    let size = std::fs::metadata(path).map_err(|error| unreadable(&error))?.len();
    if size > MAX_BYTES {
        return Err(unreadable(&format!("{size} bytes (at most {MAX_BYTES} are read)")));
    }
    let bytes = regular_file::read(path).map_err(|error| unreadable(&error))?;
    let text = String::from_utf8(bytes).map_err(|_| unreadable(&"bytes that are not UTF-8 text"))?;
    parse(&text).map_err(|error| error.in_file(path))
}

fn parse(text: &str) -> Result<ObjectMesh> {
    let file = obj::read(text, RULES)?;
    let mut raw = RawMesh::default();
    for group in file.faces.chunk_by(|a, b| a.group == b.group) {
        raw.append(&file, group);
    }
    raw.finish()
}

/// The mesh of the file. `normals` and `uvs` are used only if each position has one.
#[derive(Default)]
struct RawMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

impl RawMesh {
    /// Appends one group. Its vertices are the distinct corners in order of first use; its polygons become fans.
    fn append(&mut self, file: &ObjFile, faces: &[ObjFace]) {
        let first = self.positions.len();
        let mut vertices: HashMap<ObjCorner, u32> = HashMap::new();
        let (mut normals, mut uvs) = (Vec::new(), Vec::new());
        for face in faces {
            let corners = file.corners[face.corners.clone()].iter().map(|corner| {
                *vertices.entry(*corner).or_insert_with(|| {
                    self.positions.push(file.positions[corner.position as usize]);
                    normals.extend(corner.normal.map(|normal| file.normals[normal as usize]));
                    uvs.extend(corner.texcoord.map(|texcoord| file.texcoords[texcoord as usize]));
                    self.positions.len() as u32 - 1
                })
            });
            let corners: Vec<u32> = corners.collect();
            self.triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
        }
        // If some vertices of the group have no normal or no UV, the arrays do not match the positions.
        let added = self.positions.len() - first;
        if normals.len() == added {
            self.normals.extend(normals);
        }
        if uvs.len() == added {
            self.uvs.extend(uvs);
        }
    }

    /// Moves the mesh to the origin and scales it to radius 1, so that the file's unit of length has no effect.
    fn normalize(&mut self) {
        let Some(first) = self.positions.first().map(|p| p.as_dvec3()) else {
            return;
        };
        let positions = || self.positions.iter().map(|p| p.as_dvec3());
        let (low, high) = positions().fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        let center = 0.5 * (low + high);
        let radius = positions().map(|p| p.distance(center)).fold(0.0, f64::max);
        if radius > 0.0 {
            self.positions.iter_mut().for_each(|p| *p = ((p.as_dvec3() - center) / radius).as_vec3());
        }
    }

    fn finish(mut self) -> Result<ObjectMesh> {
        let mut warnings = Vec::new();
        self.normalize();
        let all = self.triangles.len();
        let area_vector = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|k| self.positions[k as usize].as_dvec3());
            (b - a).cross(c - a)
        };
        self.triangles.retain(|triangle| area_vector(triangle).length_squared() > 0.0);
        if self.triangles.is_empty() {
            return Err(InputError::new("", format!("{all} triangles, none with an area"), "a surface").into());
        }
        if self.triangles.len() < all {
            warnings.push(format!("{} of {all} triangles have no area and are left out", all - self.triangles.len()));
        }
        let welded = frames::weld(&self.positions);
        let closed = is_closed(&welded, &self.triangles);
        let mut inside_out = false;
        if closed && signed_volume(&self.positions, &self.triangles) < 0.0 {
            inside_out = true;
            warnings.push("the mesh is closed but its triangles face inwards; they are turned around".to_owned());
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let normals = self.normals(inside_out, &mut warnings);
        let tangents = self.tangents(&normals, &mut warnings);
        Ok(ObjectMesh {
            bounds: Bounds::of(&self.positions),
            positions: self.positions,
            normals,
            tangents,
            triangles: self.triangles,
            two_sided: !closed,
            warnings,
        })
    }

    fn normals(&self, inside_out: bool, warnings: &mut Vec<String>) -> Vec<Vec3> {
        let smooth = || frames::smooth_normals(&self.positions, &self.triangles);
        if self.normals.len() != self.positions.len() {
            if !self.normals.is_empty() {
                warnings.push("only some faces have normals; all are smoothed instead".to_owned());
            }
            return smooth();
        }
        let sign = if inside_out { -1.0 } else { 1.0 };
        let unit: Vec<_> =
            self.normals.iter().map(|n| n.as_dvec3().try_normalize().map(|n| (n * sign).as_vec3())).collect();
        if unit.iter().all(Option::is_some) {
            return unit.into_iter().flatten().collect();
        }
        warnings.push("some normals have no length; smoothed ones take their place".to_owned());
        unit.into_iter().zip(smooth()).map(|(given, made)| given.unwrap_or(made)).collect()
    }

    fn tangents(&self, normals: &[Vec3], warnings: &mut Vec<String>) -> Vec<Vec3> {
        if self.uvs.len() != self.positions.len() {
            let what = if self.uvs.is_empty() { "the mesh has no UVs" } else { "only some faces have UVs" };
            warnings.push(format!(
                "{what}: the tile lies with x horizontal, and turns about the points that face up or down"
            ));
            return normals.iter().map(|n| frames::around_vertical(n.as_dvec3()).as_vec3()).collect();
        }
        let (tangents, mirrored) = frames::tangents_from_uvs(&self.positions, normals, &self.uvs, &self.triangles);
        if mirrored > 0 {
            let all = self.triangles.len();
            warnings.push(format!(
                "{mirrored} of {all} triangles have mirrored UVs; the tile follows u but is not mirrored"
            ));
        }
        tangents
    }
}

/// Returns true if exactly two triangles share each edge and traverse it in opposite directions. `welded` maps vertices
/// at one position to the first of them.
fn is_closed(welded: &[u32], triangles: &[[u32; 3]]) -> bool {
    let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(triangles.len() * 3);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| welded[k as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.push((from.min(to), from.max(to), from < to));
        }
    }
    edges.sort_unstable();
    let same_edge = |a: &(u32, u32, bool), b: &(u32, u32, bool)| (a.0, a.1) == (b.0, b.1);
    edges.chunk_by(same_edge).all(|uses| uses.len() == 2 && uses[0].2 != uses[1].2)
}

/// Returns six times the enclosed volume.
fn signed_volume(positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let origin = positions.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
    let volume = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|k| positions[k as usize].as_dvec3() - origin);
        a.dot(b.cross(c))
    };
    triangles.iter().map(volume).sum()
}

#[cfg(test)]
#[path = "obj_tests.rs"]
mod tests;
