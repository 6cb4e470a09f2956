use rand::{RngExt as _, SeedableRng as _};

use super::*;
use crate::geometry::TileMesh;
use crate::geometry::families::heightfield;
use crate::math::simd::{InSimdF32x8, eight};

/// Nothing known, nothing left out.
const NOTHING: Known = Known { ground: 0.0, low: f32::INFINITY, high: f32::NEG_INFINITY };
const ANYWHERE: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// The slopes that a triangle covers in the vertical half-plane from a point: its corners are seen from there, as distances
/// across the plane, along it and up; none below the horizon.
fn slice([a, b, c]: [Vec3; 3]) -> Option<(f32, f32)> {
    let side = |p: Vec3| p.x >= 0.0;
    if side(a) == side(b) && side(b) == side(c) {
        return None;
    }
    // The corner alone on its side; the two edges from it cross the plane.
    let (apex, p, q) = if side(b) == side(c) {
        (a, b, c)
    } else if side(a) == side(c) {
        (b, c, a)
    } else {
        (c, a, b)
    };
    let cross = |to: Vec3| {
        let t = apex.x / (apex.x - to.x);
        Vec2::new(apex.y + (to.y - apex.y) * t, apex.z + (to.z - apex.z) * t)
    };
    let (mut near, mut far) = (cross(p), cross(q));
    if near.x > far.x {
        std::mem::swap(&mut near, &mut far);
    }
    if far.x <= 0.0 {
        return None;
    }
    let slope = |p: Vec2| p.y / p.x;
    let first = if near.x > 0.0 {
        slope(near)
    } else {
        // The segment passes above or below the origin: at distance 0 its slope is infinite.
        let over = near.y + (far.y - near.y) * (-near.x / (far.x - near.x));
        if over > 0.0 { f32::INFINITY } else { f32::NEG_INFINITY }
    };
    let last = slope(far);
    let (low, high) = if first <= last { (first, last) } else { (last, first) };
    (high > 0.0).then_some((low.max(0.0), high))
}

fn waves() -> TileMesh {
    heightfield::from_function(glam::UVec2::new(9, 7), Vec2::new(1.0, 0.8), |p| {
        0.3 * (7.0 * p.x).sin() * (9.0 * p.y).cos()
    })
}

#[test]
fn eight_triangles_at_once_are_cut_as_one_by_one_ahead_behind_and_overhead() {
    are_cut_as_one_by_one::<F32x8Array>();
    eight(CutInEights);
}

struct CutInEights;

impl InSimdF32x8 for CutInEights {
    type Output = ();

    fn with<E: SimdF32x8>(self) {
        are_cut_as_one_by_one::<E>();
    }
}

fn are_cut_as_one_by_one<E: SimdF32x8>() {
    let mesh = waves();
    let grid = PeriodicGrid::new(&mesh);
    let slicer = Slicer::new(&grid);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let (mut seen, mut over) = (0, 0);
    for _ in 0..400 {
        let mut random = || rng.random::<f32>();
        let along = Vec2::from_angle(6.3 * random());
        let turned = slicer.turned(along);
        let eye = turned.seen(Vec3::new(random(), 0.8 * random(), 0.6 * random() - 0.3));
        for cell in 0..grid.z_max.len() {
            let (first, extents) = turned.blocks(cell);
            for (k, extent) in extents.iter().enumerate() {
                let cut = turned.block(first + k).cut::<E>(eye, extent.meets::<E>(eye.x, ANYWHERE), NOTHING);
                let found: Vec<_> = cut.lanes().collect();
                for (lane, &entry) in turned.entries(cell)[WIDTH * k..].iter().take(WIDTH).enumerate() {
                    let corners = grid.copy_corners(entry, IVec2::ZERO).map(|corner| turned.seen(corner) - eye);
                    let found = found.iter().find(|found| found.0 == lane).map(|&(_, low, high)| (low, high));
                    match (found, slice(corners)) {
                        (None, None) => {}
                        (Some((low, high)), Some((want_low, want_high))) => {
                            let near = |a: f32, b: f32| a == b || (a - b).abs() <= 2e-3 * (1.0 + a.abs());
                            assert!(near(low, want_low), "{low} {want_low}");
                            assert!(near(high, want_high) || high.min(want_high) > 300.0, "{high} {want_high}");
                            seen += 1;
                            over += u32::from(high == f32::INFINITY);
                        }
                        // What only just rises over the horizon, or is only just met.
                        (Some((low, high)), None) | (None, Some((low, high))) => {
                            assert!(high < 1e-3 || high - low < 1e-3, "{low} {high}");
                        }
                    }
                }
            }
        }
    }
    assert!(seen > 1000 && over > 20, "{seen} {over}");
}

#[test]
fn what_is_known_hides_only_lanes_within_it() {
    let mesh = waves();
    let grid = PeriodicGrid::new(&mesh);
    let slicer = Slicer::new(&grid);
    let turned = slicer.turned(Vec2::from_angle(0.4));
    let eye = turned.seen(Vec3::new(0.3, 0.2, -0.2));
    let known = Known { ground: 0.2, low: 0.5, high: 1.0 };
    let (mut hidden, mut shown) = (0, 0);
    for cell in 0..grid.z_max.len() {
        let (first, extents) = turned.blocks(cell);
        for (k, extent) in extents.iter().enumerate() {
            let met = extent.meets::<F32x8Array>(eye.x, ANYWHERE);
            let lanes = |known| turned.block(first + k).cut::<F32x8Array>(eye, met, known).lanes().collect::<Vec<_>>();
            let some = lanes(known);
            for lane in lanes(NOTHING) {
                let (_, low, high) = lane;
                let within = high <= 0.2 || (0.5 <= low && high <= 1.0);
                assert_eq!(some.contains(&lane), !within, "{lane:?}");
                hidden += u32::from(within);
                shown += u32::from(!within);
            }
        }
    }
    assert!(hidden > 3 && shown > 3, "{hidden} {shown}");
}
