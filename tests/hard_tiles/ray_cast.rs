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
/// Cells along each side of a tile without images, and the most layers of its height. They spread the points.
const CELLS: u32 = 64;
/// Pairs of the pilot.
const PILOT_PAIRS: usize = 16;

/// Steps of the R2 sequence: 1/g and 1/g² with the real root g of x³ = x + 1 (Roberts 2018).
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// A part of a triangle within one cell over the tile.
struct Piece {
    triangle: u32,
    slot: u16,
    corners: Vec<DVec3>,
    area: f64,
    /// The largest colour weight in the piece; 0 if its material is black.
    brightness: f64,
    /// Place along a Morton curve through normals and positions.
    place: u64,
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
    let grid = PeriodicGrid::new(mesh);
    let mut pieces = Pieces::new(mesh, assigned, closed);
    pieces.find_probabilities(&grid, assigned, pairs);
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
        let (bottom, top) = mesh.z_range();
        let (bottom, height) = (f64::from(bottom), f64::from(top - bottom).max(1e-9));
        let layer = height.min((f64::from(mesh.size.x) / f64::from(CELLS)).max(height / f64::from(CELLS)));
        let mut pieces: Vec<Piece> = Vec::new();
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let normal = mesh.geometric_normal(triangle);
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
                        between(&mut corners, axis, low, low + size);
                    }
                    let at = [(i, cells.x), (j, cells.y)]
                        .map(|(cell, count)| cell.rem_euclid(count.into()) as f32 / count as f32);
                    let place = morton([0.5 + 0.5 * normal.x, 0.5 + 0.5 * normal.y, at[0], at[1]]);
                    let high = corners.iter().fold(bottom, |high, p| p.z.max(high));
                    let low = corners.iter().fold(high, |low, p| p.z.min(low));
                    let [first, last] = [low, high].map(|z| ((z - bottom) / layer).floor() as usize);
                    for k in first..=last {
                        let mut corners = corners.clone();
                        if first < last {
                            between(&mut corners, 2, bottom + k as f64 * layer, bottom + (k + 1) as f64 * layer);
                        }
                        let area = fan(&corners).map(|corners| area(&corners)).sum::<f64>();
                        if area > 0.0 {
                            let centre = centre(&corners).truncate().as_vec2();
                            let slot = mesh.slot_at(triangle, centre);
                            let is_black = assigned.materials[assigned.material_of_slot[usize::from(slot)]].is_black();
                            let brightness = if is_black { 0.0 } else { color };
                            let triangle = triangle as u32;
                            pieces.push(Piece { triangle, slot, corners, area, brightness, place });
                        }
                    }
                }
            }
        }
        pieces.retain(|piece| !only_bright || piece.brightness > 0.0);
        pieces.sort_by_key(|piece| (piece.slot, piece.place, piece.triangle));
        Self { mesh, pieces, probabilities: Vec::new() }
    }

    /// Sets the probabilities: half by area and brightness, and half by what the pieces reflect at a few pairs.
    fn find_probabilities(&mut self, grid: &PeriodicGrid, assigned: &MaterialAssignment, pairs: &[Pair]) {
        let mut centres = Facets::default();
        self.pieces.iter().for_each(|piece| self.push(&mut centres, piece, centre(&piece.corners), piece.area));
        let reflected = |pair: &Pair| -> Vec<f64> {
            let one = |(k, piece): (usize, &Piece)| {
                let material = &assigned.materials[assigned.material_of_slot[usize::from(piece.slot)]];
                let f = material.brdf.f(centres.normals[k], pair.i, pair.o) * material.color;
                let is_seen = || [pair.o, pair.i].iter().all(|&to| is_facet_visible(grid, &centres, k, to));
                if f != Vec3::ZERO && is_seen() {
                    piece.area * piece.brightness * f64::from(f.max_element())
                } else {
                    0.0
                }
            };
            shares(self.pieces.iter().enumerate().map(one).collect())
        };
        let step = pairs.len().div_ceil(PILOT_PAIRS);
        let pilot: Vec<Vec<f64>> = pairs.par_iter().step_by(step).map(reflected).collect();
        let mut weights = prior(&self.pieces);
        for row in &pilot {
            weights.iter_mut().zip(row).for_each(|(weight, share)| *weight += share / pilot.len() as f64);
        }
        self.probabilities = shares(weights);
    }

    fn push(&self, points: &mut Facets, piece: &Piece, at: DVec3, area: f64) {
        let (at, size) = (at.as_vec3(), self.mesh.size);
        let wrapped = at.truncate() - size * (at.truncate() / size).floor();
        let wrapped = wrapped.min(size * (1.0 - f32::EPSILON));
        let normal = self.mesh.geometric_normal(piece.triangle as usize);
        points.positions.push(wrapped.extend(at.z));
        points.normals.push(normal);
        points.geometric_normals.push(normal);
        points.areas.push(area as f32);
        points.slots.push(piece.slot);
        points.colors.push(self.mesh.color.at(wrapped.extend(at.z), normal, size));
        points.triangles.push(piece.triangle);
    }

    /// Returns a systematic sample of the pieces. The points inside them follow the R2 sequence with a random shift.
    fn points(&self, count: usize, seed: u64) -> Facets {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let [shift, u, v]: [f64; 3] = random.random();
        let (mut points, mut sum) = (Facets::default(), 0.0);
        for (piece, probability) in self.pieces.iter().zip(&self.probabilities) {
            sum += probability * count as f64;
            while (points.len() as f64) + shift < sum {
                let k = points.len() as f64;
                let at = point(&piece.corners, (u + k * R2[0]).fract(), (v + k * R2[1]).fract());
                self.push(&mut points, piece, at, piece.area / (probability * count as f64));
            }
        }
        points
    }
}

/// Returns a share of each piece: one third by area, one third by area times brightness, and one third by the same with
/// equal shares of the slots.
fn prior(pieces: &[Piece]) -> Vec<f64> {
    let light = |piece: &Piece| piece.area * piece.brightness;
    let slots = pieces.iter().map(|piece| usize::from(piece.slot) + 1).max().unwrap_or(0);
    let mut of_slot = vec![0.0; slots];
    pieces.iter().for_each(|piece| of_slot[usize::from(piece.slot)] += light(piece));
    let by_slot = |piece: &Piece| light(piece) / of_slot[usize::from(piece.slot)].max(f64::MIN_POSITIVE);
    let parts = [
        shares(pieces.iter().map(|piece| piece.area).collect()),
        shares(pieces.iter().map(light).collect()),
        shares(pieces.iter().map(by_slot).collect()),
    ];
    (0..pieces.len()).map(|k| parts.iter().map(|part| part[k] / 3.0).sum()).collect()
}

/// Divides weights by their sum, unless it is zero.
fn shares(mut weights: Vec<f64>) -> Vec<f64> {
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().filter(|_| sum > 0.0).for_each(|weight| *weight /= sum);
    weights
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

fn centre(corners: &[DVec3]) -> DVec3 {
    corners.iter().sum::<DVec3>() / corners.len().max(1) as f64
}

/// Cuts off the parts of a convex polygon outside `low` to `high` along an axis.
fn between(corners: &mut Vec<DVec3>, axis: usize, low: f64, high: f64) {
    clip(corners, |p| p[axis] - low);
    clip(corners, |p| high - p[axis]);
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

/// Maps a point of the unit square to a convex polygon and preserves relative areas.
fn point(corners: &[DVec3], u: f64, v: f64) -> DVec3 {
    let areas: Vec<f64> = fan(corners).map(|corners| area(&corners)).collect();
    let mut rest = u * areas.iter().sum::<f64>();
    let k = areas.iter().position(|area| {
        rest -= area;
        rest < 0.0
    });
    let k = k.unwrap_or(areas.len() - 1);
    let u = (1.0 + rest / areas[k]).clamp(0.0, 1.0);
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let [a, b, c] = [corners[0], corners[k + 1], corners[k + 2]];
    a + (b - a) * u + (c - a) * v
}

/// Interleaves the first twelve bits of numbers from 0 to 1.
fn morton(axes: [f32; 4]) -> u64 {
    let axes = axes.map(|axis| ((axis * 4096.0) as u64).min(4095));
    (0..12).rev().flat_map(|bit| axes.map(|axis| axis >> bit & 1)).fold(0, |key, bit| key << 1 | bit)
}
