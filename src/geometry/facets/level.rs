//! The facets of a level tile: one per material slot, with the exact mean colour. Nothing blocks a level tile, so that
//! the sum over these facets is exact.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{Facets, wrap};
use crate::geometry::{ColorField, TileMesh};

/// Area and integral of the colour over the part of the tile with one slot and one side.
type Sums = BTreeMap<(u16, bool), (f64, DVec3)>;

impl Facets {
    /// One facet per slot of a level mesh, with the slot's area and its mean colour. `None` if the mesh has normals of
    /// its own.
    pub fn of_level_tile(mesh: &TileMesh) -> Option<Self> {
        if mesh.corner_normals.is_some() {
            return None;
        }
        let sound: Vec<u32> = (0..mesh.triangles.len() as u32)
            .filter(|&t| mesh.geometric_normal(t as usize) != Vec3::ZERO)
            .filter(|&t| mesh.corners(t as usize).iter().all(|corner| corner.is_finite()))
            .collect();
        let mut facets = Self { skipped_triangles: mesh.triangles.len() - sound.len(), ..Self::default() };
        let sums = match covering_slot(mesh, &sound) {
            Some(slot) => sums_over_cells(mesh, slot),
            None => sums_over_triangles(mesh, &sound),
        };
        for ((slot, faces_up), (area, color)) in sums {
            // Every triangle of the plane gives the same sum.
            let Some(&triangle) = sound.iter().find(|&&t| (mesh.geometric_normal(t as usize).z > 0.0) == faces_up)
            else {
                continue;
            };
            let [a, b, c] = mesh.corners(triangle as usize);
            let normal = mesh.geometric_normal(triangle as usize);
            facets.positions.push(wrap((a + b + c) / 3.0, mesh.size));
            facets.normals.push(normal);
            facets.geometric_normals.push(normal);
            facets.areas.push(area as f32);
            facets.slots.push(slot);
            facets.colors.push((color / area).as_vec3());
            facets.triangles.push(triangle);
        }
        Some(facets)
    }
}

/// Largest number of cells along an axis into which a colour map divides a level tile.
const MAX_CELLS: u32 = 2048;

/// The slot of all triangles if they face up and cover the tile once.
fn covering_slot(mesh: &TileMesh, triangles: &[u32]) -> Option<u16> {
    let slot = mesh.triangle_slot[*triangles.first()? as usize];
    let same = |t: &u32| mesh.triangle_slot[*t as usize] == slot && mesh.geometric_normal(*t as usize).z > 0.0;
    let area: f64 = triangles.iter().map(|t| mesh.triangle_area(*t as usize)).sum();
    let base = f64::from(mesh.base_area());
    (mesh.closes_plane && triangles.iter().all(same) && (area - base).abs() <= 1e-6 * base).then_some(slot)
}

/// Coordinates in `[0, 1]` between which an axis of both images has one slot and a linear colour.
fn breaks(mesh: &TileMesh, axis: usize) -> Vec<f64> {
    let mut breaks = vec![0.0, 1.0];
    if let ColorField::Image { size, .. } = mesh.color.image() {
        let count = size[axis];
        breaks.extend((0..count).map(|k| (f64::from(k) + 0.5) / f64::from(count)));
    }
    if let ColorField::Mapped { map, .. } = &mesh.color {
        // The map is not linear between texels: cells of half a texel bound the error.
        for place in map.places() {
            let count = (2 * place.grid.size[axis] * place.grid.repeat).min(MAX_CELLS);
            breaks.extend((1..count).map(|k| f64::from(k) / f64::from(count)));
        }
    }
    if let Some(field) = &mesh.painted_slots {
        let count = field.size[axis];
        breaks.extend((1..count).map(|k| f64::from(k) / f64::from(count)));
    }
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    breaks
}

fn color_at(mesh: &TileMesh, at: DVec2) -> DVec3 {
    // A level tile has one height, and colour maps of it see that of its first vertex.
    let height = mesh.positions.first().map_or(0.0, |position| position.z);
    mesh.color.at((at.as_vec2() * mesh.size).extend(height), Vec3::Z, mesh.size).as_dvec3()
}

/// Adds the sums of rows in their order, so that the result does not depend on the number of threads.
fn total(rows: Vec<Sums>) -> Sums {
    let mut total = Sums::new();
    for (key, (area, color)) in rows.into_iter().flatten() {
        let sum = total.entry(key).or_default();
        sum.0 += area;
        sum.1 += color;
    }
    total
}

/// Sums over the cells of both images, on a tile that is covered by triangles of one slot. The integral of a bilinear
/// function over a rectangle is its value at the centre times the area.
fn sums_over_cells(mesh: &TileMesh, slot: u16) -> Sums {
    let base = f64::from(mesh.base_area());
    let (columns, rows) = (breaks(mesh, 0), breaks(mesh, 1));
    let row = |y: &[f64]| {
        let mut sums = Sums::new();
        for x in columns.windows(2) {
            let centre = DVec2::new(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
            let area = (x[1] - x[0]) * (y[1] - y[0]) * base;
            let slot = mesh.painted_slot(centre.as_vec2() * mesh.size).unwrap_or(slot);
            let sum = sums.entry((slot, true)).or_default();
            sum.0 += area;
            sum.1 += color_at(mesh, centre) * area;
        }
        sums
    };
    total(rows.par_windows(2).map(row).collect())
}

/// Sums over the parts of triangles within the cells of both images.
fn sums_over_triangles(mesh: &TileMesh, triangles: &[u32]) -> Sums {
    let uniform = mesh.painted_slots.is_none() && matches!(mesh.color, ColorField::Uniform);
    let breaks = [breaks(mesh, 0), breaks(mesh, 1)];
    let base = f64::from(mesh.base_area());
    let of_triangle = |&triangle: &u32| {
        let mut sums = Sums::new();
        let triangle = triangle as usize;
        let (own, faces_up) = (mesh.triangle_slot[triangle], mesh.geometric_normal(triangle).z > 0.0);
        let mut add = |slot: u16, area: f64, color: DVec3| {
            let sum = sums.entry((slot, faces_up)).or_default();
            sum.0 += area;
            sum.1 += color;
        };
        if uniform {
            let area = mesh.triangle_area(triangle);
            add(own, area, DVec3::splat(area));
            return sums;
        }
        let corners = mesh.corners(triangle).map(|p| (p.truncate() / mesh.size).as_dvec2());
        for_cells(&corners, 1, &breaks[1], &mut |strip| {
            for_cells(strip, 0, &breaks[0], &mut |cell| {
                let (area, color, centre) = integral(mesh, cell);
                if area > 0.0 {
                    let slot = mesh.painted_slot(centre * mesh.size).unwrap_or(own);
                    add(slot, area * base, color * base);
                }
            });
        });
        sums
    };
    total(triangles.par_iter().map(of_triangle).collect())
}

/// Calls `work` with the parts of a convex polygon between the coordinates `breaks`, which repeat with period 1.
fn for_cells(polygon: &[DVec2], axis: usize, breaks: &[f64], work: &mut dyn FnMut(&[DVec2])) {
    let low = polygon.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let high = polygon.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    let mut period = low.floor();
    while period < high {
        let first = breaks.partition_point(|at| period + at <= low).saturating_sub(1);
        for ends in breaks[first..].windows(2) {
            if period + ends[0] >= high {
                break;
            }
            let above = clipped(polygon, axis, period + ends[0], 1.0);
            let part = clipped(&above, axis, period + ends[1], -1.0);
            if part.len() > 2 {
                work(&part);
            }
        }
        period += 1.0;
    }
}

/// The part of a convex polygon where `side · (p[axis] - at)` is positive (Sutherland and Hodgman 1974).
fn clipped(polygon: &[DVec2], axis: usize, at: f64, side: f64) -> Vec<DVec2> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (of_p, of_q) = (side * (p[axis] - at), side * (q[axis] - at));
        if of_p >= 0.0 {
            part.push(p);
        }
        if (of_p > 0.0 && of_q < 0.0) || (of_p < 0.0 && of_q > 0.0) {
            part.push(p + (q - p) * (of_p / (of_p - of_q)));
        }
    }
    part
}

/// Area, integral of the colour, and centre of a convex polygon of the unit square within one cell. The rule of
/// mid-edges is exact, because the colour is a polynomial of degree 2.
fn integral(mesh: &TileMesh, polygon: &[DVec2]) -> (f64, DVec3, Vec2) {
    let (mut area, mut color) = (0.0, DVec3::ZERO);
    let a = polygon[0];
    for edge in polygon[1..].windows(2) {
        let (b, c) = (edge[0], edge[1]);
        let part = 0.5 * (b - a).perp_dot(c - a).abs();
        area += part;
        for middle in [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)] {
            color += color_at(mesh, middle) * (part / 3.0);
        }
    }
    let centre = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
    (area, color, centre.as_vec2())
}

#[cfg(test)]
#[path = "level_tests.rs"]
mod tests;
