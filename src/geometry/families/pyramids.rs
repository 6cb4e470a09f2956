//! Pyramids on a floor that is cut out under them, so that the mesh is a height field without hidden parts.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, Vec2};

use super::builder::MeshBuilder;
use crate::geometry::TileMesh;
use crate::scene::{Arrangement, Pyramids};

const FACES: u16 = 0;
const FLOOR: u16 = 1;
/// Maximum number of cells along each side of the tile.
const MAX_CELLS: f64 = 64.0;

pub fn build(spec: &Pyramids, size: Vec2) -> TileMesh {
    let mut builder = MeshBuilder::new(size, &["faces", "floor"]);
    let lattice = Lattice::new(spec, size);
    if let Some(note) = lattice.note(spec) {
        builder.note(note);
    }
    let cell = lattice.cell();
    let pyramid = Pyramid::fitted(spec, &cell);
    for row in 0..lattice.rows {
        for column in 0..lattice.columns {
            let centre = lattice.centre(column, row);
            let at = |corner: DVec2, z: f64| (centre + corner).extend(z);
            for triangle in annulus(&cell, &pyramid.base) {
                builder.polygon(&triangle.map(|corner| at(corner, 0.0)), FLOOR);
            }
            let corners = pyramid.base.len();
            for k in 0..corners {
                let next = (k + 1) % corners;
                let (foot, next_foot) = (at(pyramid.base[k], 0.0), at(pyramid.base[next], 0.0));
                let (top, next_top) = (at(pyramid.top[k], pyramid.top_z), at(pyramid.top[next], pyramid.top_z));
                if spec.truncation > 0.0 {
                    builder.polygon(&[foot, next_foot, next_top, top], FACES);
                } else {
                    builder.polygon(&[foot, next_foot, top], FACES);
                }
            }
            if spec.truncation > 0.0 {
                let top: Vec<_> = pyramid.top.iter().map(|corner| at(*corner, pyramid.top_z)).collect();
                builder.polygon(&top, FACES);
            }
        }
    }
    builder.finish()
}

/// The shape of the pyramids and their centres, for exports of the tile. Lengths are in tile units.
#[derive(Debug, Clone, PartialEq)]
pub struct PyramidLayout {
    /// Corners of the base about the centre, counter-clockwise.
    pub base: Vec<DVec2>,
    /// Corners of the cut tip about the centre, counter-clockwise.
    pub top: Vec<DVec2>,
    pub top_z: f64,
    /// True if the tip is cut.
    pub has_top: bool,
    pub centres: Vec<DVec2>,
}

impl PyramidLayout {
    /// The layout of the pyramids as they fit the tile.
    pub fn of(spec: &Pyramids, size: Vec2) -> Self {
        let lattice = Lattice::new(spec, size);
        let Pyramid { base, top, top_z } = Pyramid::fitted(spec, &lattice.cell());
        let cells = (0..lattice.rows).flat_map(|row| (0..lattice.columns).map(move |column| (column, row)));
        let centres = cells.map(|(column, row)| lattice.centre(column, row)).collect();
        Self { base, top, top_z, has_top: spec.truncation > 0.0, centres }
    }
}

/// The lattice of the pyramids' centres.
struct Lattice {
    columns: usize,
    rows: usize,
    /// Distances between neighbours in a row, and between rows.
    pitch: DVec2,
    shifted: bool,
    hexagonal: bool,
}

impl Lattice {
    fn new(spec: &Pyramids, size: Vec2) -> Self {
        let size = size.as_dvec2();
        let spacing = f64::from(spec.spacing);
        let shifted = spec.arrangement != Arrangement::Square;
        let row_spacing = if spec.arrangement == Arrangement::Hex { spacing * 0.75f64.sqrt() } else { spacing };
        let columns = (size.x / spacing).round().clamp(1.0, MAX_CELLS);
        // Shifted rows need an even number of rows.
        let step = if shifted { 2.0 } else { 1.0 };
        let rows = ((size.y / row_spacing / step).round() * step).clamp(step, MAX_CELLS);
        let pitch = size / DVec2::new(columns, rows);
        let hexagonal = spec.arrangement == Arrangement::Hex && pitch.y > 0.55 * pitch.x;
        Self { columns: columns as usize, rows: rows as usize, pitch, shifted, hexagonal }
    }

    fn note(&self, spec: &Pyramids) -> Option<String> {
        let spacing = f64::from(spec.spacing);
        let row_spacing = if spec.arrangement == Arrangement::Hex { spacing * 0.75f64.sqrt() } else { spacing };
        let off = (self.pitch / DVec2::new(spacing, row_spacing) - 1.0).abs().max_element();
        (off > 1e-3).then(|| {
            format!(
                "pyramids stand {:.4} x {:.4} apart, so that whole cells fit the tile (asked for: {:.4} x {:.4})",
                self.pitch.x, self.pitch.y, spacing, row_spacing
            )
        })
    }

    fn centre(&self, column: usize, row: usize) -> DVec2 {
        let shift = if self.shifted && row % 2 == 1 { 1.0 } else { 0.5 };
        DVec2::new(column as f64 + shift, row as f64 + 0.5) * self.pitch
    }

    /// The cell of one pyramid about its centre, counter-clockwise. Corners of neighbours on an edge are corners of the
    /// cell, too.
    fn cell(&self) -> Vec<DVec2> {
        let half = 0.5 * self.pitch;
        if self.hexagonal {
            // The corners of the Voronoi cell are circumcentres of neighbouring centres.
            let tip = (half.x * half.x + self.pitch.y * self.pitch.y) / (2.0 * self.pitch.y);
            let shoulder = self.pitch.y - tip;
            return vec![
                DVec2::new(half.x, -shoulder),
                DVec2::new(half.x, shoulder),
                DVec2::new(0.0, tip),
                DVec2::new(-half.x, shoulder),
                DVec2::new(-half.x, -shoulder),
                DVec2::new(0.0, -tip),
            ];
        }
        let mut corners = vec![DVec2::new(half.x, -half.y), half];
        if self.shifted {
            corners.push(DVec2::new(0.0, half.y));
        }
        corners.extend([DVec2::new(-half.x, half.y), -half]);
        if self.shifted {
            corners.push(DVec2::new(0.0, -half.y));
        }
        corners
    }
}

/// One pyramid about its centre.
struct Pyramid {
    base: Vec<DVec2>,
    top: Vec<DVec2>,
    top_z: f64,
}

impl Pyramid {
    fn fitted(spec: &Pyramids, cell: &[DVec2]) -> Self {
        let sides = f64::from(spec.sides);
        let rotation = f64::from(spec.rotation_deg).to_radians();
        // Without rotation, a face points along +x.
        let unit: Vec<DVec2> =
            (0..spec.sides).map(|k| DVec2::from_angle(rotation + (TAU * f64::from(k) - PI) / sides)).collect();
        let scale = f64::from(spec.base_size) * largest_scale(&unit, cell);
        let base: Vec<DVec2> = unit.iter().map(|corner| *corner * scale).collect();
        let ratio = f64::from(spec.face_ratio);
        let inradius = scale * (PI / sides).cos();
        let tip = DVec2::from_angle(rotation) * inradius * (1.0 - ratio) / (1.0 + ratio);
        let cut = f64::from(spec.truncation);
        let top = base.iter().map(|corner| tip.lerp(*corner, cut)).collect();
        Self { base, top, top_z: f64::from(spec.height) * (1.0 - cut) }
    }
}

/// The largest factor by which `polygon` can grow about the origin and stay in the convex `cell`.
fn largest_scale(polygon: &[DVec2], cell: &[DVec2]) -> f64 {
    let scale = |k: usize| {
        let (from, to) = (cell[k], cell[(k + 1) % cell.len()]);
        let outward = -(to - from).perp();
        let extent = polygon.iter().map(|corner| corner.dot(outward)).fold(0.0, f64::max);
        from.dot(outward) / extent
    };
    (0..cell.len()).map(scale).fold(f64::INFINITY, f64::min)
}

/// Triangulates the area between two convex loops, the inner one inside the outer one, both counter-clockwise. The
/// edges are merged by direction, as in the lateral surface of the convex hull of the loops at different heights, so no
/// triangle is flipped.
fn annulus(outer: &[DVec2], inner: &[DVec2]) -> Vec<[DVec2; 3]> {
    let mut edges = Vec::new();
    for (is_inner, corners) in [(false, outer), (true, inner)] {
        for k in 0..corners.len() {
            let edge = corners[(k + 1) % corners.len()] - corners[k];
            // The direction is rounded, so that collinear edges share it.
            let direction = (edge.to_angle().rem_euclid(TAU) * 1e9).round() as i64 % (TAU * 1e9) as i64;
            edges.push((direction, is_inner, k));
        }
    }
    edges.sort_unstable();
    let first = |wanted: bool| edges.iter().find(|(_, is_inner, _)| *is_inner == wanted).map_or(0, |edge| edge.2);
    let (mut at_outer, mut at_inner) = (first(false), first(true));
    let mut triangles = Vec::with_capacity(edges.len());
    for (_, is_inner, _) in &edges {
        if *is_inner {
            let next = (at_inner + 1) % inner.len();
            triangles.push([inner[at_inner], outer[at_outer], inner[next]]);
            at_inner = next;
        } else {
            let next = (at_outer + 1) % outer.len();
            triangles.push([outer[at_outer], outer[next], inner[at_inner]]);
            at_outer = next;
        }
    }
    // Triangles without area lie between parts of the outlines that touch.
    let max_length_squared = outer.iter().map(|corner| corner.length_squared()).fold(0.0, f64::max);
    triangles.retain(|[a, b, c]| (*b - *a).perp_dot(*c - *a) > 1e-9 * max_length_squared);
    triangles
}

#[cfg(test)]
#[path = "pyramids_tests.rs"]
mod tests;
