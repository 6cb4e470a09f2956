use super::*;

/// Directions at all azimuths, from the plane's horizon to the zenith.
fn directions() -> impl Iterator<Item = Vec3> {
    (0..2000).map(|k| from_angles(FRAC_PI_2 * (k as f32 / 1999.0), TAU * (k as f32 * 0.618_034).fract()))
}

#[test]
fn the_slope_of_a_straight_wall_is_exact_between_azimuths() {
    for azimuths in [4, 8, 16, 48] {
        for (steepness, toward) in [(0.3, 0.1), (2.0, 1.0), (40.0, 2.5), (1000.0, 5.0)] {
            let wall = |azimuth: f32| steepness * (azimuth - toward).cos();
            let slopes = (0..azimuths).map(|node| wall(TAU * node as f32 / azimuths as f32)).collect();
            let map = HorizonMap::from_slopes(1, azimuths, 0.02, slopes);
            for direction in directions() {
                let taps = map.taps(direction);
                let [from, to] = taps.azimuths.map(|azimuth| map.slope(azimuth, 0));
                // Elsewhere the wall is behind the facet along one of the azimuths.
                if from > 0.0 && to > 0.0 {
                    let slope = (taps.scales[0] * from + taps.scales[1] * to) / taps.scale;
                    let azimuth = direction.y.atan2(direction.x);
                    assert!((slope - wall(azimuth)).abs() < 4e-6 * steepness, "{azimuths} azimuths: {slope}");
                }
            }
        }
    }
}

#[test]
fn the_slope_in_a_groove_is_exact_at_all_azimuths() {
    // Facets of a groove along y: in the middle, at a wall that rises towards -x, and on top.
    let sides = [[1.5_f32, 0.8], [0.0, 3.0], [0.0, 0.0]];
    let even = [4, 8, 48].map(|azimuths| (Azimuths::Even(azimuths), Vec2::X));
    let turned = [0.0, 0.3, 2.0, 4.0, 6.2].map(Vec2::from_angle).map(|across| (Azimuths::Across(across), across));
    for (azimuths, across) in even.into_iter().chain(turned) {
        let wall = |[right, left]: [f32; 2], along: Vec3| {
            let across = along.truncate().normalize_or_zero().dot(across);
            if across.abs() < 1e-6 { 0.0 } else { (across * right).max(-across * left) }
        };
        let map = HorizonMap::fill_rows(sides.len(), azimuths, 1e-4, |along, row| {
            row.iter_mut().zip(sides).for_each(|(slope, sides)| *slope = wall(sides, along));
            0
        });
        for direction in directions() {
            let mut visibility = [f32::NAN; 3];
            map.fill(direction, 0..3, &mut visibility);
            let slope = direction.z / direction.truncate().length();
            for (visible, sides) in visibility.into_iter().zip(sides) {
                let above = slope - wall(sides, direction);
                if above.abs() * direction.truncate().length() > 1e-4 && direction.z > 1e-4 {
                    assert_eq!(visible, f32::from(above > 0.0), "{azimuths:?}, {sides:?}, {direction}");
                }
            }
        }
    }
}

#[test]
fn free_facets_are_visible_and_blocked_facets_are_not_from_the_horizon_to_the_zenith() {
    for azimuths in [1, 3, 4, 5, 48] {
        for width in [0.0, 1e-4, 0.02, 1.0] {
            let slopes = (0..azimuths).flat_map(|_| [0.0, f32::INFINITY]).collect();
            let map = HorizonMap::from_slopes(2, azimuths, width, slopes);
            for direction in directions() {
                let mut visibility = [f32::NAN; 2];
                map.fill(direction, 0..2, &mut visibility);
                assert_eq!(visibility, [1.0, 0.0], "{azimuths} azimuths, width {width}, {direction}");
            }
        }
    }
}

#[test]
fn the_visibility_of_every_facet_lies_between_those_of_the_horizon_bounds() {
    let (azimuths, facets) = (7, 24);
    let slope = |k: usize| match k % 5 {
        0 => 0.0,
        1 if k.is_multiple_of(3) => f32::INFINITY,
        _ => (1.5 * (k as f32 * 0.754_877_7).fract()).tan(),
    };
    let map = HorizonMap::from_slopes(facets, azimuths, 0.02, (0..facets * azimuths).map(slope).collect());
    let runs = [0..1, 1..4, 4..facets];
    let bounds = map.horizon_bounds(&runs);
    let mut none_or_all = 0;
    for direction in directions() {
        let taps = map.taps(direction);
        let mut visibility = vec![f32::NAN; facets];
        map.fill(direction, 0..facets, &mut visibility);
        for (k, run) in runs.iter().enumerate() {
            let [a, b] = taps.azimuths.map(|azimuth| bounds[azimuth * runs.len() + k]);
            let [most, least] = [0, 1].map(|end| taps.between(a[end], b[end]).clamp(0.0, 1.0));
            none_or_all += usize::from(most == 0.0 || least == 1.0);
            assert!(visibility[run.clone()].iter().all(|&v| least <= v && v <= most), "{direction}");
        }
    }
    assert!(none_or_all > 500, "{none_or_all}");
}
