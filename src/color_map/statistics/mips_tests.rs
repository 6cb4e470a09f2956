use super::*;
use crate::color_map::StopMap;
use crate::color_map::stops::tests::map;
use crate::scene::{NoiseBasis, NoiseDriver};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn gaussian_noise() -> DriverGrid {
    DriverGrid::of_noise(&NoiseDriver { basis: NoiseBasis::Gaussian, cells: 64, octaves: 1, seed: 1 })
}

fn mean(map: &StopMap, reads: &[(f64, Normal)]) -> DVec3 {
    reads.iter().map(|(weight, at)| map.mean(at) * *weight).sum()
}

/// The colour of a Gaussian footprint by samples.
fn truth(grid: &DriverGrid, map: &StopMap, centre: DVec2, deviations: [f64; 2], random: &mut ChaCha8Rng) -> DVec3 {
    let mut draw = || crate::color_map::normal::quantile(random.random::<f64>().max(1e-300));
    let mut sum = DVec3::ZERO;
    for _ in 0..4000 {
        let offset = DVec2::new(deviations[0] * draw(), deviations[1] * draw());
        sum += map.color(grid_value(grid, centre + offset)) / 4000.0;
    }
    sum
}

fn error(width: [f64; 2], taps: u32) -> f64 {
    let (grid, map) = (gaussian_noise(), map("bands"));
    let mips = MomentMips::new(&grid);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let deviations = width.map(|width| width / 12.0_f64.sqrt());
    let covariance = DMat2::from_diagonal(DVec2::new(deviations[0].powi(2), deviations[1].powi(2)));
    let mut sum = 0.0;
    for _ in 0..150 {
        let centre = DVec2::new(random.random(), random.random()) * 512.0;
        let ours = mean(&map, &mips.reads(&grid, centre, covariance, taps));
        sum += (ours - truth(&grid, &map, centre, deviations, &mut random)).length_squared() / 3.0;
    }
    (sum / 150.0).sqrt()
}

#[test]
fn footprints_near_the_correlation_length_are_within_0_06_with_one_read_and_0_02_with_sixteen() {
    let (one, sixteen) = (error([8.0, 8.0], 1), error([8.0, 8.0], 16));
    println!("footprint 8 texels, correlation 8: one read {one:.4}, sixteen {sixteen:.4}");
    assert!(one < 0.06 && sixteen < 0.02, "{one} {sixteen}");
}

#[test]
fn narrow_long_and_magnified_footprints_are_right() {
    let (long, magnified) = (error([32.0, 4.0], 1), error([0.2, 0.2], 1));
    println!("footprint 32 x 4: {long:.4}; 0.2 x 0.2: {magnified:.4}");
    assert!(long < 0.04 && magnified < 0.05, "{long} {magnified}");
    let very_long = error([64.0, 1.0], 4);
    assert!(very_long < 0.04, "{very_long}");
}

#[test]
fn far_away_the_moments_are_those_of_the_surface_for_any_size_and_offset() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for size in [UVec2::new(1, 1), UVec2::new(37, 5), UVec2::new(64, 64)] {
        let values: Vec<f32> = (0..size.x * size.y).map(|_| 1000.0 + random.random::<f32>()).collect();
        let grid = DriverGrid::new(size, &values, 3);
        let mips = MomentMips::new(&grid);
        let far = DMat2::from_diagonal(DVec2::splat(1e12));
        let reads = mips.reads(&grid, DVec2::ZERO, far, 1);
        let at = reads[0].1;
        assert!(at.mean.abs() < 1e-4 && (at.deviation - mips.whole().deviation).abs() < 1e-6, "{size} {at:?}");
        if size.x == 1 {
            assert_eq!((grid.deviation, at.deviation), (0.0, 0.0));
        }
    }
}

#[test]
fn weights_of_reads_sum_to_one_and_their_spread_is_that_of_the_footprint() {
    let grid = gaussian_noise();
    for taps in [1, 4, 16] {
        let (part, offsets) = scheme(taps);
        let variance: f64 = part * part + offsets.iter().map(|(x, w)| x * x * w).sum::<f64>();
        assert!((variance - 1.0).abs() < 1e-3, "{taps}");
        for width in [[3.0, 3.0], [64.0, 1.0], [1e-9, 1e-9], [0.0, 0.0], [1e6, 1e-6]] {
            let covariance = DMat2::from_diagonal(DVec2::new(width[0] * width[0], width[1] * width[1]));
            let reads = MomentMips::new(&DriverGrid::new(UVec2::splat(2), &[0.0, 1.0, 1.0, 0.0], 1)).reads(
                &grid_of_two(),
                DVec2::ONE,
                covariance,
                taps,
            );
            assert!((reads.iter().map(|read| read.0).sum::<f64>() - 1.0).abs() < 1e-5, "{taps} {width:?}");
            assert!(reads.iter().all(|(_, at)| at.mean.is_finite() && at.deviation.is_finite()));
            assert!(reads.len() <= 4 * (MAX_READS + 1));
        }
    }
    assert!(grid.deviation > 0.0);
}

fn grid_of_two() -> DriverGrid {
    DriverGrid::new(UVec2::splat(2), &[0.0, 1.0, 1.0, 0.0], 1)
}
