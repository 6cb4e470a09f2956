//! From facets, visibility and BRDFs to the effective BRDF.

use glam::Vec3;

/// What the large scale asks of a material: all it knows of the small scale.
pub trait Reflectance: Sync {
    /// `out[k] = f̄(lights[k], o)` [1/sr], the light's cosine included; 0 where either is under the horizon.
    /// Unit vectors in the tangent frame (x, y along the tile, z the surface normal).
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]);
}
