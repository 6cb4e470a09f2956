use rand::{RngExt as _, SeedableRng as _};

use super::*;
use crate::geometry::TileMesh;
use crate::geometry::families::heightfield;
use crate::math::simd::{SimdTask, with_simd_f32x8};

/// No known slopes: no lane is left out.
const NOTHING: KnownSlopes = KnownSlopes { ground: 0.0, low: f32::INFINITY, high: f32::NEG_INFINITY };
const ANYWHERE: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// Computes the slopes that a triangle covers in the vertical half plane from the origin, for corners in slice
/// coordinates; `None` if all are below the horizon.
fn slice([a, b, c]: [Vec3; 3]) -> Option<(f32, f32)> {
    let side = |p: Vec3| p.x >= 0.0;
    if side(a) == side(b) && side(b) == side(c) {
        return None;
    }
    // The apex is alone on its side, so both of its edges cross the plane.
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
fn eight_triangles_at_once_cover_the_same_slopes_as_one_by_one() {
    assert_equal_to_one_by_one::<F32x8Array>();
    with_simd_f32x8(EightAtOnce);
}

struct EightAtOnce;

impl SimdTask for EightAtOnce {
    type Output = ();

    fn with<E: SimdF32x8>(self) {
        assert_equal_to_one_by_one::<E>();
    }
}

fn assert_equal_to_one_by_one<E: SimdF32x8>() {
    let mesh = waves();
    let grid = PeriodicGrid::new(&mesh);
    let slicer = Slicer::new(&grid);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let (mut compared, mut overhead) = (0, 0);
    for _ in 0..400 {
        let mut random = || rng.random::<f32>();
        let along = Vec2::from_angle(6.3 * random());
        let rotated = slicer.rotated(along);
        let eye = rotated.in_slice(Vec3::new(random(), 0.8 * random(), 0.6 * random() - 0.3));
        for cell in 0..grid.z_max.len() {
            let (first, bounds) = rotated.blocks(cell);
            for (k, bounds) in bounds.iter().enumerate() {
                let covered =
                    rotated.block(first + k).covered_slopes::<E>(eye, bounds.meets::<E>(eye.x, ANYWHERE), NOTHING);
                let found: Vec<_> = covered.lanes().collect();
                for (lane, &entry) in rotated.entries(cell)[WIDTH * k..].iter().take(WIDTH).enumerate() {
                    let corners = grid.copy_corners(entry, IVec2::ZERO).map(|corner| rotated.in_slice(corner) - eye);
                    let found = found.iter().find(|found| found.0 == lane).map(|&(_, low, high)| (low, high));
                    match (found, slice(corners)) {
                        (None, None) => {}
                        (Some((low, high)), Some((want_low, want_high))) => {
                            let near = |a: f32, b: f32| a == b || (a - b).abs() <= 2e-3 * (1.0 + a.abs());
                            assert!(near(low, want_low), "{low} {want_low}");
                            assert!(near(high, want_high) || high.min(want_high) > 300.0, "{high} {want_high}");
                            compared += 1;
                            overhead += u32::from(high == f32::INFINITY);
                        }
                        // Triangles that barely rise above the horizon, or that the slice barely meets.
                        (Some((low, high)), None) | (None, Some((low, high))) => {
                            assert!(high < 1e-3 || high - low < 1e-3, "{low} {high}");
                        }
                    }
                }
            }
        }
    }
    assert!(compared > 1000 && overhead > 20, "{compared} {overhead}");
}

#[test]
fn known_slopes_hide_only_the_lanes_within_them() {
    let mesh = waves();
    let grid = PeriodicGrid::new(&mesh);
    let slicer = Slicer::new(&grid);
    let rotated = slicer.rotated(Vec2::from_angle(0.4));
    let eye = rotated.in_slice(Vec3::new(0.3, 0.2, -0.2));
    let known = KnownSlopes { ground: 0.2, low: 0.5, high: 1.0 };
    let (mut hidden, mut shown) = (0, 0);
    for cell in 0..grid.z_max.len() {
        let (first, bounds) = rotated.blocks(cell);
        for (k, bounds) in bounds.iter().enumerate() {
            let met = bounds.meets::<F32x8Array>(eye.x, ANYWHERE);
            let lanes = |known| {
                rotated.block(first + k).covered_slopes::<F32x8Array>(eye, met, known).lanes().collect::<Vec<_>>()
            };
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
