//! χ² tests of every sampling routine at the level 0.01 with Šidák's correction, and Monte Carlo tests of energy, as in
//! pbrt and Mitsuba.

use std::f64::consts::{PI, TAU};

use biscale::brdf::{Brdf, Term};
use biscale::geometry::{FacetSampler, Facets, SampleShift, TileMesh};
use biscale::math::directions::from_angles;
use biscale::metrics::{Pair, image_pairs, mirror_biased_pairs};
use biscale::{geometry, scene};
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[path = "../../src/testing/chi_square.rs"]
mod chi_square;

use chi_square::p_value;

/// Returns the level at which `tests` tests together reject a correct routine once in a hundred runs (Šidák).
fn level(tests: usize) -> f64 {
    1.0 - (1.0 - 0.01_f64).powf(1.0 / tests as f64)
}

fn tile(geometry: &str) -> TileMesh {
    let scene = scene::parse(&format!("[tile]\ngeometry = {geometry}\n")).unwrap();
    geometry::build(&scene.tile, std::path::Path::new("")).unwrap()
}

/// Returns the area of each triangle.
fn areas(mesh: &TileMesh) -> Vec<f64> {
    (0..mesh.triangles.len()).map(|t| mesh.triangle_area(t)).collect()
}

/// Returns the facets on each triangle, and those in each of sixteen equal parts of a triangle. The parts are pooled
/// over the triangles: with points that are more even than random ones, a test of many cells would not detect a bias.
fn counts(mesh: &TileMesh, facets: &Facets) -> [Vec<f64>; 2] {
    let [mut on, mut inside] = [vec![0.0; mesh.triangles.len()], vec![0.0; 64]];
    for s in 0..facets.len() {
        let triangle = facets.triangles[s] as usize;
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        // Facets beyond the edge of the tile are wrapped. The nearest copy is the facet.
        let near = |p: glam::DVec3| {
            let size = mesh.size.as_dvec2();
            let step = ((a + b + c) / 3.0 - p).truncate() / size;
            p + (step.round() * size).extend(0.0)
        };
        let p = near(facets.positions[s].as_dvec3());
        let whole = (b - a).cross(c - a);
        let share = |u: glam::DVec3, v: glam::DVec3| (u - p).cross(v - p).dot(whole) / whole.length_squared();
        let cell = [share(b, c), share(c, a), share(a, b)].map(|weight| (4.0 * weight).clamp(0.0, 3.0) as usize);
        on[triangle] += 1.0;
        inside[16 * cell[0] + 4 * cell[1] + cell[2]] += 1.0;
    }
    // The integer parts of the weights add up to three or two; other cells come from rounding at edges.
    let real = (0..64).filter(|k| (2..=3).contains(&(k / 16 + k / 4 % 4 + k % 4)));
    [on, real.map(|k| inside[k]).collect()]
}

#[test]
fn every_sampling_routine_passes_the_chi_squared_test() {
    let mut p_values: Vec<(String, f64)> = Vec::new();
    let shapes = [
        ("pyramids", r#"{ kind = "pyramids", spacing = 0.5, truncation = 0.3 }"#),
        ("trapezoids", r#"{ kind = "grooves", count = 2, bottom_width = 0.3 }"#),
    ];
    for (name, geometry) in shapes {
        let mesh = tile(geometry);
        let areas = areas(&mesh);
        let mut record = |what: &str, [on, inside]: [Vec<f64>; 2]| {
            p_values.push((format!("{what} on {name}, triangles"), p_value(&on, &areas)));
            p_values.push((format!("{what} on {name}, parts of them"), p_value(&inside, &[1.0; 16])));
        };
        // The random facets of the paper.
        record("random facets", counts(&mesh, &Facets::sample_wu2011(&mesh, 20_000, 7)));
        // Over random shifts, a systematic facet is uniformly distributed.
        let sampler = FacetSampler::new(&mesh);
        let mut all = counts(&mesh, &Facets::default());
        for seed in 0..1_000 {
            let facets = sampler.sample(&mesh, 997, SampleShift::from_seed(seed));
            for (all, one) in all.iter_mut().zip(counts(&mesh, &facets)) {
                all.iter_mut().zip(one).for_each(|(all, one)| *all += one);
            }
        }
        record("997,000 systematic facets", all);
    }
    // Lights of test pairs are uniform in solid angle up to 85°, and so are the viewers of every second pair.
    let pairs = mirror_biased_pairs(1_000_000, 12);
    let lowest = 85.0_f64.to_radians().cos();
    let binned = |directions: &mut dyn Iterator<Item = Vec3>| {
        let mut counts = vec![0.0; 20 * 40];
        for d in directions {
            let ring = ((f64::from(d.z) - lowest) / (1.0 - lowest) * 20.0).clamp(0.0, 19.0) as usize;
            let azimuth = (f64::from(d.y).atan2(f64::from(d.x)) / TAU + 1.0).fract() * 40.0;
            counts[ring * 40 + (azimuth as usize).min(39)] += 1.0;
        }
        counts
    };
    let even = vec![1.0 / 800.0; 800];
    p_values.push(("lights of pairs".to_owned(), p_value(&binned(&mut pairs.iter().step_by(2).map(|p| p.i)), &even)));
    p_values.push(("viewers of pairs".to_owned(), p_value(&binned(&mut pairs.iter().step_by(2).map(|p| p.o)), &even)));
    // Views of images are uniform in the square of the sine. Lights of every second pair are uniform in solid angle.
    let pairs = image_pairs(1_000_000, 13);
    let binned = |part: &dyn Fn(&Pair) -> (f64, Vec3)| {
        let mut counts = vec![0.0; 20 * 40];
        for (height, d) in pairs.iter().step_by(2).map(part) {
            let azimuth = (f64::from(d.y).atan2(f64::from(d.x)) / TAU + 1.0).fract() * 40.0;
            counts[((height * 20.0) as usize).min(19) * 40 + (azimuth as usize).min(39)] += 1.0;
        }
        counts
    };
    let views = binned(&|p| (1.0 - f64::from(p.o.z).powi(2), p.o));
    p_values.push(("views of images".to_owned(), p_value(&views, &even)));
    let lights = binned(&|p| (f64::from(p.i.z), p.i));
    p_values.push(("lights of images".to_owned(), p_value(&lights, &even)));
    for (what, p) in &p_values {
        eprintln!("p = {p:.4}  {what}");
        assert!(*p > level(p_values.len()), "{what}: p = {p}, below {}", level(p_values.len()));
    }
}

#[test]
fn the_chi_squared_test_rejects_a_bias_of_two_percent() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut fair = vec![0.0; 64];
    let mut biased = vec![0.0; 64];
    for _ in 0..1_000_000 {
        let u: f64 = random.random();
        fair[(u * 64.0) as usize] += 1.0;
        biased[(u.powf(1.02) * 64.0) as usize] += 1.0;
    }
    let even = vec![1.0 / 64.0; 64];
    assert!(p_value(&fair, &even) > 0.01 && p_value(&biased, &even) < 1e-6);
}

/// Integrates over uniform directions of the hemisphere, with error bars, as pbrt's test of energy does.
#[test]
fn conserving_brdfs_reflect_no_more_than_they_receive_and_the_quadrature_agrees() {
    let mut random = ChaCha8Rng::seed_from_u64(77);
    for term in [
        Term::Lambertian { albedo: Vec3::ONE },
        Term::CookTorrance { roughness: 0.2, f0: Vec3::ONE },
        Term::CookTorrance { roughness: 1.0, f0: Vec3::ONE },
        Term::Ggx { roughness: 0.2, f0: Vec3::ONE },
        Term::Ggx { roughness: 1.0, f0: Vec3::ONE },
    ] {
        let brdf = Brdf { terms: vec![term.clone()] };
        for theta in [0.0_f32, 0.7, 1.3, 1.5] {
            let i = from_angles(theta, 0.4);
            let (mut sum, mut squares) = (0.0, 0.0);
            const COUNT: usize = 200_000;
            for _ in 0..COUNT {
                let o = from_angles(random.random::<f32>().acos(), std::f32::consts::TAU * random.random::<f32>());
                let value = f64::from(brdf.f(Vec3::Z, i, o).x / i.z) * 2.0 * PI;
                sum += value;
                squares += value * value;
            }
            let n = COUNT as f64;
            let mean = sum / n;
            let error = ((squares / n - mean * mean) / n).sqrt();
            assert!(mean - 4.0 * error < 1.01, "{term:?} {theta}: {mean} ± {error}");
            let quadrature = f64::from(brdf.directional_albedo(theta, 96).x);
            assert!((mean - quadrature).abs() < 5.0 * error + 2e-3, "{term:?} {theta}: {mean} ± {error}, {quadrature}");
        }
    }
}
