//! Toroidal shadow maps on the CPU (Wu et al. 2011, Sec. 3.3). The twin on the GPU,
//! `shaders/visibility/shadow_map.wgsl`, runs the same algorithm texel by texel.
//!
//! One map per direction covers the endlessly repeated tile (see [`super::shadow_view`]). Each texel is one ray and
//! stores its highest hit and the triangle of that hit. A facet tests the four rays around its own. If they disagree,
//! the facet is at a silhouette, and the bilinear weights decide.
//!
//! Depth biases are not needed, because the triangle is known. A hit `P` on triangle k blocks a facet at `p` if both
//! conditions hold: `P` is in front of the facet's plane, and the facet's ray meets the plane of triangle k in front of
//! `p`. The neighbourhood of a facet never meets the first condition if it is convex, nor the second if it is concave.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::PackedVisibility;
use super::shadow_view::{ShadowView, affordable_resolution, max_coordinate};
use crate::base::Cancel;
use crate::geometry::{Facets, TileMesh};

/// Computes the visibility of all facets along all directions from toroidal shadow maps; `resolution` is the number of
/// texels along the side of a square tile.
///
/// A facet is visible if its geometric normal faces the direction and nothing of the tiling lies in front of it.
/// Triangles block on both sides. No facet is visible from a direction at or below the horizon. The result does not
/// depend on the number of threads.
pub fn visibility_maps_cpu(mesh: &TileMesh, facets: &Facets, directions: &[Vec3], resolution: u32) -> PackedVisibility {
    cancellable_maps_cpu(mesh, facets, directions, resolution, &Cancel::default())
}

/// Computes visibility like [`visibility_maps_cpu`], and counts the directions as steps. The result is invalid if
/// `cancel` is set.
pub(crate) fn cancellable_maps_cpu(
    mesh: &TileMesh,
    facets: &Facets,
    directions: &[Vec3],
    resolution: u32,
    cancel: &Cancel,
) -> PackedVisibility {
    let mut visibility = PackedVisibility::new(facets.len(), directions.len());
    if facets.is_empty() {
        return visibility;
    }
    let resolution = affordable_resolution(mesh, resolution);
    let normals: Vec<Vec3> = (0..mesh.triangles.len()).map(|k| mesh.geometric_normal(k)).collect();
    let max_coordinate = max_coordinate(mesh);
    let words = visibility.words_per_row();
    visibility.words.par_chunks_mut(words).zip(directions).for_each_init(
        ShadowMap::default,
        |map, (row, &direction)| {
            if cancel.is_set() {
                return;
            }
            if let Some(view) = ShadowView::new(mesh.size, max_coordinate, direction, resolution) {
                map.draw(mesh, &view);
                map.test(facets, &normals, &view, row);
            }
            cancel.step(directions.len());
        },
    );
    visibility
}

/// Buffers for one direction, reused for the next.
#[derive(Debug, Default)]
struct ShadowMap {
    /// Each texel holds the bits of the height above the mesh's lowest point, then the triangle's index plus 1, or 0 if
    /// there is no surface. The maximum is stored, so the order of drawing does not matter.
    texels: Vec<u64>,
    /// Vertices in texel coordinates, and their heights above the lowest point.
    vertices: Vec<Vec3>,
    lowest: f32,
}

impl ShadowMap {
    fn draw(&mut self, mesh: &TileMesh, view: &ShadowView) {
        self.lowest = mesh.z_range().0;
        self.texels.clear();
        self.texels.resize(view.texels(), 0);
        self.vertices.clear();
        self.vertices.extend(mesh.positions.iter().map(|&p| view.texel(p).extend(p.z - self.lowest)));
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| self.vertices[vertex as usize]);
            draw_triangle(&mut self.texels, view.size, corners, index as u32 + 1);
        }
    }

    /// Sets the bits of the facets that are visible from the direction.
    fn test(&self, facets: &Facets, normals: &[Vec3], view: &ShadowView, row: &mut [u32]) {
        for (s, (&p, &n)) in facets.positions.iter().zip(&facets.geometric_normals).enumerate() {
            if n.dot(view.direction) > 0.0 && self.blocked_weight(p, n, normals, view) < 0.5 {
                row[s / 32] |= 1 << (s % 32);
            }
        }
    }

    /// Sums the bilinear weights of the rays around `p` on which something blocks the facet.
    fn blocked_weight(&self, p: Vec3, n: Vec3, normals: &[Vec3], view: &ShadowView) -> f32 {
        let at = view.texel(p);
        let base = at.floor();
        let f = at - base;
        let [columns, rows] = view.size;
        let per_height = 1.0 / view.direction.z;
        let n_dot_w = n.dot(view.direction) * per_height;
        let mut weight = 0.0;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let x = wrap(base.x as i32 + dx, columns);
            let y = wrap(base.y as i32 + dy, rows);
            let texel = self.texels[y * columns as usize + x];
            let Some(&n_k) = (texel as u32).checked_sub(1).and_then(|k| normals.get(k as usize)) else {
                continue;
            };
            // The offset from p to the hit: a step on the base plane, then a step along the direction.
            let step = Vec2::new(dx as f32, dy as f32) - f;
            let across = step.x * view.plane_from_texel[0] + step.y * view.plane_from_texel[1];
            let up = f32::from_bits((texel >> 32) as u32) - (p.z - self.lowest);
            let front_of_facet = n.truncate().dot(across) + up * n_dot_w;
            let facing = n_k.dot(view.direction) * per_height;
            let plane_in_front = (n_k.truncate().dot(across) + up * facing) * facing.signum();
            if front_of_facet > view.tolerance && plane_in_front > view.tolerance {
                let (wx, wy) = (if dx == 1 { f.x } else { 1.0 - f.x }, if dy == 1 { f.y } else { 1.0 - f.y });
                weight += wx * wy;
            }
        }
        weight
    }
}

fn wrap(texel: i32, size: u32) -> usize {
    texel.rem_euclid(size as i32) as usize
}

/// Draws one triangle (x and y in texels, z the height) over the torus, into each texel that has its centre in the
/// triangle or on an edge.
fn draw_triangle(texels: &mut [u64], [columns, rows]: [u32; 2], corners: [Vec3; 3], tag: u32) {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let area = ab.x * ac.y - ab.y * ac.x;
    if area == 0.0 || !area.is_finite() {
        return;
    }
    // The height is linear over the map. It is clamped to the corners' range because edge-on triangles are steep.
    let slope_x = (ab.z * ac.y - ac.z * ab.y) / area;
    let slope_y = (ac.z * ab.x - ab.z * ac.x) / area;
    let (z_lo, z_hi) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
    let y_lo = a.y.min(b.y).min(c.y).ceil() as i32;
    let y_hi = a.y.max(b.y).max(c.y).floor() as i32;
    let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];
    for row in y_lo..=y_hi {
        let y = row as f32;
        let (mut left, mut right) = (f32::INFINITY, f32::NEG_INFINITY);
        for edge in &edges {
            edge.widen(y, &mut left, &mut right);
        }
        let row_start = wrap(row, rows) * columns as usize;
        let first = left.ceil() as i32;
        let mut column = wrap(first, columns);
        let start = a.z + (y - a.y) * slope_y;
        for x in first..=right.floor() as i32 {
            let z = (start + (x as f32 - a.x) * slope_x).max(z_lo).min(z_hi).abs();
            let texel = &mut texels[row_start + column];
            *texel = (*texel).max(u64::from(z.to_bits()) << 32 | u64::from(tag));
            column += 1;
            if column == columns as usize {
                column = 0;
            }
        }
    }
}

/// An edge as a function x(y), with its ends in order of y.
struct Edge {
    low: Vec2,
    high: Vec2,
    x_per_y: f32,
}

impl Edge {
    fn new(a: Vec3, b: Vec3) -> Self {
        let (low, high) = if a.y <= b.y { (a.truncate(), b.truncate()) } else { (b.truncate(), a.truncate()) };
        let rise = high.y - low.y;
        Self { low, high, x_per_y: if rise > 0.0 { (high.x - low.x) / rise } else { 0.0 } }
    }

    /// Widens the span of the row at `y` to its crossing with the edge.
    fn widen(&self, y: f32, left: &mut f32, right: &mut f32) {
        if y < self.low.y || y > self.high.y {
            return;
        }
        let x = (self.low.x + (y - self.low.y) * self.x_per_y)
            .clamp(self.low.x.min(self.high.x), self.low.x.max(self.high.x));
        *left = left.min(x);
        *right = right.max(x);
        if self.low.y == self.high.y {
            *left = left.min(self.low.x.min(self.high.x));
            *right = right.max(self.low.x.max(self.high.x));
        }
    }
}
