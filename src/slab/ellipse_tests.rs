use super::*;

fn ellipses() -> [Ellipse; 4] {
    [
        Ellipse::new(Profile::Beckmann, DVec2::splat(0.2), 0.0).unwrap(),
        Ellipse::new(Profile::Beckmann, DVec2::new(0.5, 0.1), 0.4).unwrap(),
        Ellipse::new(Profile::Ggx, DVec2::splat(0.3), 0.0).unwrap(),
        Ellipse::new(Profile::Ggx, DVec2::new(0.1, 0.4), 1.0).unwrap(),
    ]
}

/// `∫ p (1 + k·m)+ dm` by slopes on a fine lattice of the unit square.
fn visible(ellipse: &Ellipse, k: DVec2) -> f64 {
    let side = 1500;
    let cell = |j: usize| (j as f64 + 0.5) / side as f64;
    let points = (0..side * side).map(|j| ellipse.slope(cell(j / side), cell(j % side)));
    points.map(|m| (1.0 + k.dot(m)).max(0.0)).sum::<f64>() / (side * side) as f64
}

#[test]
fn lambda_is_the_integral_over_the_slopes_that_a_direction_sees() {
    for ellipse in ellipses() {
        for k in [DVec2::new(1.0, 0.0), DVec2::new(-2.0, 3.0), DVec2::new(0.0, -20.0)] {
            let (closed, sum) = (1.0 + ellipse.lambda(k), visible(&ellipse, k));
            // The tail of GGX is cut by the lattice.
            let bound = if ellipse.profile == Profile::Ggx { 1.2e-2 } else { 3e-4 };
            assert!((closed / sum - 1.0).abs() < bound, "{ellipse:?} {k}: {closed} {sum}");
        }
    }
}

#[test]
fn visible_slopes_of_ggx_are_the_slopes_by_the_area_that_a_direction_sees() {
    let ellipse = Ellipse::new(Profile::Ggx, DVec2::new(0.15, 0.4), 0.6).unwrap();
    for w in [DVec3::new(0.7, 0.3, 0.65), DVec3::new(-0.2, 0.95, 0.15)] {
        let (w, side, cells, span) = (w.normalize(), 400, 12, 1.2);
        let bin = |m: DVec2| {
            let at = (m + span) / (2.0 * span) * cells as f64;
            let inside = at.min_element() >= 0.0 && at.max_element() < cells as f64;
            inside.then(|| at.y as usize * cells + at.x as usize)
        };
        let mut found = vec![0.0; cells * cells];
        for j in 0..side * side {
            let [u, v] = [j / side, j % side].map(|k| (k as f64 + 0.5) / side as f64);
            let m = ellipse.visible_slope(w, u, v).unwrap();
            // Every slope drawn is turned towards the direction.
            assert!(w.dot(m.extend(1.0)) > -1e-9);
            if let Some(bin) = bin(m) {
                found[bin] += 1.0 / (side * side) as f64;
            }
        }
        let (k, fine) = (w.truncate() / w.z, 50 * cells);
        let cell = 2.0 * span / fine as f64;
        let mut expected = vec![0.0; cells * cells];
        for j in 0..fine * fine {
            let m = (DVec2::new((j % fine) as f64, (j / fine) as f64) + 0.5) * cell - span;
            let seen = (1.0 + k.dot(m)).max(0.0) / (1.0 + ellipse.lambda(k));
            expected[bin(m).unwrap()] += ellipse.density(m) * seen * cell * cell;
        }
        let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{w}: {worst}");
    }
}

#[test]
fn densities_integrate_to_one_and_have_the_stated_spread() {
    for ellipse in ellipses() {
        let (side, span) = (1200, 3.0 * ellipse.span());
        let cell = 2.0 * span / side as f64;
        let at = |j: usize| (j as f64 + 0.5) * cell - span;
        let (mut mass, mut square) = (0.0, 0.0);
        for j in 0..side * side {
            let m = DVec2::new(at(j / side), at(j % side));
            let p = ellipse.density(m) * cell * cell;
            mass += p;
            square += p * m.length_squared();
        }
        let bound = if ellipse.profile == Profile::Ggx { 2e-2 } else { 1e-3 };
        assert!((mass - 1.0).abs() < bound, "{ellipse:?}: {mass}");
        if ellipse.profile == Profile::Beckmann {
            assert!((square / ellipse.variance() - 1.0).abs() < 1e-3);
        }
    }
}

#[test]
fn the_narrowest_axis_is_found_in_any_rotation() {
    assert!((ellipses()[1].narrowest() - 0.1).abs() < 1e-12);
    assert!((ellipses()[3].narrowest() - 0.1).abs() < 1e-12);
}
