//! Tests of facets against a sequential implementation.

use std::collections::HashMap;

use glam::{UVec2, Vec2, Vec3};

use super::*;
use crate::geometry::facets::fold;
use crate::geometry::facets::strata::allocate;
use crate::geometry::families::heightfield;
use crate::geometry::{ColorField, FacetSampler, Facets, REPLICATES, SampleShift, TileMesh};
use crate::pipeline::Pipeline;

/// Computes the order and the cumulative area of the triangles.
fn order(mesh: &TileMesh) -> (Vec<u32>, Vec<f64>) {
    let normal = |t: u32| mesh.geometric_normal(t as usize);
    let is_sound = |t: &u32| mesh.corners(*t as usize).iter().all(|p| p.is_finite()) && normal(*t) != Vec3::ZERO;
    let key = |t: &u32| {
        let [a, b, c] = mesh.corners(*t as usize);
        let centre = ((a + b + c) / 3.0).truncate().to_array();
        let position: [f32; 2] = std::array::from_fn(|axis| {
            let wrapped = centre[axis].rem_euclid(mesh.size[axis]);
            (if wrapped < mesh.size[axis] { wrapped } else { 0.0 }) / mesh.size[axis]
        });
        let axes = [0.5 + 0.5 * normal(*t).x, 0.5 + 0.5 * normal(*t).y, position[0], position[1]];
        let steps = axes.map(|v| ((v * 256.0) as u32).min(255));
        (0..8).rev().fold(0, |key, bit| steps.iter().fold(key, |key, step| key << 1 | (step >> bit & 1)))
    };
    let mut order: Vec<u32> = (0..mesh.triangles.len() as u32).filter(is_sound).collect();
    order.sort_by_key(|t| (mesh.triangle_slot[*t as usize], key(t), *t));
    let mut sum = 0.0;
    let cumulative = order.iter().map(|t| {
        sum += mesh.triangle_area(*t as usize);
        sum
    });
    (order.clone(), cumulative.collect())
}

fn sequential(mesh: &TileMesh, count: usize, shift: SampleShift) -> Facets {
    let (order, cumulative) = order(mesh);
    let mut facets = Facets { skipped_triangles: mesh.triangles.len() - order.len(), ..Facets::default() };
    if order.is_empty() {
        return facets;
    }
    let mut shapes: HashMap<[i32; 6], (Vec2, usize)> = HashMap::new();
    // Each slot has facets of its own, unless there are fewer facets than slots.
    let slot = |k: usize| mesh.triangle_slot[order[k] as usize];
    let mut ends: Vec<usize> = (1..order.len()).filter(|k| slot(*k) != slot(k - 1)).chain([order.len()]).collect();
    if ends.len() > count {
        ends = vec![order.len()];
    }
    let before = |k: usize| if k == 0 { 0.0 } else { cumulative[k - 1] };
    let starts: Vec<usize> = [0].into_iter().chain(ends.iter().copied()).collect();
    let areas: Vec<f64> = ends.iter().zip(&starts).map(|(end, start)| before(*end) - before(*start)).collect();
    let counts = allocate(&areas, count);
    let each = (0..ends.len()).flat_map(|stratum| (0..counts[stratum]).map(move |facet| (stratum, facet)));
    for (stratum, facet) in each {
        let (all, count) = (areas[stratum], counts[stratum]);
        let target = before(starts[stratum]) + (facet as f64 + f64::from(shift.along)) / count as f64 * all;
        let mut k = starts[stratum];
        while k + 1 < ends[stratum] && cumulative[k] <= target {
            k += 1;
        }
        let [a, b, c] = mesh.corners(order[k] as usize);
        let unit = mesh.size.extend(mesh.size.max_element()) * 1e-4;
        let [b, c] = [b - a, c - a].map(|edge| (edge / unit).round());
        let shape = [b.x, b.y, b.z, c.x, c.y, c.z].map(|side| side as i32);
        let (start, used) = shapes.entry(shape).or_insert_with(|| (start_of(order[k]), 0));
        *used += 1;
        let start = shift.inside + *start;
        let at = |step: f64, start: f32| (f64::from(start) + *used as f64 * step).fract() as f32;
        let point = Vec2::new(at(0.754_877_666_246_692_8, start.x), at(0.569_840_290_998_053_3, start.y));
        facets.push(mesh, order[k], fold(point), (all / count as f64) as f32);
        *facets.replicates.last_mut().unwrap() = (facet % REPLICATES) as u8;
    }
    facets
}

/// Sorts stably by slot and rounded normal.
fn sorted(facets: &Facets) -> Facets {
    let mut order: Vec<usize> = (0..facets.len()).collect();
    order.sort_by_key(|&s| {
        let [x, y, z] = (facets.normals[s] * 4096.0).to_array().map(|v| v.round() as i32);
        (facets.slots[s], z, y, x)
    });
    fn permuted<T: Copy>(values: &[T], order: &[usize]) -> Vec<T> {
        order.iter().map(|&s| values[s]).collect()
    }
    Facets {
        positions: permuted(&facets.positions, &order),
        normals: permuted(&facets.normals, &order),
        geometric_normals: permuted(&facets.geometric_normals, &order),
        areas: permuted(&facets.areas, &order),
        slots: permuted(&facets.slots, &order),
        colors: permuted(&facets.colors, &order),
        triangles: permuted(&facets.triangles, &order),
        replicates: permuted(&facets.replicates, &order),
        skipped_triangles: facets.skipped_triangles,
    }
}

/// The bits of all values of all facets.
fn bits(facets: &Facets) -> (Vec<u32>, Vec<u16>, &[u32], usize) {
    let columns = [&facets.positions, &facets.normals, &facets.geometric_normals, &facets.colors];
    let floats = columns.into_iter().flatten().flat_map(|v| v.to_array()).chain(facets.areas.iter().copied());
    (floats.map(f32::to_bits).collect(), facets.slots.clone(), &facets.triangles, facets.skipped_triangles)
}

/// Shipped tiles, a height field, a broken mesh, one with corner normals, colours and slots, and meshes of one
/// triangle, of invalid triangles and of none.
fn meshes() -> Vec<TileMesh> {
    let shipped = |name| Pipeline::new().mesh(&crate::scene::open(name, &[]).unwrap()).unwrap();
    let mut meshes: Vec<TileMesh> =
        ["table4_plate", "table4_teapot", "table4_pillow", "table4_skirt"].map(shipped).into();
    let size = Vec2::new(1.0, 0.7);
    let waves = heightfield::from_function(UVec2::new(60, 70), size, |p| 0.1 * (p.x * 12.0).sin() * (p.y * 31.0).cos());
    let mut broken = waves.clone();
    for (k, position) in broken.positions.iter_mut().enumerate() {
        match k % 97 {
            3 => position.z = f32::NAN,
            5 => position.x = f32::INFINITY,
            7 | 8 => *position = Vec3::new(0.5, 0.25, 0.0),
            11 => *position += Vec3::new(3.0, -2.5, 0.1),
            _ => {}
        }
    }
    let mut painted = waves.clone();
    painted.slots.push("second".to_owned());
    painted.triangle_slot.iter_mut().enumerate().for_each(|(k, slot)| *slot = (k / 7 % 2) as u16);
    let texels = (0..12).map(|k| Vec3::new(0.1 * k as f32, 0.5, 1.0 - 0.05 * k as f32)).collect();
    painted.color = ColorField::Image { size: UVec2::new(4, 3), texels: std::sync::Arc::new(texels) };
    let corner = |t: usize| {
        [0, 1, 2].map(|k| Vec3::new(((t + k) as f32).sin(), 0.2, if t.is_multiple_of(9) { 0.0 } else { 1.0 }))
    };
    let normals = (0..painted.triangles.len()).map(|t| if t.is_multiple_of(5) { [Vec3::ZERO; 3] } else { corner(t) });
    painted.corner_normals = Some(normals.collect());
    let mut one = waves.clone();
    one.triangles.truncate(1);
    let mut none = waves.clone();
    none.positions.iter_mut().for_each(|position| position.y = f32::NAN);
    meshes.extend([waves, broken, painted, one, none, TileMesh { size, ..TileMesh::default() }]);
    meshes
}

#[test]
fn facets_equal_those_of_a_sequential_loop_bit_for_bit_for_any_number_of_threads() {
    for mesh in meshes() {
        for (count, seed) in [(0, 1), (1, 0), (300, 7), (9000, 3)] {
            let expected = sequential(&mesh, count, SampleShift::from_seed(seed));
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let sampler = FacetSampler::new(&mesh);
                    assert_eq!(sampler.area().to_bits(), order(&mesh).1.last().copied().unwrap_or(0.0).to_bits());
                    let mut facets = sampler.sample(&mesh, count, SampleShift::from_seed(seed));
                    assert!(bits(&facets) == bits(&expected), "{count} on {} triangles", mesh.triangles.len());
                    facets.sort_for_sums();
                    assert!(bits(&facets) == bits(&sorted(&expected)), "{count} on {} triangles", mesh.triangles.len());
                });
            }
        }
    }
}
