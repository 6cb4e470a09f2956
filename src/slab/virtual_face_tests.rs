use super::super::ellipse::Profile;
use super::super::spread::r2;
use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn skewed(seed: u64) -> Ndf {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut slopes = Vec::new();
    for _ in 0..40_000 {
        let (a, b): (f64, f64) = (rng.random(), rng.random());
        slopes.push((DVec2::new(0.4 * a * a - 0.1, 0.3 * (b - 0.5) * (1.0 + a)), 1.0));
    }
    Ndf::of_facets(&slopes, 64).unwrap()
}

/// Relative L2 of a density against four million pairs of slopes that are spread evenly (the R4 sequence).
fn error(top: &Ndf, bottom: &Ndf, face: &Spread, span: f64) -> f64 {
    let (side, pairs) = (40, 4_000_000);
    let cell = 2.0 * span / side as f64;
    let mut counts = vec![0.0; side * side];
    for k in 1..=pairs {
        let at = |step: f64| (0.5 + f64::from(k) * step).fract();
        let m = top.facet(at(0.856_674_883_854_502_9), at(0.733_891_856_627_126)).0
            - bottom.facet(at(0.628_706_721_037_808_7), at(0.538_597_257_223_610_1)).0;
        let at = (m + span) / cell;
        if at.min_element() >= 0.0 && at.max_element() < side as f64 {
            counts[at.y as usize * side + at.x as usize] += 1.0;
        }
    }
    let (mut difference, mut norm) = (0.0, 0.0);
    for (k, count) in counts.iter().enumerate() {
        let corner = DVec2::new((k % side) as f64, (k / side) as f64);
        let point = |j: usize| (corner + (DVec2::new((j % 8) as f64, (j / 8) as f64) + 0.5) / 8.0) * cell - span;
        let mean = (0..64).map(|j| face.density(point(j))).sum::<f64>() / 64.0;
        let (found, expected) = (count / f64::from(pairs), mean * cell * cell);
        difference += (found - expected).powi(2);
        norm += found * found;
    }
    (difference / norm).sqrt()
}

#[test]
fn the_virtual_face_is_the_distribution_of_four_million_differences_of_slopes() {
    let beckmann = |x, y| Ndf::analytic(Profile::Beckmann, DVec2::new(x, y), 0.3);
    let ggx = |roughness| Ndf::analytic(Profile::Ggx, DVec2::splat(roughness), 0.0);
    let cases = [
        ("Beckmann", beckmann(0.2, 0.1), beckmann(0.1, 0.3), 0.9),
        ("two tables", skewed(1), skewed(2), 0.6),
        ("table and Beckmann", skewed(1), beckmann(0.2, 0.2), 0.7),
        ("table and narrow Beckmann", skewed(1), beckmann(0.002, 0.1), 0.6),
        ("GGX", ggx(0.2), ggx(0.2), 1.2),
    ];
    for (name, top, bottom, span) in cases {
        for (side, bound) in [(256, 0.02), (512, 0.005)] {
            let face = virtual_face(&top, &bottom, side);
            let error = error(&top, &bottom, &face, span);
            println!("virtual face, {name}, {side} x {side}: {:.2} %", 100.0 * error);
            assert!(error < bound, "{name}, {side}: {error}");
        }
    }
}

#[test]
fn points_of_both_faces_make_points_of_the_virtual_face() {
    let groove = |x: f64| Ndf::of_facets(&[(DVec2::new(x, 0.0), 1.0), (DVec2::new(-x, 0.0), 1.0)], 64).unwrap();
    let Spread::Table(table) = virtual_face(&groove(0.5), &groove(0.2), 128) else { panic!("no table") };
    let mass = |x: f64| {
        let node = |k: usize| table.origin + table.cell * DVec2::new((k % 128) as f64, (k / 128) as f64);
        let near = |k: usize| (node(k) - DVec2::new(x, 0.0)).length() < 0.05;
        (0..128 * 128).filter(|k| near(*k)).map(|k| table.masses[k]).sum::<f64>()
    };
    for x in [0.7, 0.3, -0.3, -0.7] {
        assert!((mass(x) - 0.25).abs() < 1e-9, "{x}: {}", mass(x));
    }
}

#[test]
fn squares_of_roughness_do_not_add_for_ggx() {
    let a = Ndf::analytic(Profile::Ggx, DVec2::splat(0.2), 0.0);
    let face = virtual_face(&a, &a, 512);
    let one = Ndf::analytic(Profile::Ggx, DVec2::splat(0.08_f64.sqrt()), 0.0);
    let (mut difference, mut norm) = (0.0, 0.0);
    for k in 0..20_000 {
        let m = (DVec2::from_array(r2(k)) - 0.5) * 2.2;
        difference += (face.density(m) - one.density(m)).powi(2);
        norm += face.density(m).powi(2);
    }
    let error = (difference / norm).sqrt();
    assert!((0.2..0.3).contains(&error), "{error}: 0.252 was expected");
}
