//! Self-shadowing of the object: the lights that are visible from each shading point.

pub(crate) mod bvh;
pub mod shadow_cache;
pub(crate) mod wide_bvh;

use glam::Vec3;
use rayon::prelude::*;

use self::bvh::Bvh;
use self::shadow_cache::ShadowCache;
use self::wide_bvh::WideBvh;
use super::image::shading_points::ShadingPoints;
use super::{DirectionalLight, ObjectMesh};

/// Height of the start of a ray above the surface, in radii of the object.
pub(crate) const LIFT: f32 = 2e-4;
/// Bounds the height of a vertex above a face's plane up to which a mesh counts as convex, in radii of the object.
const CONVEX_TOLERANCE: f32 = 2e-5;
/// Vertices per block of the convexity test.
const BLOCK: usize = 256;
/// Points per task.
const CHUNK: usize = 64;
/// Bounds the work of the exact convexity test (triangles times vertices). Larger meshes count as concave.
const MAX_TESTS: usize = 1_000_000_000;

/// Returns whether one part of the object can block light from another part. A closed convex object cannot shadow
/// itself: no vertex is above the plane of any triangle, which is tested for every pair, up to rounding. The inside of
/// an open surface is visible, too, so an open surface cannot shadow itself only if it is flat.
pub fn can_self_shadow(mesh: &ObjectMesh) -> bool {
    if mesh.triangles.len().saturating_mul(mesh.positions.len()) > MAX_TESTS {
        return true;
    }
    let allowed = CONVEX_TOLERANCE * mesh.bounds.radius;
    // Separate coordinates in blocks, so that the compiler vectorizes the inner loop.
    let axes: [Vec<f32>; 3] = std::array::from_fn(|axis| mesh.positions.iter().map(|p| p[axis]).collect());
    (0..mesh.triangles.len()).into_par_iter().any(|triangle| {
        let [a, b, c] = mesh.corners(triangle);
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or_zero().as_vec3();
        let level = normal.dot(a);
        let blocks = axes[0].chunks(BLOCK).zip(axes[1].chunks(BLOCK)).zip(axes[2].chunks(BLOCK));
        blocks.into_iter().any(|((xs, ys), zs)| {
            let (mut low, mut high) = (level, level);
            for ((x, y), z) in xs.iter().zip(ys).zip(zs) {
                let height = normal.x * x + normal.y * y + normal.z * z;
                low = if height < low { height } else { low };
                high = if height > high { height } else { high };
            }
            high - level > allowed || (mesh.two_sided && level - low > allowed)
        })
    })
}

/// One bit per shading point and light: 1 if the light is visible from the point.
#[derive(Debug, Clone, PartialEq)]
pub struct LightVisibility {
    words_per_point: usize,
    /// Bits of the points; light `k` of a point is bit `k % 32` of the point's word `k / 32`.
    pub words: Vec<u32>,
}

impl LightVisibility {
    /// Returns the number of words per point for this many lights.
    pub fn words_of(lights: usize) -> usize {
        lights.div_ceil(32).max(1)
    }

    /// Creates bits that are all 0.
    pub fn none(points: usize, lights: usize) -> Self {
        let words_per_point = Self::words_of(lights);
        Self { words_per_point, words: vec![0; points * words_per_point] }
    }

    /// The lights that are on the side of each point's normal.
    pub fn above_horizon(points: &ShadingPoints, lights: &[DirectionalLight]) -> Self {
        let mut visible = Self::none(points.len(), lights.len());
        visible.words.par_chunks_mut(visible.words_per_point).zip(&points.normals).for_each(|(bits, normal)| {
            for (k, light) in lights.iter().enumerate() {
                bits[k / 32] |= u32::from(light.direction.dot(*normal) > 0.0) << (k % 32);
            }
        });
        visible
    }

    /// Returns true if the same lights are visible from two points.
    pub fn is_same(&self, a: usize, b: usize) -> bool {
        let [a, b] = [a, b].map(|point| &self.words[point * self.words_per_point..][..self.words_per_point]);
        a == b
    }

    pub fn words_per_point(&self) -> usize {
        self.words_per_point
    }

    pub fn is_lit(&self, point: usize, light: usize) -> bool {
        self.words[point * self.words_per_point + light / 32] >> (light % 32) & 1 == 1
    }
}

/// The ray-casting structures for self-shadowing; built once per mesh.
#[derive(Debug, Clone)]
pub struct Occluder {
    /// The hierarchy that the GPU traverses.
    #[cfg(feature = "gpu")]
    pub(crate) bvh: Bvh,
    wide: WideBvh,
}

impl Occluder {
    /// Builds an occluder only if the object can shadow itself.
    pub fn if_needed(mesh: &ObjectMesh) -> Option<Self> {
        can_self_shadow(mesh).then(|| Self::new(mesh))
    }

    /// Builds an occluder for any object, convex or not.
    pub fn new(mesh: &ObjectMesh) -> Self {
        let bvh = Bvh::new(mesh);
        Self {
            wide: WideBvh::new(&bvh),
            #[cfg(feature = "gpu")]
            bvh,
        }
    }

    /// Computes a cache for one mesh and its lights. It saves time if several images follow, and usually for one image
    /// if its shading points outnumber the vertices of the mesh.
    pub fn cache(&self, mesh: &ObjectMesh, lights: &[DirectionalLight]) -> ShadowCache {
        ShadowCache::new(mesh, &self.wide, lights, LIFT * mesh.bounds.radius)
    }

    /// Computes the lights that are above each point's shading horizon and not blocked. `eye` selects the visible side
    /// of a two-sided surface. `cache` must belong to the same mesh and lights.
    pub fn visible_lights(
        &self,
        mesh: &ObjectMesh,
        points: &ShadingPoints,
        lights: &[DirectionalLight],
        eye: Vec3,
        cache: Option<&ShadowCache>,
    ) -> LightVisibility {
        let mut visible = LightVisibility::none(points.len(), lights.len());
        let words = visible.words_per_point();
        visible.words.par_chunks_mut(words * CHUNK).enumerate().for_each(|(chunk, bits)| {
            let first = chunk * CHUNK;
            let starts: Vec<_> = (first..first + bits.len() / words)
                .map(|point| {
                    let triangle = points.triangles[point] as usize;
                    (ray_origin(mesh, triangle, points.positions[point], eye), triangle, points.normals[point])
                })
                .collect();
            // The loop over lights is outside, because neighbouring rays traverse the same nodes.
            for (light, towards) in lights.iter().enumerate() {
                let mut last = 0;
                for (&((origin, back), triangle, normal), bits) in starts.iter().zip(bits.chunks_mut(words)) {
                    let is_lit = towards.direction.dot(normal) > 0.0
                        && cache
                            .and_then(|cache| cache.is_lit(triangle, back, light))
                            .unwrap_or_else(|| !self.wide.is_blocked(origin, towards.direction, &mut last));
                    bits[light / 32] |= u32::from(is_lit) << (light % 32);
                }
            }
        });
        visible
    }
}

/// Returns the origin of a point's shadow rays, and whether the back of the triangle faces the eye. The origin is
/// lifted from the flat triangle to the curved surface that the vertex normals describe, so that the triangles of a
/// smooth object cast no stepped shadows (Hanika 2021, "Hacking the Shadow Terminator"). Shading normals cannot decide
/// the side, because they may point away from the eye.
pub(crate) fn ray_origin(mesh: &ObjectMesh, triangle: usize, p: Vec3, eye: Vec3) -> (Vec3, bool) {
    let corners = mesh.corners(triangle);
    let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let per_area = 1.0 / area.length_squared().max(f32::MIN_POSITIVE);
    let back = mesh.two_sided && area.dot(eye - corners[0]) < 0.0;
    let facing = if back { -1.0 } else { 1.0 };
    let mut lift = Vec3::ZERO;
    for (k, corner) in corners.into_iter().enumerate() {
        let (next, last) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let weight = ((next - p).cross(last - p).dot(area) * per_area).clamp(0.0, 1.0);
        let vertex_normal = mesh.normals[mesh.triangles[triangle][k] as usize] * facing;
        lift -= vertex_normal * (weight * (p - corner).dot(vertex_normal).min(0.0));
    }
    (p + lift + area.normalize_or_zero() * (facing * LIFT * mesh.bounds.radius), back)
}

#[cfg(test)]
mod tests;
