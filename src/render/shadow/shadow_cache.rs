//! Shadows cached between images: per triangle and light, whether the neighbourhood is entirely lit or entirely in
//! shadow.
//!
//! One ray per vertex and light is cast when the cache is built. If the vertices of a triangle and of its neighbours
//! agree, their result applies to all points of the triangle. Elsewhere, at shadow edges and on large triangles, each
//! point casts its own ray, so that shadow edges are as sharp as without the cache.

use glam::Vec3;
use rayon::prelude::*;

use super::wide_bvh::WideBvh;
use crate::render::{DirectionalLight, ObjectMesh};

/// Bounds the edges of a triangle whose result is cached, in radii of the object: a larger triangle may contain a
/// shadow between its vertices.
const MAX_EDGE: f32 = 0.12;

/// The cached shadows of one mesh and one list of lights.
#[derive(Debug, Clone)]
pub struct ShadowCache {
    words_per_triangle: usize,
    /// The front, and the back if the surface is two-sided.
    sides: Vec<Side>,
}

/// Bits per triangle: bit `k % 32` of word `k / 32` belongs to light `k`. Both bits are set only if all vertices face
/// away from the light; such a light is not looked up.
#[derive(Debug, Clone)]
struct Side {
    lit: Vec<u32>,
    dark: Vec<u32>,
}

impl ShadowCache {
    /// Casts a ray from every vertex to every light above its horizon, starting `lift` above the surface.
    pub(crate) fn new(mesh: &ObjectMesh, bvh: &WideBvh, lights: &[DirectionalLight], lift: f32) -> Self {
        let words = lights.len().div_ceil(32).max(1);
        let facing: &[f32] = if mesh.two_sided { &[1.0, -1.0] } else { &[1.0] };
        let side = |&facing: &f32| {
            let normal = |vertex: usize| mesh.normals[vertex] * facing;
            let vertices: Vec<(Vec<u32>, Vec<u32>)> = (0..mesh.positions.len())
                .into_par_iter()
                .with_min_len(64)
                .map_init(
                    || vec![0; lights.len()],
                    |last, vertex| {
                        // A vertex that faces away from a light agrees with both results.
                        let (mut lit, mut dark) = (vec![u32::MAX; words], vec![u32::MAX; words]);
                        let normal = normal(vertex);
                        let origin = mesh.positions[vertex] + normal * lift;
                        for (k, light) in
                            lights.iter().enumerate().filter(|(_, light)| light.direction.dot(normal) > 0.0)
                        {
                            let is_blocked = bvh.is_blocked(origin, light.direction, &mut last[k]);
                            let wrong = if is_blocked { &mut lit } else { &mut dark };
                            wrong[k / 32] &= !(1 << (k % 32));
                        }
                        (lit, dark)
                    },
                )
                .collect();
            let lit: Vec<u32> = vertices.iter().flat_map(|(lit, _)| lit).copied().collect();
            let dark: Vec<u32> = vertices.iter().flat_map(|(_, dark)| dark).copied().collect();
            Side { lit: agreed(mesh, &lit, words), dark: agreed(mesh, &dark, words) }
        };
        Self { words_per_triangle: words, sides: facing.iter().map(side).collect() }
    }

    /// Returns whether the light is visible from all points on this side of the triangle; `None` if each point must
    /// cast a ray.
    pub(crate) fn is_lit(&self, triangle: usize, back: bool, light: usize) -> Option<bool> {
        let side = self.sides.get(usize::from(back))?;
        let (word, bit) = (triangle * self.words_per_triangle + light / 32, 1u32 << (light % 32));
        if side.lit[word] & bit != 0 {
            Some(true)
        } else if side.dark[word] & bit != 0 {
            Some(false)
        } else {
            None
        }
    }
}

/// Returns, per triangle, the bits that all vertices of the triangle and of its neighbours have; 0 for large triangles.
fn agreed(mesh: &ObjectMesh, of_vertices: &[u32], words: usize) -> Vec<u32> {
    let shared = |bits: &[u32], triangle: &[u32; 3], word: usize| {
        triangle.iter().fold(u32::MAX, |all, &vertex| all & bits[vertex as usize * words + word])
    };
    let mut around = vec![u32::MAX; of_vertices.len()];
    for triangle in &mesh.triangles {
        for word in 0..words {
            let all = shared(of_vertices, triangle, word);
            for &vertex in triangle {
                around[vertex as usize * words + word] &= all;
            }
        }
    }
    let longest = MAX_EDGE * mesh.bounds.radius;
    let of_triangle = |k: usize| {
        let [a, b, c]: [Vec3; 3] = mesh.corners(k);
        let small = a.distance(b).max(b.distance(c)).max(c.distance(a)) <= longest;
        let around = &around;
        (0..words).map(move |word| if small { shared(around, &mesh.triangles[k], word) } else { 0 })
    };
    (0..mesh.triangles.len()).flat_map(of_triangle).collect()
}
