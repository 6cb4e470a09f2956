use super::*;
use crate::math::directions::from_angles;

#[test]
fn the_papers_132_directions_become_137() {
    let map = ParaboloidMap::nearest_to(132);
    assert_eq!((map.side, map.len()), (13, 137));
    assert_eq!(ParaboloidMap::nearest_to(0).side, 2);
    assert!(ParaboloidMap::nearest_to(usize::MAX / 8).side <= 256);
}

#[test]
fn nodes_are_unit_vectors_of_the_upper_half_and_their_solid_angles_fill_it() {
    for side in [2, 7, 12, 31] {
        let map = ParaboloidMap::new(side);
        assert!(map.directions().iter().all(|d| (d.length() - 1.0).abs() < 1e-6 && d.z >= -1e-6));
        let (sum, cosine) = (0..map.len()).fold((0.0, 0.0), |(sum, cosine), node| {
            (sum + map.solid_angle(node), cosine + map.solid_angle(node) * map.directions()[node].z)
        });
        assert!((sum - TAU).abs() < 1e-4);
        // ∫ cosθ dω = π holds only if the distortion is correct.
        assert!(side < 12 || (cosine - 0.5 * TAU).abs() < 0.06, "{side}: {cosine}");
    }
}

#[test]
fn taps_are_exact_at_the_nodes_and_convex_up_to_the_horizon() {
    for side in [2, 3, 13, 24] {
        let map = ParaboloidMap::new(side);
        for (node, &direction) in map.directions().iter().enumerate() {
            let weight: f32 = map.taps(direction).iter().filter(|tap| tap.0 == node).map(|tap| tap.1).sum();
            assert!((weight - 1.0).abs() < 1e-4, "{side} {node}");
        }
        for k in 0..2000 {
            let taps = map.taps(from_angles(k as f32 / 1999.0 * 0.25 * TAU, k as f32 * 0.37));
            assert!((taps.iter().map(|tap| tap.1).sum::<f32>() - 1.0).abs() < 1e-5);
            assert!(taps.iter().all(|tap| tap.1 >= 0.0 && tap.0 < map.len()));
        }
    }
}

#[test]
fn interpolation_of_a_linear_function_of_the_image_is_exact_inside() {
    let map = ParaboloidMap::new(16);
    let field = |d: Vec3| 0.3 + (d.x - 2.0 * d.y) / (1.0 + d.z);
    for k in 0..300 {
        let d = from_angles(1.2 * (k as f32 / 300.0).sqrt(), k as f32 * 2.4);
        let value: f32 = map.taps(d).iter().map(|&(node, w)| w * field(map.directions()[node])).sum();
        assert!((value - field(d)).abs() < 1e-5);
    }
}

#[test]
fn the_nearest_normal_is_the_one_brute_force_finds() {
    let sphere = ParaboloidSphere::new(ParaboloidMap::new(9));
    for k in 0..800 {
        let d = from_angles(k as f32 / 799.0 * 0.5 * TAU, k as f32 * 2.399);
        let best = (0..sphere.len()).map(|node| sphere.direction(node).dot(d)).fold(-1.0, f32::max);
        assert!((sphere.direction(sphere.nearest(d)).dot(d) - best).abs() < 1e-6, "{d}");
    }
}
