use super::*;

const GRID: HemispherePairGrid = HemispherePairGrid { rings: 9, azimuths: 12, phi_d: 6, theta_d: 7 };

fn coordinates(i: Vec3, o: Vec3) -> ([f32; 4], f32) {
    let mut coordinates = GridCoordinates::default();
    GRID.coordinates([&[i.x], &[i.y], &[i.z]], o, &mut coordinates);
    (coordinates.at(0), coordinates.i_dot_h(0))
}

#[test]
fn every_node_is_above_the_horizon_and_has_the_coordinates_of_its_index() {
    for node in 0..GRID.nodes() {
        let (i, o) = GRID.pair(node);
        assert!(i.z > 1e-3 && o.z > 1e-3, "{node}: {i} {o}");
        assert!(i.is_normalized() && o.is_normalized());
        let (step, rest) = (node % GRID.theta_d, node / GRID.theta_d);
        let (phi_d, rest) = (rest % GRID.phi_d, rest / GRID.phi_d);
        let (azimuth, ring) = (rest % GRID.azimuths, rest / GRID.azimuths);
        // Coordinates are not unique at the pole and where i = o, and nodes at the horizon are lifted.
        if ring == 0 || ring + 1 == GRID.rings || step == 0 || step + 1 == GRID.theta_d {
            continue;
        }
        let (at, i_dot_h) = coordinates(i, o);
        let near = |a: f32, b: usize, period: usize| {
            let d = (a - b as f32).abs();
            d.min((period as f32 - d).abs()) < 2e-3
        };
        assert!((at[0] - ring as f32).abs() < 2e-3, "{node}: {at:?}");
        assert!(near(at[1], azimuth, GRID.azimuths) && near(at[2], phi_d, GRID.phi_d), "{node}: {at:?}");
        assert!((at[3] - step as f32).abs() < 4e-3, "{node}: {at:?} {step}");
        assert!((i_dot_h - i.dot((i + o).normalize())).abs() < 1e-5);
    }
}

#[test]
fn mirror_images_of_nodes_are_the_mirrored_pairs() {
    for (mirrors, azimuths) in [([true, false], 7), ([false, true], 7), ([true, true], 4), ([false, false], 12)] {
        let mut originals = std::collections::BTreeSet::new();
        for azimuth in 0..GRID.azimuths {
            let (image, negated) = GRID.image(azimuth, mirrors);
            assert_eq!(GRID.image(image, mirrors), (image, false), "an image is its own");
            originals.insert(image);
            for (ring, phi_d, step) in [(3, 1, 4), (5, 3, 2), (2, 0, 3)] {
                let node = |azimuth: usize, phi_d: usize| {
                    ((ring * GRID.azimuths + azimuth) * GRID.phi_d + phi_d) * GRID.theta_d + step
                };
                let (i, o) = GRID.pair(node(azimuth, phi_d));
                let image_phi_d = if negated { (GRID.phi_d - phi_d) % GRID.phi_d } else { phi_d };
                let (k, l) = GRID.pair(node(image, image_phi_d));
                // The allowed mirrors, singly or together, take one pair to the other, with or without a swap.
                let close = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-5;
                let found = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].into_iter().any(|[x, y]| {
                    let allowed = (x > 0.0 || mirrors[0]) && (y > 0.0 || mirrors[1]);
                    let flip = |d: Vec3| d * Vec3::new(x, y, 1.0);
                    let same = close(flip(i), k) && close(flip(o), l) || close(flip(i), l) && close(flip(o), k);
                    allowed && same
                });
                assert!(found, "{mirrors:?} {azimuth} {phi_d}");
            }
        }
        assert_eq!(originals.len(), azimuths, "{mirrors:?}");
    }
}

#[test]
fn every_pair_has_coordinates_on_the_grid_and_the_swapped_pair_has_the_same() {
    for k in 0..4000_u32 {
        let angle =
            |j: u32| (k.wrapping_mul(2_654_435_761).wrapping_add(j.wrapping_mul(97_571)) % 9973) as f32 / 9973.0;
        let i = crate::math::directions::from_angles(angle(1) * 1.57, angle(2) * TAU);
        let o = crate::math::directions::from_angles(angle(3) * 1.57, angle(4) * TAU);
        let (at, _) = coordinates(i, o);
        let last = [8.0, 12.0, 6.0, 6.0];
        assert!(at.iter().zip(last).all(|(at, last)| (0.0..=last).contains(at)), "{i} {o}: {at:?}");
        let (swapped, _) = coordinates(o, i);
        for axis in 0..4 {
            let d = (at[axis] - swapped[axis]).abs();
            let wrapped = if axis == 2 { d.min(6.0 - d) } else { d };
            assert!(wrapped < 1e-2, "{i} {o}: {at:?} {swapped:?}");
        }
    }
}

#[test]
fn pairs_at_the_poles_and_at_the_horizon_have_finite_coordinates() {
    let flat = Vec3::new(1.0, 0.0, 1e-30).normalize();
    for (i, o) in [(Vec3::Z, Vec3::Z), (flat, flat), (flat, Vec3::new(-1.0, 0.0, 1e-30)), (Vec3::Z, flat)] {
        let (at, i_dot_h) = coordinates(i, o);
        assert!(at.iter().all(|at| at.is_finite()) && i_dot_h.is_finite(), "{i} {o}: {at:?}");
    }
}
