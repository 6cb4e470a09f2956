use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn skewed() -> SlopeTable {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let masses = (0..64).map(|_| (rng.random::<f64>() - 0.4).max(0.0)).collect();
    SlopeTable::new(8, DVec2::new(-0.4, -0.3), 0.1, masses).unwrap()
}

#[test]
fn slopes_have_the_density_of_the_table_by_a_chi_square_test() {
    let table = skewed();
    let (side, low, width) = (20, table.origin - 0.1, 0.9);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut counts = vec![0.0; side * side];
    for _ in 0..200_000 {
        let at = (table.slope(rng.random(), rng.random()) - low) / width * side as f64;
        counts[at.y as usize * side + at.x as usize] += 1.0;
    }
    // The density is bilinear in each cell of the table; 9 by 9 points of a bin average it.
    let expected: Vec<f64> = (0..side * side)
        .map(|bin| {
            let corner = DVec2::new((bin % side) as f64, (bin / side) as f64);
            let point = |k: usize| corner + (DVec2::new((k % 9) as f64, (k / 9) as f64) + 0.5) / 9.0;
            (0..81).map(|k| table.density(low + width / side as f64 * point(k))).sum()
        })
        .collect();
    let p = crate::testing::chi_square::p_value(&counts, &expected);
    assert!(p > 0.01, "{p}");
}

#[test]
fn a_table_integrates_to_one_and_turned_by_180_degrees_it_reads_the_opposite_slope() {
    let table = skewed();
    let mirrored = table.mirrored().unwrap();
    let mut sum = 0.0;
    for k in 0..360_000 {
        let m = table.origin - 0.1 + 0.9 / 600.0 * (DVec2::new((k % 600) as f64, (k / 600) as f64) + 0.5);
        sum += table.density(m) * (0.9 / 600.0_f64).powi(2);
        if k % 97 == 0 {
            assert!((table.density(m) - mirrored.density(-m)).abs() < 1e-9);
        }
    }
    assert!((sum - 1.0).abs() < 1e-4, "{sum}");
}

#[test]
fn tables_that_hold_no_distribution_are_refused() {
    assert!(SlopeTable::new(2, DVec2::ZERO, 0.1, vec![0.0; 4]).is_none());
    assert!(SlopeTable::new(2, DVec2::ZERO, 0.1, vec![1.0, -1.0, 1.0, 1.0]).is_none());
    assert!(SlopeTable::new(2, DVec2::ZERO, 0.1, vec![1.0, f64::NAN, 1.0, 1.0]).is_none());
    assert!(SlopeTable::new(2, DVec2::ZERO, 0.1, vec![1.0; 3]).is_none());
}

#[test]
fn all_mass_in_one_cell_stays_there() {
    let table = SlopeTable::of_slopes(&[(DVec2::new(0.3, 0.0), 2.0)], 32, DVec2::ZERO, 0.5).unwrap();
    let (mean, variance) = table.moments();
    assert!((mean - DVec2::new(0.3, 0.0)).length() < 1e-12 && variance < 3.0 * table.cell * table.cell);
    assert!(table.density(DVec2::new(0.3, 0.0)) > 0.0 && table.density(DVec2::new(-0.3, 0.0)) == 0.0);
}

#[test]
fn a_line_of_slopes_keeps_its_masses_and_samples_on_the_line() {
    let along = DVec2::new(0.6, 0.8);
    let slopes: Vec<_> = (0..200).map(|k| ((f64::from(k) / 100.0 - 1.0) * along, 1.0)).collect();
    let line = SlopeLine::new(&slopes, DVec2::ZERO, along, 64).unwrap();
    assert!(line.slope(0.2).perp_dot(along).abs() < 1e-12);
    assert!((line.slope(0.25).dot(along) + 0.5).abs() < 0.05);
    let (side, reach) = (900, 1.2);
    let cell = 2.0 * reach / f64::from(side);
    let at = |k: i32| DVec2::new(f64::from(k % side), f64::from(k / side)) * cell - reach;
    let sum: f64 = (0..side * side).map(|k| line.density(at(k)) * cell * cell).sum();
    assert!((sum - 1.0).abs() < 1e-2, "{sum}");
}
