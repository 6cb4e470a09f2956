use std::f32::consts::TAU;
use std::time::Instant;

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Ear clipping that tests every corner anew at each step.
fn brute_force(outline: &[Vec3]) -> Vec<[usize; 3]> {
    let cross = |a: usize, b: usize, c: usize| {
        let [a, b, c] = [a, b, c].map(|k| outline[k].truncate().as_dvec2());
        (b - a).perp_dot(c - a)
    };
    let mut remaining: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::new();
    while remaining.len() > 3 {
        let size = remaining.len();
        let is_ear = |k: &usize| {
            let [a, b, c] = [remaining[(k + size - 1) % size], remaining[*k], remaining[(k + 1) % size]];
            let contains = |p: usize| cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0;
            cross(a, b, c) > 0.0 && !remaining.iter().any(|&p| p != a && p != b && p != c && contains(p))
        };
        let ear = (1..size).chain([0]).find(is_ear).unwrap_or(1);
        triangles.push([remaining[(ear + size - 1) % size], remaining[ear], remaining[(ear + 1) % size]]);
        remaining.remove(ear);
    }
    triangles.push([remaining[0], remaining[1], remaining[2]]);
    triangles
}

/// A polygon around the origin with radii from `radius`.
fn around(count: usize, mut radius: impl FnMut(usize) -> f32) -> Vec<Vec3> {
    (0..count).map(|k| (radius(k) * Vec2::from_angle(TAU * k as f32 / count as f32)).extend(0.0)).collect()
}

/// Asserts that all triangles are counterclockwise and together have the area of the outline.
fn assert_covers(outline: &[Vec3], triangles: &[[usize; 3]]) {
    let at = |k: usize| outline[k % outline.len()].truncate().as_dvec2();
    let areas = triangles.iter().map(|&[a, b, c]| (at(b) - at(a)).perp_dot(at(c) - at(a)));
    let expected: f64 = (0..outline.len()).map(|k| at(k).perp_dot(at(k + 1))).sum();
    assert_eq!(triangles.len(), outline.len() - 2);
    assert!(areas.clone().all(|area| area > 0.0));
    assert!((areas.sum::<f64>() / expected - 1.0).abs() < 1e-9);
}

#[test]
fn simple_polygons_have_the_triangles_of_a_search_without_a_tree() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for count in 4..60 {
        let outline = around(count, |_| 0.1 + random.random::<f32>());
        let triangles = triangulate(&outline);
        assert_eq!(triangles, brute_force(&outline), "{count} corners");
        assert_covers(&outline, &triangles);
    }
}

#[test]
fn folded_polygons_and_those_without_area_give_triangles_of_all_corners() {
    let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, 2.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    for outline in [bow, [Vec3::ONE; 5], [0.0, 3.0, 1.0, 4.0, 2.0].map(Vec3::splat)] {
        let triangles = triangulate(&outline);
        assert_eq!(triangles.len(), 3);
        assert!((0..5).all(|corner| triangles.iter().flatten().any(|k| *k == corner)), "{triangles:?}");
    }
}

#[test]
fn a_polygon_in_any_plane_keeps_its_area_vector() {
    let outline = around(40, |k| if k % 2 == 0 { 1.0 } else { 0.4 });
    for normal in [Vec3::X, -Vec3::Y, Vec3::NEG_Z, Vec3::new(0.3, -0.5, 0.2)] {
        let turn = glam::Quat::from_rotation_arc(Vec3::Z, normal.normalize_or_zero());
        let turned: Vec<Vec3> = outline.iter().map(|&corner| turn * corner).collect();
        let areas = triangulate(&turned)
            .into_iter()
            .map(|[a, b, c]| (turned[b] - turned[a]).cross(turned[c] - turned[a]).dot(turn * Vec3::Z));
        assert!(areas.clone().all(|area| area > 0.0), "{normal}");
        let expected = (0..40).map(|k| outline[k].cross(outline[(k + 1) % 40]).z).sum::<f32>();
        assert!((areas.sum::<f32>() / expected - 1.0).abs() < 1e-5, "{normal}");
    }
}

/// A circle, a star, random radii, a comb, a spiral and a saw under a straight edge.
#[test]
fn a_hundred_thousand_corners_take_seconds_at_most() {
    const COUNT: usize = 100_000;
    // One outline takes 0.1 to 0.3 s. The bound leaves room for a busy machine; n² steps take longer.
    const MAX_SECONDS: f64 = 10.0;
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let comb = |k: usize| {
        let x = k as f32;
        if k + 1 == COUNT { Vec3::new(x, -9.0, 0.0) } else { Vec3::new(x, (k % 2) as f32 * 1e5, 0.0) }
    };
    let spiral = |k: usize| {
        let (turn, radius) = if k < COUNT / 2 { (k, 0.0) } else { (COUNT - 1 - k, 0.4) };
        let angle = 200.0 * turn as f32 / COUNT as f32 * TAU;
        ((1.0 + angle / TAU + radius) * Vec2::from_angle(angle)).extend(0.0)
    };
    let outlines = [
        around(COUNT, |_| 1000.0),
        around(COUNT, |k| if k % 2 == 0 { 1000.0 } else { 500.0 }),
        around(COUNT, |_| 1000.0 + random.random::<f32>()),
        (0..COUNT).map(|k| comb(COUNT - 1 - k)).collect(),
        (0..COUNT).map(spiral).rev().collect::<Vec<_>>(),
        (0..COUNT).map(|_| Vec3::new(random.random(), random.random(), 0.0)).collect(),
    ];
    for (k, outline) in outlines.iter().enumerate() {
        let start = Instant::now();
        assert_eq!(triangulate(outline).len(), COUNT - 2);
        let seconds = start.elapsed().as_secs_f64();
        eprintln!("outline {k}: {seconds:.2} s");
        assert!(seconds < MAX_SECONDS, "outline {k}: {seconds} s");
    }
}
