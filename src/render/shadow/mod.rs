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
mod tests {
    use super::*;
    use crate::render::object;
    use crate::scene;

    fn object(kind: &str) -> ObjectMesh {
        object::build(&scene::Object { kind: kind.to_owned(), path: None }, std::path::Path::new(".")).unwrap()
    }

    #[test]
    fn only_objects_with_dents_or_insides_can_shadow_themselves() {
        let expected =
            [("sphere", false), ("cylinder", false), ("cup", true), ("plate", true), ("skirt", true), ("teapot", true)];
        for (kind, shadows) in expected {
            assert_eq!(can_self_shadow(&object(kind)), shadows, "{kind}");
        }
        let mut dented = object("sphere");
        dented.positions[3000] *= 0.99;
        assert!(can_self_shadow(&dented));
        let mut flat =
            ObjectMesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE - Vec3::Z], ..ObjectMesh::default() };
        (flat.triangles, flat.two_sided) = (vec![[0, 1, 2], [1, 3, 2]], true);
        assert!(!can_self_shadow(&flat));
        flat.positions[3].z = 0.2;
        assert!(can_self_shadow(&flat));
    }

    fn points_on(mesh: &ObjectMesh, count: usize) -> ShadingPoints {
        let mut points = ShadingPoints::default();
        for k in 0..count {
            let triangle = k * mesh.triangles.len() / count;
            let [u, v, w] = [0.2, 0.3, 0.5];
            let mix = |values: &[Vec3]| {
                let [a, b, c] = mesh.triangles[triangle].map(|i| values[i as usize]);
                a * u + b * v + c * w
            };
            points.positions.push(mix(&mesh.positions));
            points.normals.push(mix(&mesh.normals).normalize());
            points.triangles.push(triangle as u32);
            points.pixels.push(k as u32);
        }
        points
    }

    #[test]
    fn every_light_above_the_smooth_horizon_of_a_coarse_sphere_is_visible_if_rays_are_cast() {
        let mesh = object("sphere");
        let occluder = Occluder::new(&mesh);
        let points = points_on(&mesh, 2000);
        let lights: Vec<_> = [Vec3::X, Vec3::Y, Vec3::new(0.6, -0.48, 0.64)]
            .map(|direction| DirectionalLight { direction, irradiance: Vec3::ONE })
            .to_vec();
        let visibility = occluder.visible_lights(&mesh, &points, &lights, Vec3::ZERO, None);
        for point in 0..points.len() {
            for (k, light) in lights.iter().enumerate() {
                let above = light.direction.dot(points.normals[point]);
                // A ray that grazes within a tenth of a degree may touch the polygons' edges.
                if above.abs() > 2e-3 {
                    assert_eq!(visibility.is_lit(point, k), above > 0.0, "{above}");
                }
            }
        }
    }

    #[test]
    fn the_inside_of_a_cup_is_dark_from_the_side_and_lit_from_above() {
        let mesh = object("cup");
        let occluder = Occluder::if_needed(&mesh).unwrap();
        let bottom = (0..mesh.triangles.len()).find(|&k| {
            let p = mesh.corners(k).iter().sum::<Vec3>() / 3.0;
            (p.y - 0.06).abs() < 1e-3 && p.x.hypot(p.z) < 0.2
        });
        let triangle = bottom.unwrap();
        let points = ShadingPoints {
            pixels: vec![0],
            positions: vec![mesh.corners(triangle).iter().sum::<Vec3>() / 3.0],
            normals: vec![Vec3::Y],
            triangles: vec![triangle as u32],
            ..ShadingPoints::default()
        };
        let light =
            |x: f32, y: f32| DirectionalLight { direction: Vec3::new(x, y, 0.0).normalize(), irradiance: Vec3::ONE };
        let visibility = occluder.visible_lights(
            &mesh,
            &points,
            &[light(0.0, 1.0), light(1.0, 1.0), light(0.2, 1.0), light(0.0, -1.0)],
            Vec3::Y,
            None,
        );
        assert_eq!([0, 1, 2, 3].map(|k| visibility.is_lit(0, k)), [true, false, true, false]);
    }

    #[test]
    fn the_cache_agrees_with_cast_rays() {
        for kind in ["cup", "skirt", "teapot"] {
            let mesh = object(kind);
            let occluder = Occluder::if_needed(&mesh).unwrap();
            let camera = scene::Camera::default();
            let view = crate::render::CameraView::new(&camera, &mesh, [96, 96]).unwrap();
            let points = ShadingPoints::new(&crate::render::GBuffer::new(&mesh, &view, 1), &view, 1);
            let environment = crate::render::lighting::environment::load("studio", std::path::Path::new(".")).unwrap();
            let lights = crate::render::lighting::environment::split(&environment.map, 40);
            let cache = occluder.cache(&mesh, &lights);
            let cast = occluder.visible_lights(&mesh, &points, &lights, view.eye, None);
            let cached = occluder.visible_lights(&mesh, &points, &lights, view.eye, Some(&cache));
            let wrong: u32 = cast.words.iter().zip(&cached.words).map(|(a, b)| (a ^ b).count_ones()).sum();
            let share = f64::from(wrong) / (points.len() * lights.len()) as f64;
            eprintln!("{kind}: {:.4} % of point-light pairs differ", 100.0 * share);
            assert!(share < 0.002, "{kind}: {share}");
            assert_ne!(cached.words, LightVisibility::none(points.len(), lights.len()).words);
        }
    }
}
