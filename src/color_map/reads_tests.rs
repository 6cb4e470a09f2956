use glam::DVec2;

use super::super::heights::pair_exponent;
use super::super::slopes::{Slopes, cotangent, direction};
use super::super::stops::tests::map;
use super::super::{Normal, StopMap};
use super::*;

fn near(ours: Vec3, exact: glam::DVec3, most: f64, what: &str) {
    let error = (ours.as_dvec3() - exact).abs().max_element();
    assert!(error < most, "{what}: {ours} {exact}");
}

#[test]
fn reads_of_textures_heights_and_slopes_are_the_means_under_their_normal_distributions() {
    let smooth: StopMap = map("ramp");
    let table = PrefilteredTable::new(&smooth);
    let reads = ColorReads::new(&table);
    let slopes = Slopes { mean: DVec2::new(0.05, -0.02), covariance: [0.12, 0.03, 0.09] };
    for theta in [0.0_f64, 20.0, 55.0, 75.0, 85.0, 86.0] {
        for phi in [0.0_f64, 0.6, 2.8] {
            let (o, i) = (direction(theta.to_radians(), 0.3), direction(0.9, 0.3 + phi));
            let nu = [slopes.nu(o), slopes.nu(i)];
            let heights = Largest { exponent: pair_exponent(lambda(nu[0]), lambda(nu[1]), phi) }.moments();
            let within = Within { mean: 0.2, deviation: 0.7 };
            let exact = smooth.mean(&Normal { mean: 0.2 + 0.7 * heights.mean, deviation: 0.7 * heights.deviation });
            near(reads.height(Vec2::new(nu[0] as f32, nu[1] as f32), phi as f32, within), exact, 2e-3, "heights");
            // The slope along 0.5 rad, standardized.
            let (azimuth, (_, t)) = (0.5_f64, cotangent(o));
            let unit = slopes.driver(azimuth);
            let axis = DVec2::from_angle(azimuth);
            let [xx, xy, yy] = slopes.covariance;
            let times = DVec2::new(xx * t.x + xy * t.y, xy * t.x + yy * t.y);
            let correlation = times.dot(axis) / (slopes.variance_along(t).sqrt() * unit.deviation);
            let seen = slopes.visible(o).driver(azimuth);
            let exact = smooth.mean(&Normal {
                mean: (seen.mean - unit.mean) / unit.deviation,
                deviation: seen.deviation / unit.deviation,
            });
            let within = Within { mean: 0.0, deviation: 1.0 };
            near(reads.slope(nu[0] as f32, correlation as f32, within), exact, 2e-3, "slopes");
        }
    }
    for (mean, deviation) in [(-9.0, 0.2), (0.3, 0.0), (0.1, 1.2), (2.9, 1.5)] {
        let exact = smooth.mean(&Normal { mean, deviation });
        near(reads.texture(Within { mean: mean as f32, deviation: deviation as f32 }), exact, 2e-3, "textures");
    }
}

#[test]
fn reads_are_finite_and_between_the_colours_of_the_stops_for_any_number() {
    let table = PrefilteredTable::new(&map("bands"));
    let reads = ColorReads::new(&table);
    for nu in [-1.0, 0.0, 1e-20, 1.0, 1e20, f32::INFINITY] {
        for within in [Within { mean: 0.0, deviation: 0.0 }, Within { mean: -1e9, deviation: 1e9 }] {
            for color in [reads.height(Vec2::new(nu, 0.5), 0.0, within), reads.slope(nu, -1.0, within)] {
                assert!(color.min_element() >= 0.0499 && color.max_element() <= 0.9501, "{nu} {within:?}: {color}");
            }
        }
    }
}

/// Milliseconds of an image of 1920 x 1080 pixels, the fastest of several.
fn milliseconds(color: impl Fn(usize) -> Vec3 + Sync) -> f64 {
    use rayon::prelude::*;
    let mut image = vec![Vec3::ZERO; 1920 * 1080];
    let mut fastest = f64::MAX;
    for _ in 0..7 {
        let start = std::time::Instant::now();
        image.par_chunks_mut(1920).enumerate().for_each(|(row, pixels)| {
            pixels.iter_mut().enumerate().for_each(|(column, pixel)| *pixel = color(row * 1920 + column));
        });
        fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
        assert!(std::hint::black_box(&image).iter().all(|color| color.is_finite()));
    }
    fastest
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- color-map-speed"]
fn the_table_of_speeds() {
    let bands = map("bands");
    let table = PrefilteredTable::new(&bands);
    let reads = ColorReads::new(&table);
    // Numbers that differ from pixel to pixel, as those of a noise do.
    let part = |k: usize, salt: usize| ((k * 2_654_435_761 + salt * 40_503) % 65_536) as f32 / 65_536.0;
    let numbers: Vec<[f32; 4]> = (0..1920 * 1080).map(|k| [part(k, 1), part(k, 2), part(k, 3), part(k, 4)]).collect();
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let rows = two.install(|| {
        let within = |n: &[f32; 4]| Within { mean: 4.0 * n[0] - 2.0, deviation: 0.02 + n[1] };
        let naive = milliseconds(|k| bands.color(f64::from(4.0 * numbers[k][0] - 2.0)).as_vec3());
        let texture = milliseconds(|k| reads.texture(within(&numbers[k])));
        let height = milliseconds(|k| {
            let n = &numbers[k];
            reads.height(Vec2::new(4.0 * n[2], 4.0 * n[3]), 3.0 * n[3], within(n))
        });
        let slope = milliseconds(|k| reads.slope(4.0 * numbers[k][2], numbers[k][3], within(&numbers[k])));
        let build = (0..5)
            .map(|_| {
                let start = std::time::Instant::now();
                std::hint::black_box(PrefilteredTable::new(&bands));
                start.elapsed().as_secs_f64() * 1e3
            })
            .fold(f64::MAX, f64::min);
        [("naive map", naive), ("texture", texture), ("heights", height), ("slopes", slope), ("stops to table", build)]
    });
    println!("| colour of 1920 x 1080 pixels on two cores | ms | relative to the naive map |");
    println!("|---|---|---|");
    for (name, ms) in rows {
        let ratio = if name == "stops to table" { "".to_owned() } else { format!("{:.1}", ms / rows[0].1) };
        println!("| {name} | {ms:.1} | {ratio} |");
    }
    println!("| tables together | {} kB | |", (table.bytes() + 2 * size_of::<Entries>()) / 1024);
}
