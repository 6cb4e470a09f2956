use super::*;

const GRID: Grid = Grid { width: 5, height: 4 };

/// A blend of the two slices.
fn between(weight: f64) -> SliceBlend {
    SliceBlend::new(Between { lower: 0, weight: 0.0 }, Between { lower: 0, weight }, 2)
}

/// Two slices with zeros among their values.
fn densities() -> Vec<f64> {
    (0..2 * GRID.len()).map(|k| ((k * 7) % 5) as f64 + if k >= GRID.len() { 1.0 } else { 0.0 }).collect()
}

#[test]
fn inversion_is_the_cumulative_integral_of_the_interpolated_density() {
    let warp = Warp::new(GRID, densities()).unwrap();
    let slice = between(0.3);
    let density = |at: [f64; 2]| slice.mix(|s| GRID.eval(&warp.density[s * GRID.len()..(s + 1) * GRID.len()], at));
    let n = 400;
    let at = [0.63, 0.41];
    let mid = |k: usize, end: f64| (k as f64 + 0.5) / n as f64 * end;
    let row = |end: f64, y: f64| (0..n).map(|k| density([mid(k, end), y])).sum::<f64>() * end;
    let expected_x = row(at[0], at[1]) / row(1.0, at[1]);
    let area = |end: f64| (0..n).map(|k| row(1.0, mid(k, end))).sum::<f64>() * end;
    let expected_y = area(at[1]) / area(1.0);
    let [x, y] = warp.invert(slice, at);
    assert!((x - expected_x).abs() < 1e-4 && (y - expected_y).abs() < 1e-4, "{x} {expected_x} {y} {expected_y}");
}

#[test]
fn a_constant_density_is_the_identity_and_corners_stay() {
    let flat = Warp::new(GRID, vec![3.0; GRID.len()]).unwrap();
    let only = SliceBlend::only(0);
    for at in [[0.0, 0.0], [0.2, 0.9], [0.77, 0.5], [1.0, 1.0]] {
        let [x, y] = flat.invert(only, at);
        assert!((x - at[0]).abs() < 1e-12 && (y - at[1]).abs() < 1e-12);
    }
    let warp = Warp::new(GRID, densities()).unwrap();
    let [x, y] = warp.invert(between(0.5), [1.0, 1.0]);
    assert!((x - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12);
}

#[test]
fn sampling_undoes_inversion_and_reports_the_density() {
    let warp = Warp::new(GRID, densities()).unwrap();
    for slice in [0, 1] {
        let density = |at: [f64; 2]| GRID.eval(&warp.density[slice * GRID.len()..(slice + 1) * GRID.len()], at) * 12.0;
        for k in 0..200 {
            let numbers = [(f64::from(k) * 0.618_034) % 1.0, (f64::from(k) + 0.5) / 200.0];
            let (at, found) = warp.sample(slice, numbers);
            let back = warp.invert(SliceBlend::only(slice), at);
            assert!((back[0] - numbers[0]).abs() < 1e-9 && (back[1] - numbers[1]).abs() < 1e-9, "{numbers:?} {back:?}");
            assert!((found - density(at)).abs() < 1e-9, "{found} {}", density(at));
        }
    }
}

#[test]
fn samples_pass_the_chi_squared_test_for_their_density() {
    use rand::{RngExt, SeedableRng};
    let warp = Warp::new(GRID, densities()).unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    const SIDE: usize = 24;
    for slice in [0, 1] {
        let mut counts = vec![0.0; SIDE * SIDE];
        for _ in 0..500_000 {
            let ([x, y], _) = warp.sample(slice, [rng.random(), rng.random()]);
            let cell = |at: f64| ((at * SIDE as f64) as usize).min(SIDE - 1);
            counts[cell(y) * SIDE + cell(x)] += 1.0;
        }
        // No cell contains a node, and the density is bilinear, so the mean over a cell is the value at its centre.
        let at = |k: usize| (k as f64 + 0.5) / SIDE as f64;
        let values = &warp.density[slice * GRID.len()..(slice + 1) * GRID.len()];
        let expected: Vec<f64> = (0..SIDE * SIDE).map(|k| GRID.eval(values, [at(k % SIDE), at(k / SIDE)])).collect();
        let p = crate::testing::chi_square::p_value(&counts, &expected);
        // Šidák: two tests at 0.01 together.
        assert!(p > 1.0 - 0.99_f64.sqrt(), "{slice}: {p}");
    }
}

#[test]
fn four_slices_are_weighted_bilinearly() {
    let blend = SliceBlend::new(Between { lower: 1, weight: 0.25 }, Between { lower: 0, weight: 0.5 }, 3);
    let value = blend.mix(|slice| [0.0, 0.0, 0.0, 1.0, 3.0, 0.0, 5.0, 11.0][slice]);
    assert!((value - (0.75 * 2.0 + 0.25 * 8.0)).abs() < 1e-12);
}

#[test]
fn positions_are_found_between_samples_and_are_constant_beyond_the_ends() {
    let values = [0.0, 1.0, 4.0];
    for (value, lower, weight) in [(-1.0, 0, 0.0), (0.5, 0, 0.5), (1.0, 1, 0.0), (3.0, 1, 2.0 / 3.0), (9.0, 1, 1.0)] {
        let found = Between::find(&values, value);
        assert!(found.lower == lower && (found.weight - weight).abs() < 1e-12, "{value}");
    }
    let alone = Between::find(&[0.5], 3.0);
    assert!(alone.lower == 0 && alone.weight == 0.0);
}

#[test]
fn densities_that_cannot_be_sampled_are_refused() {
    assert!(Warp::new(GRID, vec![0.0; GRID.len()]).is_err());
    let mut negative = vec![1.0; GRID.len()];
    negative[3] = -0.5;
    assert!(Warp::new(GRID, negative).is_err());
}
