//! Triangle meshes of parametric patches `P(u, v)`, with normals and tangents from the exact partial derivatives.

use glam::{DQuat, DVec3, Vec3};

use super::{Bounds, frames};
use crate::render::ObjectMesh;

/// Step of the central differences in parameter units; the error in f64 is about 1e-10.
const STEP: f64 = 1e-5;
/// Distance in parameter units from a pole, where ∂P/∂u vanishes, at which the pole's limiting frame is evaluated.
const POLE_STEP: f64 = 1e-4;

/// Builds one object from parametric patches.
#[derive(Default)]
pub(super) struct ObjectBuilder {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    tangents: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl ObjectBuilder {
    /// Adds the patch `surface(u, v)` sampled at `us` x `vs`; `∂P/∂u × ∂P/∂v` points outwards. `surface` is evaluated
    /// up to one [`STEP`] beyond the first and last u, where wrapped patches are periodic. It is never evaluated beyond
    /// the first and last v.
    pub fn add_patch(&mut self, us: &[f64], vs: &[f64], surface: impl Fn(f64, f64) -> DVec3) {
        let (Some(&v_first), Some(&v_last)) = (vs.first(), vs.last()) else {
            return;
        };
        let base = self.positions.len() as u32;
        let frame = |u: f64, v: f64| {
            let (v_below, v_above) = ((v - STEP).max(v_first), (v + STEP).min(v_last));
            let along_u = (surface(u + STEP, v) - surface(u - STEP, v)) / (2.0 * STEP);
            let along_v = (surface(u, v_above) - surface(u, v_below)) / (v_above - v_below);
            (along_u, along_u.cross(along_v))
        };
        for &v in vs {
            for &u in us {
                let (mut along_u, mut normal) = frame(u, v);
                if normal.length() < 1e-3 * along_u.length().max(1e-3) {
                    let inside = if v - v_first < v_last - v { v + POLE_STEP } else { v - POLE_STEP };
                    (along_u, normal) = frame(u, inside);
                }
                let normal = normal.try_normalize().unwrap_or(DVec3::Y);
                self.positions.push(surface(u, v));
                self.normals.push(normal);
                self.tangents.push(frames::perpendicular(along_u, normal));
            }
        }
        let row = us.len() as u32;
        for j in 0..(vs.len() as u32).saturating_sub(1) {
            for i in 0..row.saturating_sub(1) {
                let a = base + j * row + i;
                let (b, c, d) = (a + 1, a + row + 1, a + row);
                self.add_triangle([a, b, c]);
                self.add_triangle([a, c, d]);
            }
        }
    }

    /// Adds a triangle unless its area is zero, as at the poles of a patch.
    fn add_triangle(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle.map(|k| self.positions[k as usize]);
        if (b - a).cross(c - a).length() > 1e-12 {
            self.triangles.push(triangle);
        }
    }

    /// Rotates everything added so far.
    pub fn rotate(&mut self, rotation: DQuat) {
        for vectors in [&mut self.positions, &mut self.normals, &mut self.tangents] {
            vectors.iter_mut().for_each(|v| *v = rotation * *v);
        }
    }

    /// Replaces the tangents by `axis` projected onto the surface, for a planar layout of the tile.
    pub fn lay_tangents_along(&mut self, axis: DVec3) {
        for (tangent, normal) in self.tangents.iter_mut().zip(&self.normals) {
            *tangent = frames::perpendicular(axis, *normal);
        }
    }

    pub fn finish(self, two_sided: bool) -> ObjectMesh {
        let narrow = |vectors: Vec<DVec3>| vectors.into_iter().map(|v| v.as_vec3()).collect::<Vec<Vec3>>();
        let positions = narrow(self.positions);
        let bounds = Bounds::of(&positions);
        ObjectMesh {
            bounds,
            positions,
            normals: narrow(self.normals),
            tangents: narrow(self.tangents),
            triangles: self.triangles,
            two_sided,
            warnings: Vec::new(),
        }
    }
}

/// Builds an upright flat square of side 2 in the plane z = 0. Tile x runs to the right, and the front faces +z.
pub(super) fn sheet() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    builder.add_patch(&evenly(16), &evenly(16), |u, v| DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0));
    builder.finish(true)
}

/// Returns `count + 1` parameters evenly spaced from 0 to 1.
pub(super) fn evenly(count: usize) -> Vec<f64> {
    (0..=count).map(|k| k as f64 / count as f64).collect()
}
