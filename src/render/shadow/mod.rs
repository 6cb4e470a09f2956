//! Shadows of the object on itself: which lights each shading point sees.

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

/// Rays start this many radii of the object above the surface.
pub(crate) const LIFT: f32 = 2e-4;
/// A vertex may stand this many radii above a face's plane without counting as a dent.
const FLAT: f32 = 2e-5;
/// Vertices tested at once.
const BLOCK: usize = 256;
/// Points whose rays are cast together.
const NEIGHBOURS: usize = 64;
/// Meshes for which the exact test of convexity is too long (triangles times vertices) count as concave.
const MAX_TESTS: usize = 1_000_000_000;

/// Whether any part of the object can stand between another part and a light. A convex object lit and seen from outside
/// cannot shadow itself: no vertex is above the plane of any triangle (tested for every pair, up to rounding). Of an open
/// surface the inside is seen too, so only a flat one passes.
pub fn can_self_shadow(mesh: &ObjectMesh) -> bool {
    if mesh.triangles.len().saturating_mul(mesh.positions.len()) > MAX_TESTS {
        return true;
    }
    let allowed = FLAT * mesh.bounds.radius;
    // Coordinates apart and in blocks, so that the inner loop is plain arithmetic on whole vectors.
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

/// One bit per point and light.
#[derive(Debug, Clone, PartialEq)]
pub struct Visible {
    words_per_point: usize,
    /// Light `k` of a point is bit `k % 32` of its word `k / 32`.
    pub words: Vec<u32>,
}

impl Visible {
    /// Words that a point's bits for so many lights take.
    pub fn words_of(lights: usize) -> usize {
        lights.div_ceil(32).max(1)
    }

    /// No point sees any light.
    pub fn none(points: usize, lights: usize) -> Self {
        let words_per_point = Self::words_of(lights);
        Self { words_per_point, words: vec![0; points * words_per_point] }
    }

    pub fn words_per_point(&self) -> usize {
        self.words_per_point
    }

    pub fn sees(&self, point: usize, light: usize) -> bool {
        self.words[point * self.words_per_point + light / 32] >> (light % 32) & 1 == 1
    }
}

/// What is needed to shadow an object by itself; made once per mesh.
#[derive(Debug, Clone)]
pub struct Occluder {
    /// As the GPU walks it.
    pub(crate) bvh: Bvh,
    wide: WideBvh,
}

impl Occluder {
    /// `None` where the object cannot shadow itself, which then costs nothing.
    pub fn of(mesh: &ObjectMesh) -> Option<Self> {
        can_self_shadow(mesh).then(|| Self::always(mesh))
    }

    /// One for any object, convex or not.
    pub fn always(mesh: &ObjectMesh) -> Self {
        let bvh = Bvh::new(mesh);
        Self { wide: WideBvh::new(&bvh), bvh }
    }

    /// Worth making where the camera moves about the same mesh and lights, and mostly already for one picture whose
    /// shading points outnumber the mesh's vertices (measured: plate 385 ms with, 1140 without; bunny 1470 and 1025).
    pub fn cache(&self, mesh: &ObjectMesh, lights: &[DirectionalLight]) -> ShadowCache {
        ShadowCache::new(mesh, &self.wide, lights, LIFT * mesh.bounds.radius)
    }

    /// One bit per point and light: whether the light is above the point's shading horizon and nothing is in between.
    /// `eye` tells the sides of a two-sided surface apart; `cache` is one of the same mesh and lights.
    pub fn visible(
        &self,
        mesh: &ObjectMesh,
        points: &ShadingPoints,
        lights: &[DirectionalLight],
        eye: Vec3,
        cache: Option<&ShadowCache>,
    ) -> Visible {
        let mut visible = Visible::none(points.len(), lights.len());
        let words = visible.words_per_point();
        visible.words.par_chunks_mut(words * NEIGHBOURS).enumerate().for_each(|(chunk, bits)| {
            let first = chunk * NEIGHBOURS;
            let starts: Vec<_> = (first..first + bits.len() / words)
                .map(|point| {
                    let triangle = points.triangles[point] as usize;
                    (ray_origin(mesh, triangle, points.positions[point], eye), triangle, points.normals[point])
                })
                .collect();
            // Light by light: rays side by side take the same way through the hierarchy.
            for (light, towards) in lights.iter().enumerate() {
                let mut last = 0;
                for (&((origin, back), triangle, normal), bits) in starts.iter().zip(bits.chunks_mut(words)) {
                    let seen = towards.direction.dot(normal) > 0.0
                        && cache
                            .and_then(|cache| cache.sees(triangle, back, light))
                            .unwrap_or_else(|| !self.wide.is_blocked(origin, towards.direction, &mut last));
                    bits[light / 32] |= u32::from(seen) << (light % 32);
                }
            }
        });
        visible
    }
}

/// Where shadow rays of a point start: lifted from the flat triangle to the curved surface that the vertex normals describe
/// (Hanika 2021, "Hacking the Shadow Terminator"), so that the facets of a smooth object cast no steps on themselves.
/// Also whether the back of the triangle is the side that faces the eye (shading normals cannot tell: they may lean away).
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
    fn a_sphere_sees_every_light_above_its_smooth_horizon_even_when_coarse_and_not_skipped() {
        let mesh = object("sphere");
        let occluder = Occluder::always(&mesh);
        let points = points_on(&mesh, 2000);
        let lights: Vec<_> = [Vec3::X, Vec3::Y, Vec3::new(0.6, -0.48, 0.64)]
            .map(|direction| DirectionalLight { direction, irradiance: Vec3::ONE })
            .to_vec();
        let visible = occluder.visible(&mesh, &points, &lights, Vec3::ZERO, None);
        for point in 0..points.len() {
            for (k, light) in lights.iter().enumerate() {
                let above = light.direction.dot(points.normals[point]);
                // A ray that grazes within a tenth of a degree may touch the polygons' edges.
                if above.abs() > 2e-3 {
                    assert_eq!(visible.sees(point, k), above > 0.0, "{above}");
                }
            }
        }
    }

    #[test]
    fn the_inside_of_a_cup_is_dark_from_the_side_and_lit_from_above() {
        let mesh = object("cup");
        let occluder = Occluder::of(&mesh).unwrap();
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
        let visible = occluder.visible(
            &mesh,
            &points,
            &[light(0.0, 1.0), light(1.0, 1.0), light(0.2, 1.0), light(0.0, -1.0)],
            Vec3::Y,
            None,
        );
        assert_eq!([0, 1, 2, 3].map(|k| visible.sees(0, k)), [true, false, true, false]);
    }

    #[test]
    fn the_cache_answers_as_the_rays_do() {
        for kind in ["cup", "skirt", "teapot"] {
            let mesh = object(kind);
            let occluder = Occluder::of(&mesh).unwrap();
            let camera = scene::Camera::default();
            let view = crate::render::CameraView::new(&camera, &mesh, [96, 96]).unwrap();
            let points = ShadingPoints::new(&crate::render::GBuffer::new(&mesh, &view, 1), &view, 1);
            let environment = crate::render::lighting::environment::load("studio", std::path::Path::new(".")).unwrap();
            let lights = crate::render::lighting::environment::split(&environment.map, 40);
            let cache = occluder.cache(&mesh, &lights);
            let cast = occluder.visible(&mesh, &points, &lights, view.eye, None);
            let cached = occluder.visible(&mesh, &points, &lights, view.eye, Some(&cache));
            let wrong: u32 = cast.words.iter().zip(&cached.words).map(|(a, b)| (a ^ b).count_ones()).sum();
            let share = f64::from(wrong) / (points.len() * lights.len()) as f64;
            eprintln!("{kind}: {:.4} % of point-light pairs differ", 100.0 * share);
            assert!(share < 0.002, "{kind}: {share}");
            assert_ne!(cached.words, Visible::none(points.len(), lights.len()).words);
        }
    }
}
