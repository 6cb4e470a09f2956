//! Every kernel against a scalar loop.

use glam::Vec3;

use super::*;
use crate::brdf::{LobeAngles, Term};
use crate::math::directions::from_angles;

/// A reproducible stream of numbers in `[0, 1)`: the golden-ratio sequence.
fn uniform(k: usize, start: f64) -> f32 {
    (start + k as f64 * 0.618_033_988_749_894_9).fract() as f32
}

fn directions(count: usize, start: f64, max_theta: f32) -> Vec<Vec3> {
    (0..count)
        .map(|k| {
            from_angles(max_theta * uniform(k, start).sqrt(), std::f32::consts::TAU * uniform(k * k + 3 * k, start))
        })
        .collect()
}

fn split(normals: &[Vec3]) -> [Vec<f32>; 3] {
    std::array::from_fn(|axis| normals.iter().map(|n| n[axis]).collect())
}

/// Lobes over the whole range of a scene's parameters, with the terms that define them.
fn lobes() -> Vec<(Lobe, Term)> {
    let one = Vec3::ONE;
    let mut lobes = vec![(Lobe::Lambertian, Term::Lambertian { albedo: one })];
    for roughness in [0.02, 0.1, 0.2, 0.5, 1.0] {
        lobes.push((Lobe::cook_torrance(roughness), Term::CookTorrance { roughness, f0: one }));
        lobes.push((Lobe::ward(roughness), Term::Ward { roughness, specular: one }));
        lobes.push((Lobe::ggx(roughness), Term::Ggx { roughness, f0: one }));
    }
    for exponent in [0.0, 1.0, 50.0, 1000.0, 20_000.0] {
        lobes.push((Lobe::blinn_phong(exponent), Term::BlinnPhong { exponent, specular: one }));
    }
    lobes
}

/// Pairs up to grazing, every second one near the mirror direction.
fn pairs() -> Vec<PairVectors> {
    let lights = directions(40, 0.1, 1.56);
    let views = directions(40, 0.7, 1.56);
    let near_mirror = |i: Vec3| (Vec3::new(-i.x, -i.y, i.z) + Vec3::new(0.03, -0.02, 0.0)).normalize();
    (0..40).map(|k| PairVectors::new(lights[k], if k % 2 == 0 { views[k] } else { near_mirror(lights[k]) })).collect()
}

#[test]
fn lobe_values_and_sums_are_those_of_the_defining_terms() {
    // 203 is no multiple of a lane. Some normals point below the horizon, like those of overhangs.
    let normals = directions(203, 0.3, 2.4);
    let parts = split(&normals);
    let parts = [&parts[0][..], &parts[1], &parts[2]];
    let weights: Vec<f32> = (0..203).map(|k| 0.5 + uniform(k, 0.9)).collect();
    let (v_i, v_o): (Vec<f32>, Vec<f32>) = (0..203).map(|k| (uniform(k, 0.2), f32::from(k % 3 > 0))).unzip();
    for (lobe, term) in lobes() {
        for pair in pairs() {
            let plain: Vec<f32> = normals
                .iter()
                .map(|&n| {
                    let angles = LobeAngles::new(n, pair.i, pair.o, pair.h);
                    if angles.n_dot_i > 0.0 && angles.n_dot_o > 0.0 { term.lobe_cos(&angles) } else { 0.0 }
                })
                .collect();
            let mut values = vec![f32::NAN; 203];
            lobe_values(lobe, &pair, parts, &mut values);
            let largest = plain.iter().copied().fold(0.0_f32, f32::max);
            let difference = values.iter().zip(&plain).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max);
            assert!(difference <= 1e-4 * largest + 1e-20, "{lobe:?} {pair:?}: {difference} of {largest}");
            let want: f64 = (0..203).map(|k| f64::from(plain[k]) * f64::from(weights[k] * v_i[k] * v_o[k])).sum();
            let [got, doubled] = lobe_sums(
                lobe,
                &pair,
                parts,
                [&weights, &weights.iter().map(|w| 2.0 * w).collect::<Vec<_>>()],
                &v_i,
                &v_o,
            );
            assert!((got - want).abs() <= 1e-4 * f64::from(largest) * 203.0 + 1e-20, "{lobe:?}: {got} against {want}");
            assert_eq!(doubled, 2.0 * got);
        }
    }
}

#[test]
fn swapping_light_and_view_changes_no_bit_of_a_value() {
    let normals = directions(64, 0.3, 1.5);
    let parts = split(&normals);
    let parts = [&parts[0][..], &parts[1], &parts[2]];
    for (lobe, _) in lobes() {
        for pair in pairs() {
            let (mut forward, mut backward) = (vec![0.0; 64], vec![0.0; 64]);
            lobe_values(lobe, &pair, parts, &mut forward);
            lobe_values(lobe, &PairVectors::new(pair.o, pair.i), parts, &mut backward);
            assert_eq!(forward, backward, "{lobe:?}");
        }
    }
}

#[test]
fn gathered_dot_is_the_plain_product_of_two_interpolations() {
    for columns in [1, 7, 16, 33] {
        let table = |start: f64| -> Vec<f32> { (0..40 * columns).map(|k| uniform(k, start) - 0.5).collect() };
        let (u, p) = (table(0.1), table(0.6));
        let taps = |start: f64| -> [(usize, f32); 16] {
            std::array::from_fn(|t| ((uniform(t, start) * 40.0) as usize, uniform(t * 3, start)))
        };
        let (io, hd) = (taps(0.3), taps(0.8));
        let read = |table: &[f32], taps: &[(usize, f32)], c: usize| -> f64 {
            taps.iter().map(|&(node, w)| f64::from(w) * f64::from(table[node * columns + c])).sum()
        };
        let want: f64 = (0..columns).map(|c| read(&u, &io, c) * read(&p, &hd, c)).sum();
        let got = f64::from(gathered_dot(&u, &io, &p, &hd, columns));
        assert!((got - want).abs() < 1e-5 * columns as f64, "{columns}: {got} {want}");
    }
}

#[test]
fn blended_bits_are_the_weighted_bits_wherever_a_run_starts() {
    let facets: usize = 150;
    let rows: [Vec<u32>; 4] = std::array::from_fn(|row| {
        (0..facets.div_ceil(32))
            .map(|word| (0x9e37_79b9_u32.wrapping_mul((7 * row + 3 * word + 1) as u32)) ^ 0x5a5a_1234)
            .collect()
    });
    let weights = [0.1, 0.2, 0.3, 0.4];
    for first in [0, 1, 31, 32, 33, 63, 100, 149] {
        for count in [1, 5, 32, 50] {
            let count = count.min(facets - first);
            let mut got = vec![f32::NAN; count];
            blend_bits(rows.each_ref().map(Vec::as_slice), weights, first, &mut got);
            for (k, got) in got.iter().enumerate() {
                let s = first + k;
                let want: f32 =
                    (0..4).map(|row| if rows[row][s / 32] >> (s % 32) & 1 == 1 { weights[row] } else { 0.0 }).sum();
                assert!((got - want).abs() < 1e-6, "first {first}, facet {s}: {got} {want}");
            }
        }
    }
}

/// The taps of a direction for a transition of `1/sharpness`, with linear weights of the two azimuths.
fn taps(blend: f32, elevation: f32, sharpness: f32) -> HorizonTaps {
    let scale = elevation.cos() * sharpness;
    HorizonTaps {
        azimuths: [0, 1],
        blend,
        base: 0.5 + elevation.sin() * sharpness,
        scale,
        scales: [(1.0 - blend) * scale, blend * scale],
    }
}

#[test]
fn horizon_visibility_is_a_linear_transition_about_the_interpolated_slope() {
    let (from, to) = ([0.2_f32; 3], [0.4_f32; 3]);
    let mut out = [f32::NAN; 3];
    let cosine = 0.3_f32.atan().cos();
    // A part of the transition's width, which is 0.02 cos e at the elevation e of a horizon.
    for (part, want) in [(-5.0, 0.0), (-0.5, 0.0), (-0.25, 0.25), (0.0, 0.5), (0.4, 0.9), (0.5, 1.0), (40.0, 1.0)] {
        horizon_visibility(&from, &to, &taps(0.5, 0.3_f32.atan() + 0.02 * part * cosine, 50.0), &mut out);
        assert!(out.iter().all(|v| (v - want).abs() < 0.005), "{part}: {out:?}");
    }
}

#[test]
fn a_facet_switches_between_azimuths_if_their_horizons_differ_by_more_than_a_tenth_of_a_radian() {
    let (blocked, free) = (1e9, -0.02);
    // Below 0.2 the other rule decides.
    for elevation in [0.3_f32, 0.8, 1.5] {
        // 0.09 and 0.11 apart, or at the ends of the range.
        let [low, near, far] = [0.0, 0.09, 0.11].map(|more: f32| (elevation - 0.06 + more).tan());
        let from = [low, low, blocked, free, blocked];
        let to = [near, far, free, blocked, blocked];
        let mut out = [f32::NAN; 5];
        // At half the way, a facet that switches at 0.9 still has the visibility of the first azimuth.
        let at = taps(0.5, elevation, 100.0);
        stepped_visibility(&from, &to, &[0.9; 5], &at, &mut out);
        let interpolated = at.between(low, near).clamp(0.0, 1.0);
        for (got, want) in out.into_iter().zip([interpolated, 1.0, 0.0, 1.0, 0.0]) {
            assert!((got - want).abs() < 1e-5, "{elevation}: {out:?}");
        }
        assert!(at.between(low, far) < 1.0, "{elevation}: interpolation would differ");
    }
}

#[test]
fn a_facet_switches_between_azimuths_if_one_horizon_is_less_than_half_as_high() {
    let at = taps(0.5, 0.05_f32.atan(), 100.0);
    let (from, to) = ([0.025, 0.041], [0.08, 0.08]);
    let mut out = [f32::NAN; 2];
    stepped_visibility(&from, &to, &[0.9; 2], &at, &mut out);
    let interpolated = at.between(from[1], to[1]).clamp(0.0, 1.0);
    assert!((out[0] - 1.0).abs() < 1e-5 && (out[1] - interpolated).abs() < 1e-5, "{out:?}");
    assert!(at.between(from[0], to[0]) < 0.9 && interpolated < 0.9, "the two rules would agree");
}

#[test]
fn sums_of_areas_are_those_of_double_precision() {
    for n in [1, 63, 64, 65, 1024, 2500] {
        let stream = |start: f64| -> Vec<f32> { (0..n).map(|k| uniform(k, start)).collect() };
        let (w, w2, a, b) = (stream(0.1), stream(0.2), stream(0.3), stream(0.4));
        let plain = |w: &[f32]| -> f64 { (0..n).map(|k| f64::from(w[k]) * f64::from(a[k]) * f64::from(b[k])).sum() };
        let got = masked_sum([&w, &w2], &a, &b);
        assert!((got[0] / plain(&w) - 1.0).abs() < 1e-5 && (got[1] / plain(&w2) - 1.0).abs() < 1e-5, "{n}");
        let normals = directions(n, 0.5, 2.0);
        let [x, y, z] = split(&normals);
        let d = from_angles(1.2, 0.4);
        let want: f64 = (0..n).map(|k| f64::from(w[k]) * f64::from(a[k]) * f64::from(normals[k].dot(d).max(0.0))).sum();
        let got = projected_area([&x, &y, &z], &w, &a, d);
        assert!((got - want).abs() <= 1e-5 * want + 1e-9, "{n}: {got} {want}");
    }
}

#[test]
fn a_million_terms_lose_less_than_a_millionth() {
    let n = 1_000_000;
    let stream = |start: f64| -> Vec<f32> { (0..n).map(|k| uniform(k, start)).collect() };
    let (w, v, ones, zeros) = (stream(0.1), stream(0.7), vec![1.0_f32; n], vec![0.0_f32; n]);
    let want: f64 = w.iter().zip(&v).map(|(&w, &v)| f64::from(w) * f64::from(v)).sum();
    let got = masked_sum([&w], &v, &ones)[0];
    assert!((got / want - 1.0).abs() < 1e-6, "{got} {want}");
    let got = projected_area([&zeros, &zeros, &ones], &w, &v, Vec3::Z);
    assert!((got / want - 1.0).abs() < 1e-6, "{got} {want}");
    let pair = PairVectors::new(Vec3::Z, Vec3::Z);
    let got = lobe_sums(Lobe::Lambertian, &pair, [&zeros, &zeros, &ones], [&w], &v, &ones)[0] * std::f64::consts::PI;
    assert!((got / want - 1.0).abs() < 1e-6, "{got} {want}");
}

/// Prints the time per facet of each lobe. A lobe whose loop is not vectorised takes about ten times as long as the
/// others.
#[test]
#[ignore = "a measurement: cargo bench --bench measure -- lobes"]
fn nanoseconds_per_facet() {
    let n = 16_384;
    let parts = split(&directions(n, 0.3, 1.0));
    let parts = [&parts[0][..], &parts[1], &parts[2]];
    let ones = vec![1.0_f32; n];
    let pair = PairVectors::new(from_angles(0.5, 0.3), from_angles(0.4, 3.0));
    for lobe in [Lobe::Lambertian, Lobe::cook_torrance(0.2), Lobe::ward(0.3), Lobe::ggx(0.2), Lobe::blinn_phong(50.0)] {
        let best = (0..50)
            .map(|_| {
                let start = std::time::Instant::now();
                std::hint::black_box(lobe_sums(lobe, &pair, parts, [&ones], &ones, &ones));
                start.elapsed().as_secs_f64() * 1e9 / n as f64
            })
            .fold(f64::INFINITY, f64::min);
        println!("{lobe:?}: {best:.2} ns per facet");
    }
}

#[test]
fn lobes_of_many_lights_are_those_of_each_pair_by_itself() {
    let (lights, views) = (directions(37, 0.3, 1.56), directions(5, 0.7, 1.5));
    let mut pairs = LightPairs::new();
    for (lobe, _) in lobes() {
        for (&o, normal) in views.iter().zip(directions(5, 0.1, 1.2)) {
            pairs.set(&lights, o);
            let mut together = [0.0; LANES];
            light_lobes(lobe, &pairs, normal, &mut together);
            for (k, &i) in lights.iter().enumerate() {
                let mut alone = [0.0];
                let [x, y, z] = [normal.x, normal.y, normal.z];
                lobe_values(lobe, &PairVectors::new(i, o), [&[x], &[y], &[z]], &mut alone);
                // Half vectors differ by rounding, which the sharpest lobes amplify.
                assert!(
                    (together[k] - alone[0]).abs() <= 2e-3 * alone[0] + 1e-6,
                    "{lobe:?}: {} {}",
                    together[k],
                    alone[0]
                );
            }
        }
    }
}

#[test]
fn angles_of_lights_are_those_of_the_directions() {
    let lights = directions(64, 0.2, 1.57);
    let mut pairs = LightPairs::new();
    pairs.set(&lights, Vec3::Z);
    for (k, &light) in lights.iter().enumerate() {
        assert_eq!(azimuth_and_cosine(light), (pairs.azimuths[k], pairs.cosines[k]), "{light}");
        let (theta, phi) = crate::math::directions::to_angles(light);
        assert!((theta.sin() - pairs.cosines[k]).abs() < 1e-6, "{light}");
        assert!((phi / std::f32::consts::TAU - pairs.azimuths[k]).abs() < 1e-6, "{light}");
    }
}

#[test]
fn interpolated_rows_of_many_pairs_are_the_weighted_sums_of_their_nodes_for_any_number_of_columns() {
    use glam::Vec4;
    for vec4s in [1, 2, 3] {
        let grid = RowGrid { rings: 5, azimuths: 8, phi_d: 4, stored: 8, vec4s };
        let values: Vec<Vec4> = (0..5 * 8 * 4 * 8 * vec4s)
            .map(|k| Vec4::from_array(std::array::from_fn(|c| uniform(4 * k + c, 0.3))))
            .collect();
        // Both ends of each axis, and points between them.
        let count = 50;
        let spans = [4.0, 8.0, 4.0, 5.0, 1.0];
        let fraction = |k: usize, axis: usize| match k {
            0 => 0.0,
            1 => 1.0,
            k => uniform(k, 0.1 + 0.17 * axis as f64),
        };
        let coordinates = std::array::from_fn(|axis| std::array::from_fn(|k| spans[axis] * fraction(k, axis)));
        for cubic in [false, true] {
            let mut got = vec![Vec4::ZERO; count * vec4s];
            row_sums(&values, grid, &coordinates, count, cubic, &mut got);
            for (k, got) in got.chunks(vec4s).enumerate() {
                let [ring, azimuth, phi_d, step] = std::array::from_fn(|axis| coordinates[axis][k]);
                let hat = |node: usize, at: f32| (1.0 - (node as f32 - at).abs()).max(0.0);
                let round = |node: usize, at: f32, period: usize| hat(node, at) + hat(node + period, at);
                let low = step.floor().min(4.0);
                let along = |stored: usize| {
                    // Stored node 0 is the one before the grid's first node.
                    let d = (stored as f32 - 1.0 - low - (step - low)).abs();
                    match (cubic, d) {
                        (false, d) => (1.0 - d).max(0.0),
                        (true, d) if d < 1.0 => 1.5 * d.powi(3) - 2.5 * d * d + 1.0,
                        (true, d) if d < 2.0 => -0.5 * d.powi(3) + 2.5 * d * d - 4.0 * d + 2.0,
                        (true, _) => 0.0,
                    }
                };
                let mut want = vec![Vec4::ZERO; vec4s];
                for (at, value) in values.iter().enumerate() {
                    let (vec4, node) = (at % vec4s, at / vec4s);
                    let (stored, row) = (node % 8, node / 8);
                    let weight = hat(row / 32, ring) * round(row / 4 % 8, azimuth, 8) * round(row % 4, phi_d, 4);
                    want[vec4] += *value * (weight * along(stored));
                }
                for (got, want) in got.iter().zip(&want) {
                    assert!((*got - *want).abs().max_element() < 1e-5, "{vec4s} {cubic} {k}: {got} {want}");
                }
            }
        }
    }
}

#[test]
fn visible_areas_are_the_plain_sums_for_runs_of_any_length() {
    for count in [1, 9, 16, 57, 64, 1024, 1031, 2047] {
        let row = |start: f64| -> Vec<f32> { (0..count).map(|k| uniform(k, start)).collect() };
        let (weights, from, to) = (row(0.1), row(0.4), row(0.7));
        for (blend, elevation) in [(0.0, 0.3), (0.6, 0.5), (0.3, 1.5), (0.5, -1.0)] {
            let mut visibility = vec![0.0; count];
            let taps = taps(blend, elevation, 20.0);
            horizon_visibility(&from, &to, &taps, &mut visibility);
            let want: f64 = visibility.iter().zip(&weights).map(|(v, w)| f64::from(*v) * f64::from(*w)).sum();
            let got = visible_sum(&weights, &from, &to, &taps);
            assert!((got - want).abs() < 2e-5 * want + 1e-6, "{count} facets: {got} {want}");
        }
    }
}

#[test]
fn lobes_around_a_direction_are_those_of_the_defining_terms() {
    let to = directions(203, 0.3, 1.57);
    let parts = split(&to);
    let parts = [&parts[0][..], &parts[1], &parts[2]];
    let visibility: Vec<f32> = (0..203).map(|k| uniform(k, 0.2)).collect();
    let tints = [[0.5, 1.0], [0.2, 0.9]];
    for (lobe, term) in lobes() {
        for (normal, away) in directions(20, 0.4, 1.0).into_iter().zip(directions(20, 0.8, 1.5)) {
            let mut out = vec![1.0; 2 * 203];
            add_lobes_around::<2>(lobe, [normal, away], parts, &visibility, tints, &mut out);
            for (k, to) in to.iter().enumerate() {
                let angles = LobeAngles::new(normal, away, *to, crate::math::directions::half_vector(away, *to));
                let weight = crate::brdf::schlick_weight(angles.i_dot_h);
                for (c, [facing, grazing]) in tints.into_iter().enumerate() {
                    let right = term.lobe_cos(&angles) * visibility[k] * (facing + (grazing - facing) * weight);
                    let error = (out[203 * c + k] - 1.0 - right).abs();
                    assert!(error <= 2e-3 * right + 2e-5, "{lobe:?}, {normal}, {away}, {to}: {right}, off by {error}");
                }
            }
        }
    }
}
