//! The models against photons.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::lobe::{LobeSettings, TrueLobe, cell_means};
use super::{PairSettings, PairTruth};
use crate::base::Cancel;
use crate::slab::{Channel, ChannelSlab, Inner, Ndf, Optics, Profile, Slab};

fn polar(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin, 0.0, cos)
}

fn beckmann(roughness: f64) -> Arc<Ndf> {
    Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::splat(roughness), 0.0))
}

fn ggx(roughness: f64) -> Arc<Ndf> {
    Arc::new(Ndf::analytic(Profile::Ggx, DVec2::splat(roughness), 0.0))
}

fn slab(top: &Arc<Ndf>, bottom: &Arc<Ndf>) -> Slab {
    Slab::new(top.clone(), bottom.clone(), Optics::default(), 512)
}

fn truth(slab: &Slab, degrees: f64, photons: usize) -> TrueLobe {
    let walk = ChannelSlab { top: &slab.top, bottom: &slab.bottom, channel: slab.optics.channel(0) };
    let settings = LobeSettings { photons, target: 0.01, ..LobeSettings::default() };
    TrueLobe::trace(&walk, polar(degrees), &settings, &Cancel::default()).unwrap()
}

fn single(slab: &Slab, degrees: f64, sub: usize) -> Vec<f64> {
    let i = polar(degrees);
    cell_means(96, sub, |o| slab.single_pass(i, o).x)
}

#[test]
fn one_rough_face_is_exact_within_two_per_cent_at_0_to_75_degrees() {
    let flat = Arc::new(Ndf::smooth());
    for (top, bottom) in [(beckmann(0.2), flat.clone()), (flat.clone(), ggx(0.2))] {
        let slab = slab(&top, &bottom);
        for degrees in [0.0, 45.0, 75.0] {
            let lobe = truth(&slab, degrees, 1_000_000);
            let error = lobe.relative_l2(&lobe.single, &single(&slab, degrees, 5));
            println!("one rough face, {}/{} at {degrees}: {:.1} %", top.describe(), bottom.describe(), 100.0 * error);
            assert!(error < 0.02, "{degrees}: {error}");
        }
    }
}

#[test]
fn eq_11_of_two_equal_faces_is_within_its_bound_at_0_to_60_degrees() {
    let slab = slab(&beckmann(0.2), &beckmann(0.2));
    assert_eq!(slab.alpha, 0.5);
    for (degrees, bound) in [(0.0, 0.02), (30.0, 0.05), (45.0, 0.07), (60.0, 0.14)] {
        let lobe = truth(&slab, degrees, 500_000);
        let error = lobe.relative_l2(&lobe.single, &single(&slab, degrees, 3));
        println!("Eq. 11, 0.2/0.2 at {degrees}: {:.1} %", 100.0 * error);
        assert!(error < bound, "{degrees}: {error}");
    }
}

#[test]
fn sums_over_64_and_256_facets_are_eq_1_within_their_bounds_to_75_degrees() {
    for (top, bottom) in [(beckmann(0.4), beckmann(0.4)), (beckmann(0.1), beckmann(0.3)), (ggx(0.2), ggx(0.2))] {
        let slab = slab(&top, &bottom);
        for degrees in [30.0, 75.0] {
            let lobe = truth(&slab, degrees, 500_000);
            for (count, bound) in [(64, 0.06), (256, 0.04)] {
                let faces = slab.clone().by_faces(count);
                let error = lobe.relative_l2(&lobe.single, &single(&faces, degrees, 2));
                println!(
                    "{count} facets, {}/{} at {degrees}: {:.1} %",
                    top.describe(),
                    bottom.describe(),
                    100.0 * error
                );
                assert!(error < bound, "{count} facets at {degrees}: {error}");
            }
        }
    }
}

#[test]
fn the_slab_turned_over_gives_the_same_values() {
    let skewed: Vec<_> = (0..2000)
        .map(|k| (DVec2::new(0.3 * (f64::from(k) * 0.37).sin().powi(2), 0.2 * (f64::from(k) * 0.71).cos()), 1.0))
        .collect();
    let table = Arc::new(Ndf::of_facets(&skewed, 64).unwrap());
    for slab in [slab(&beckmann(0.2), &beckmann(0.3)), slab(&ggx(0.1), &table), slab(&table, &Arc::new(Ndf::smooth()))]
    {
        for slab in [slab.clone(), slab.clone().by_faces(32)] {
            let turned = slab.turned();
            let over = DVec3::new(1.0, 1.0, -1.0);
            let (mut worst, mut peak) = (0.0_f64, 0.0_f64);
            for k in 0..400 {
                let [u, v] = [f64::from(k) * 0.7548 % 1.0, f64::from(k) * 0.5698 % 1.0];
                let o = DVec3::new(u - 0.9, v - 0.5, 0.0);
                let o = o.with_z(-(1.0 - o.length_squared()).max(0.01).sqrt()).normalize();
                let i = polar(30.0);
                let (a, b) = (slab.single_pass(i, o).x, turned.single_pass(o * over, i * over).x);
                worst = worst.max((a - b).abs());
                peak = peak.max(a);
            }
            println!("turned over: {:.1e} of the peak", worst / peak);
            assert!(worst < 1e-6 * peak, "{worst} {peak}");
        }
    }
}

#[test]
fn pairs_by_walks_agree_with_counted_photons_and_with_the_sum_of_facets() {
    let uneven = Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::new(0.3, 0.1), 0.4));
    let flat = Arc::new(Ndf::smooth());
    let half_level = Arc::new(
        Ndf::of_facets(
            &(0..800)
                .map(|k| {
                    (
                        if k % 2 == 0 {
                            DVec2::ZERO
                        } else {
                            DVec2::from_angle(f64::from(k)) * 0.3 * (f64::from(k) / 800.0).sqrt()
                        },
                        1.0,
                    )
                })
                .collect::<Vec<_>>(),
            64,
        )
        .unwrap(),
    );
    for (top, bottom) in
        [(beckmann(0.3), uneven.clone()), (uneven, flat), (half_level.clone(), beckmann(0.3)), (ggx(0.3), half_level)]
    {
        let slab = slab(&top, &bottom);
        let lobe = truth(&slab, 50.0, 1_000_000);
        let side = lobe.side;
        // Blocks of eight by eight cells around the lobe, each by one pair in the middle of each cell.
        for (x, y) in [(16, 40), (8, 48), (32, 40), (48, 48)] {
            let cells: Vec<usize> = (0..64).map(|k| (y + k / 8) * side + x + k % 8).collect();
            let direction = |cell: usize| {
                let at = (DVec2::new((cell % side) as f64, (cell / side) as f64) + 0.5) * (2.0 / side as f64) - 1.0;
                at.extend(-(1.0 - at.length_squared()).max(0.0).sqrt())
            };
            let pairs: Vec<_> = cells.iter().map(|cell| (polar(50.0), direction(*cell))).collect();
            let settings = PairSettings { walks: 4096, target: 0.0, bounces: true, seed: 3 };
            let truth =
                PairTruth::of_pairs((&top, &bottom), &slab.optics, &pairs, &settings, &Cancel::default()).unwrap();
            let cosine = polar(50.0).z;
            let by_walks: f64 = truth.iter().map(|pair| pair.f_bar.x / cosine).sum();
            let variance: f64 = truth.iter().map(|pair| (pair.standard_error.x / cosine).powi(2)).sum();
            let counted: f64 = cells.iter().map(|cell| lobe.all.values[*cell]).sum();
            let noise: f64 = cells.iter().map(|cell| lobe.all.variances[*cell]).sum();
            let bound = 4.0 * (variance + noise).sqrt() + 0.01 * counted;
            println!("pairs at ({x}, {y}): {by_walks:.4}, counted {counted:.4}, bound {bound:.4}");
            assert!((by_walks - counted).abs() < bound, "({x}, {y}): {by_walks} {counted} ± {bound}");
        }
    }
}

#[test]
fn all_light_with_bounces_is_within_eight_per_cent_and_its_total_within_two_to_75_degrees() {
    for (top, bottom) in [(beckmann(0.3), Arc::new(Ndf::smooth())), (ggx(0.3), ggx(0.3))] {
        let slab = slab(&top, &bottom).by_faces(64);
        let inner = Inner::new(&top, &bottom, &slab.optics, 16_384, 1, &Cancel::default()).unwrap();
        for degrees in [0.0, 60.0, 75.0] {
            let lobe = truth(&slab, degrees, 400_000);
            let (i, inner) = (polar(degrees), &inner);
            // The truth of normals has no place for masked light: compare without it.
            let masked = inner.parts(i, 0).masked;
            let cells = cell_means(96, 2, |o| {
                slab.single_pass(i, o).x + inner.btdf(i, o).x - 0.5 * masked / std::f64::consts::PI
            });
            let error = lobe.relative_l2(&lobe.all, &cells);
            let total = cells.iter().sum::<f64>() * (2.0 / 96.0_f64).powi(2);
            let expected = lobe.totals.transmitted.value - lobe.totals.straight.value;
            println!(
                "all light, {}/{} at {degrees}: {:.1} %, T {total:.4} for {expected:.4}",
                top.describe(),
                bottom.describe(),
                100.0 * error
            );
            assert!(error < 0.08, "{degrees}: {error}");
            assert!((total / expected - 1.0).abs() < 0.02, "{degrees}: {total} {expected}");
        }
    }
}

#[test]
fn a_flat_slab_of_photons_has_the_closed_transmittance() {
    let flat = Ndf::smooth();
    for degrees in [0.0, 45.0, 75.0, 85.0, 89.0] {
        let walk = ChannelSlab { top: &flat, bottom: &flat, channel: Channel { eta: 1.5, depth: 0.0 } };
        let settings = LobeSettings { photons: 1, ..LobeSettings::default() };
        let lobe = TrueLobe::trace(&walk, polar(degrees), &settings, &Cancel::default()).unwrap();
        let r = crate::slab::fresnel::reflectance(polar(degrees).z, 1.5);
        assert!((lobe.totals.straight.value - (1.0 - r) / (1.0 + r)).abs() < 1e-4, "{degrees}: {:?}", lobe.totals);
        assert!((lobe.totals.single_pass.value - (1.0 - r).powi(2)).abs() < 1e-9);
    }
}

#[test]
fn photons_agree_with_two_rough_dielectrics_of_mitsuba() {
    // Mitsuba 3.9.1: two `roughdielectric` samples in a row, 20,000 paths, η = 1.5: T with its standard error, mean and
    // deviation of o.x.
    let cases = [
        (beckmann(0.2), beckmann(0.2), 45.0, [0.8150, 0.0027, -0.6958, 0.1055]),
        (ggx(0.3), ggx(0.1), 30.0, [0.8498, 0.0025, -0.5092, 0.1670]),
        (beckmann(0.3), beckmann(0.3), 75.0, [0.2502, 0.0030, -0.8773, 0.0799]),
        (ggx(0.2), ggx(0.2), 60.0, [0.4698, 0.0034, -0.7846, 0.1295]),
    ];
    for (top, bottom, degrees, [total, error, mean, deviation]) in cases {
        let lobe = truth(&slab(&top, &bottom), degrees, 400_000);
        let found = lobe.totals.single_pass;
        let moments = crate::slab::DiscLobe {
            side: lobe.side,
            values: lobe.single.values.iter().map(|value| DVec3::splat(*value)).collect(),
        };
        let (found_mean, found_deviation) = moments.moments();
        println!(
            "{degrees}: T {:.4} for {total}, mean {:.4} for {mean}, width {:.4} for {deviation}",
            found.value, found_mean.x, found_deviation.x
        );
        assert!((found.value - total).abs() < 3.0 * error.hypot(found.standard_error), "{degrees}: {found:?} {total}");
        // The means of Mitsuba's 20,000 paths have a standard error of some 0.001.
        assert!((found_mean.x - mean).abs() < 0.005 && (found_deviation.x - deviation).abs() < 0.005, "{degrees}");
    }
}

#[test]
fn photons_are_the_same_for_any_number_of_threads() {
    let slab = slab(&beckmann(0.2), &ggx(0.1));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| truth(&slab, 40.0, 200_000));
    assert_eq!(one, truth(&slab, 40.0, 200_000));
}

/// A tile of smooth random waves with this deviation of slopes along each axis.
fn waves(deviation: f64, seed: u64) -> crate::geometry::TileMesh {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let side = 96;
    let mut waves = Vec::new();
    for x in -5_i32..=5 {
        for y in -5_i32..=5 {
            let square = x * x + y * y;
            if square > 0 && square <= 25 {
                waves.push((f64::from(x), f64::from(y), std::f64::consts::TAU * rng.random::<f64>()));
            }
        }
    }
    let height = |px: f64, py: f64| {
        waves.iter().map(|(x, y, phase)| (std::f64::consts::TAU * (x * px + y * py) + phase).cos()).sum::<f64>()
    };
    let squares: f64 = waves.iter().map(|(x, y, _)| 0.25 * std::f64::consts::TAU.powi(2) * (x * x + y * y)).sum();
    let scale = deviation / squares.sqrt();
    let at = |k: usize| (k as f64 + 0.5) / side as f64;
    let rows: Vec<Vec<f64>> = (0..side).map(|y| (0..side).map(|x| scale * height(at(x), at(y))).collect()).collect();
    let lowest = rows.iter().flatten().copied().fold(f64::MAX, f64::min);
    let values: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|height| height - lowest).collect()).collect();
    let geometry = toml::from_str(&format!("kind = \"heightfield\"\nheight_scale = 1.0\nvalues = {values:?}")).unwrap();
    crate::geometry::build(&crate::scene::Tile::of(geometry), std::path::Path::new("")).unwrap()
}

#[test]
fn the_normals_of_explicit_tiles_give_their_single_passes_and_half_of_masked_light_goes_through() {
    for (deviation, bound) in [(0.1, 0.05), (0.2, 0.05)] {
        let meshes = [1, 2].map(|seed| Arc::new(waves(deviation, seed)));
        let [top, bottom] = [0, 1].map(|k| Arc::new(crate::slab::of_mesh(&meshes[k], 0.0, 256).unwrap()));
        let [above, below] = meshes.map(|mesh| super::TracedTile::new(mesh).unwrap());
        let channel = Channel { eta: 1.5, depth: 0.0 };
        let tiles =
            super::TileSlab { top: Some(above), bottom: Some(below), channel, positions: super::Positions::Random };
        let slab = Slab::new(top.clone(), bottom.clone(), Optics::default(), 256).by_faces(256);
        let inner = Inner::new(&top, &bottom, &slab.optics, 16_384, 1, &Cancel::default()).unwrap();
        for degrees in [45.0, 75.0_f64] {
            let i = DVec3::new(degrees.to_radians().sin() * 0.94, degrees.to_radians().sin() * 0.34, 0.0);
            let i = i.with_z((1.0 - i.length_squared()).sqrt());
            let settings = LobeSettings { side: 48, photons: 260_000, target: 0.01, seed: 1 };
            let lobe = TrueLobe::trace(&tiles, i, &settings, &Cancel::default()).unwrap();
            let single = cell_means(48, 4, |o| slab.single_pass(i, o).x);
            let error = lobe.relative_l2(&lobe.single, &single);
            let all = single.iter().sum::<f64>() * (2.0 / 48.0_f64).powi(2);
            let bounced = cell_means(48, 2, |o| inner.btdf(i, o).x).iter().sum::<f64>() * (2.0 / 48.0_f64).powi(2);
            let (masked, traced) = (inner.parts(i, 0).masked, lobe.totals.transmitted.value);
            let part = (traced - (all + bounced - 0.5 * masked)) / masked;
            println!(
                "explicit tiles {deviation} at {degrees}: single passes {:.1} %, T {traced:.4} for {:.4}, of {masked:.3} masked {:.0} % go through, sum {:.5}",
                100.0 * error,
                all + bounced,
                100.0 * part,
                lobe.totals.sum.value
            );
            assert!((lobe.totals.sum.value - 1.0).abs() < 1e-9);
            if degrees == 45.0 {
                assert!(error < bound, "{deviation}: {error}");
            }
            assert!((traced - all - bounced).abs() < 0.03, "{traced} {all} {bounced}");
        }
    }
}
