//! True values by rays from points that are dense where the surface is bright. The surface is cut into pieces, at the
//! texels of an image if there is one, so that no bright texel is left out.

use biscale::brdf::MaterialAssignment;
use biscale::geometry::{ColorField, Facets, PeriodicGrid, TileMesh, is_facet_visible};
use biscale::metrics::Pair;
use glam::{DVec3, UVec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::TrueValues;

/// Work and accuracy of the rays.
#[derive(Debug, Clone, Copy)]
pub struct RayCast {
    /// Points per pass.
    pub points: usize,
    /// Largest number of independent passes. At least eight are computed.
    pub max_passes: usize,
    /// Relative L2 of the standard errors at which the passes end.
    pub target: f64,
}

const MIN_PASSES: usize = 8;
/// Cells along each side of a tile without images, which spread the points over it.
const CELLS: u32 = 64;

/// A part of a triangle within one cell over the tile.
struct Piece {
    triangle: u32,
    slot: u16,
    corners: Vec<DVec3>,
    area: f64,
    /// The largest colour weight in the piece; 0 if its material is black.
    brightness: f64,
    /// Index of the cell along a Morton curve.
    cell: u64,
}

/// The pieces of a surface, and the probability of a point to lie on each.
struct Pieces<'a> {
    mesh: &'a TileMesh,
    pieces: Vec<Piece>,
    probabilities: Vec<f64>,
}

/// Sums over the passes of one pair: `S = Σ ΔA V V f`, `a_v`, and their second moments.
#[derive(Clone, Copy, Default)]
struct Moments {
    s: DVec3,
    a: f64,
    ss: DVec3,
    sa: DVec3,
    aa: f64,
}

/// Estimates f̄ at each pair.
pub fn estimate(mesh: &TileMesh, assigned: &MaterialAssignment, pairs: &[Pair], settings: &RayCast) -> TrueValues {
    // The projected area of a closed surface is known.
    let closed = mesh.closes_plane && mesh.corner_normals.is_none();
    let pieces = Pieces::new(mesh, assigned, closed);
    let grid = PeriodicGrid::new(mesh);
    let mut moments = vec![Moments::default(); pairs.len()];
    let mut found = TrueValues { values: Vec::new(), std_error: f64::INFINITY };
    for pass in 1..=settings.max_passes.max(MIN_PASSES) {
        let points = pieces.points(settings.points, pass as u64);
        moments.par_iter_mut().zip(pairs).for_each(|(moments, pair)| {
            let (mut s, mut a) = (DVec3::ZERO, 0.0);
            for k in 0..points.len() {
                let material = &assigned.materials[assigned.material_of_slot[usize::from(points.slots[k])]];
                let normal = points.normals[k];
                let f = material.brdf.f(normal, pair.i, pair.o) * material.color * points.colors[k];
                let shines = f != Vec3::ZERO;
                if (shines || !closed) && is_facet_visible(&grid, &points, k, pair.o) {
                    let area = f64::from(points.areas[k]);
                    a += area * f64::from(normal.dot(pair.o));
                    if shines && is_facet_visible(&grid, &points, k, pair.i) {
                        s += area * f.as_dvec3();
                    }
                }
            }
            if closed {
                a = f64::from(mesh.base_area() * pair.o.z);
            }
            moments.s += s;
            moments.a += a;
            moments.ss += s * s;
            moments.sa += s * a;
            moments.aa += a * a;
        });
        found = combined(&moments, pass);
        if pass >= MIN_PASSES && found.std_error < settings.target {
            break;
        }
    }
    found
}

/// Returns the ratios of the sums, and the relative L2 of their standard errors.
fn combined(moments: &[Moments], passes: usize) -> TrueValues {
    let n = passes as f64;
    let (mut values, mut errors, mut norm) = (Vec::new(), 0.0, 0.0);
    for m in moments {
        let ratio = if m.a > 0.0 { m.s / m.a } else { DVec3::ZERO };
        // The variance of `S - ratio a` over the passes.
        let residual = (m.ss - 2.0 * ratio * m.sa + ratio * ratio * m.aa).max(DVec3::ZERO);
        let mean_area = (m.a / n).max(f64::MIN_POSITIVE);
        errors += residual.element_sum() / (n * (n - 1.0).max(1.0)) / mean_area.powi(2);
        norm += ratio.length_squared();
        values.push(ratio.as_vec3());
    }
    TrueValues { values, std_error: if norm > 0.0 { (errors / norm).sqrt() } else { 0.0 } }
}

impl<'a> Pieces<'a> {
    /// Cuts the surface. With `only_bright`, black pieces are left out.
    fn new(mesh: &'a TileMesh, assigned: &MaterialAssignment, only_bright: bool) -> Self {
        let (cells, offset) = match (&mesh.color, &mesh.painted_slots) {
            (ColorField::Image { size, .. }, _) => (*size, 0.5),
            (_, Some(slots)) => (slots.size, 0.0),
            _ => (UVec2::splat(CELLS), 0.0),
        };
        let mut pieces: Vec<Piece> = Vec::new();
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let size = mesh.size.as_dvec2() / cells.as_dvec2();
            let at = corners.map(|corner| corner.truncate() / size - offset);
            let (low, high) = (at[0].min(at[1]).min(at[2]).floor(), at[0].max(at[1]).max(at[2]).ceil());
            for j in low.y as i64..(high.y as i64).max(low.y as i64 + 1) {
                for i in low.x as i64..(high.x as i64).max(low.x as i64 + 1) {
                    let color = largest_color(mesh, i, j);
                    if only_bright && color == 0.0 {
                        continue;
                    }
                    let mut corners = corners.to_vec();
                    for (axis, cell, size) in [(0, i, size.x), (1, j, size.y)] {
                        let low = (cell as f64 + offset) * size;
                        clip(&mut corners, |p| p[axis] - low);
                        clip(&mut corners, |p| low + size - p[axis]);
                    }
                    let area = fan(&corners).map(|corners| area(&corners)).sum::<f64>();
                    if area > 0.0 {
                        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
                        let slot = mesh.slot_at(triangle, centre.truncate().as_vec2());
                        let is_black = assigned.materials[assigned.material_of_slot[usize::from(slot)]].is_black();
                        let brightness = if is_black { 0.0 } else { color };
                        let cell = morton(i.rem_euclid(cells.x.into()) as u64, j.rem_euclid(cells.y.into()) as u64);
                        pieces.push(Piece { triangle: triangle as u32, slot, corners, area, brightness, cell });
                    }
                }
            }
        }
        pieces.retain(|piece| !only_bright || piece.brightness > 0.0);
        pieces.sort_by_key(|piece| (piece.slot, piece.cell, piece.triangle));
        let probabilities = probabilities(&pieces);
        Self { mesh, pieces, probabilities }
    }

    /// Returns a systematic sample of the pieces with a random point in each.
    fn points(&self, count: usize, seed: u64) -> Facets {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let shift: f64 = random.random();
        let (mut points, mut sum) = (Facets::default(), 0.0);
        for (piece, probability) in self.pieces.iter().zip(&self.probabilities) {
            sum += probability * count as f64;
            while (points.len() as f64) + shift < sum {
                let at = random_point(&piece.corners, &mut random).as_vec3();
                let size = self.mesh.size;
                let wrapped = at.truncate() - size * (at.truncate() / size).floor();
                let wrapped = wrapped.min(size * (1.0 - f32::EPSILON));
                let normal = self.mesh.geometric_normal(piece.triangle as usize);
                points.positions.push(wrapped.extend(at.z));
                points.normals.push(normal);
                points.geometric_normals.push(normal);
                points.areas.push((piece.area / (probability * count as f64)) as f32);
                points.slots.push(piece.slot);
                points.colors.push(self.mesh.color.at(wrapped, size));
                points.triangles.push(piece.triangle);
            }
        }
        points
    }
}

/// Returns the probability of each piece: one third by area, one third by area times brightness, and one third by the
/// same with equal shares of the slots.
fn probabilities(pieces: &[Piece]) -> Vec<f64> {
    let light = |piece: &Piece| piece.area * piece.brightness;
    let slots = pieces.iter().map(|piece| usize::from(piece.slot) + 1).max().unwrap_or(0);
    let mut of_slot = vec![0.0; slots];
    pieces.iter().for_each(|piece| of_slot[usize::from(piece.slot)] += light(piece));
    let (area, all) = (pieces.iter().map(|piece| piece.area).sum::<f64>(), of_slot.iter().sum::<f64>());
    let bright_slots = of_slot.iter().filter(|&&light| light > 0.0).count().max(1) as f64;
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    let weights = pieces.iter().map(|piece| {
        let in_slot = share(light(piece), of_slot[usize::from(piece.slot)]) / bright_slots;
        share(piece.area, area) + share(light(piece), all) + in_slot
    });
    let weights: Vec<f64> = weights.collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// Returns the largest colour weight in a cell between the centres of four texels.
fn largest_color(mesh: &TileMesh, i: i64, j: i64) -> f64 {
    let ColorField::Image { size, texels } = &mesh.color else { return 1.0 };
    let texel = |x: i64, y: i64| {
        let (x, y) = (x.rem_euclid(size.x.into()), y.rem_euclid(size.y.into()));
        texels[(y * i64::from(size.x) + x) as usize].max_element()
    };
    [texel(i, j), texel(i + 1, j), texel(i, j + 1), texel(i + 1, j + 1)].into_iter().fold(0.0, f32::max).into()
}

/// Cuts off the part of a convex polygon where `side` is negative.
fn clip(corners: &mut Vec<DVec3>, side: impl Fn(DVec3) -> f64) {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (k, &corner) in corners.iter().enumerate() {
        let next = corners[(k + 1) % corners.len()];
        let (here, there) = (side(corner), side(next));
        if here >= 0.0 {
            kept.push(corner);
        }
        if here * there < 0.0 {
            kept.push(corner.lerp(next, here / (here - there)));
        }
    }
    *corners = kept;
}

/// Returns the triangles of a convex polygon.
fn fan(corners: &[DVec3]) -> impl Iterator<Item = [DVec3; 3]> {
    (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]])
}

fn area([a, b, c]: &[DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

fn random_point(corners: &[DVec3], random: &mut ChaCha8Rng) -> DVec3 {
    let mut rest = random.random::<f64>() * fan(corners).map(|corners| area(&corners)).sum::<f64>();
    let chosen = fan(corners).find(|corners| {
        rest -= area(corners);
        rest <= 0.0
    });
    let [a, b, c] = chosen.unwrap_or([corners[0], corners[1], corners[2]]);
    let (u, v): (f64, f64) = (random.random(), random.random());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    a + (b - a) * u + (c - a) * v
}

/// Interleaves the bits of two numbers below 4096.
fn morton(x: u64, y: u64) -> u64 {
    (0..12).map(|bit| (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1)).sum()
}
