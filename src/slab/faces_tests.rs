use super::super::ellipse::Profile;
use super::*;

#[test]
fn sums_in_single_precision_are_those_in_double_precision() {
    let analytic = |profile, x, y| Ndf::analytic(profile, DVec2::new(x, y), 0.3);
    let slopes: Vec<_> = (0..900)
        .map(|k| (DVec2::new(0.3 * (f64::from(k) * 0.37).sin().powi(2), 0.2 * (f64::from(k) * 0.71).cos()), 1.0))
        .collect();
    let mixed: Vec<_> = slopes.iter().copied().chain([(DVec2::new(0.2, -0.1), 90.0), (DVec2::ZERO, 90.0)]).collect();
    let line: Vec<_> = (0..200).map(|k| (DVec2::new(f64::from(k) * 0.003 - 0.2, 0.0), 1.0)).collect();
    let of = |facets: &[(DVec2, f64)]| Ndf::of_facets(facets, 64).unwrap();
    let faces = [
        analytic(Profile::Beckmann, 0.2, 0.3),
        analytic(Profile::Ggx, 0.1, 0.2),
        analytic(Profile::Beckmann, 0.005, 0.4),
        of(&slopes),
        of(&mixed),
        of(&line),
    ];
    for (top, bottom) in faces.iter().flat_map(|top| faces.iter().map(move |bottom| (top, bottom))) {
        let sum = FaceSum::new(top, bottom, 24);
        for (eta, depth) in [(1.5, 0.0), (1.1, 0.3)] {
            for degrees in [0.0, 50.0, 80.0, 89.0_f64] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let i = (sin * DVec2::from_angle(1.0)).extend(cos);
                let rows = [i, i.with_z(-i.z)].map(|w| sum.row(top, bottom, w, Channel { eta, depth }));
                let (mut worst, mut peak) = (0.0_f64, 0.0_f64);
                for k in 0..60 {
                    let at = 0.98 * f64::from(k).sqrt() / 60f64.sqrt() * DVec2::from_angle(2.4 * f64::from(k));
                    let z = (1.0 - at.length_squared()).sqrt();
                    for (row, sign) in rows.iter().zip([1.0, -1.0]) {
                        let found = row.btdf(at.extend(-sign * z));
                        let pair = |k: usize| {
                            let (up, down) = (i, at.extend(-z));
                            if (k == 0) == (sign > 0.0) { (up, down) } else { (from_above(down), up.with_z(-up.z)) }
                        };
                        let used: Vec<f64> = row
                            .passes
                            .iter()
                            .enumerate()
                            .filter(|(_, pass)| !pass.facets.is_empty())
                            .map(|(k, pass)| {
                                let (i, o) = pair(k);
                                pass.in_double_precision(i, o)
                            })
                            .collect();
                        let expected = used.iter().sum::<f64>() / used.len() as f64;
                        worst = worst.max((found - expected).abs());
                        peak = peak.max(expected);
                    }
                }
                let names = format!("{}/{}", top.describe(), bottom.describe());
                assert!(worst <= 2e-3 * peak + 1e-12, "{names}, {eta} at {degrees}: {worst} of {peak}");
            }
        }
    }
}
