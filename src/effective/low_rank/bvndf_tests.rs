use super::*;

/// Random numbers in `[0, 1)`: the visibility of uncorrelated facets.
fn noise(count: usize, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random::<f32>()).collect()
}

fn rows(grid: PolarGrid, facets: usize) -> VisibilityRows {
    VisibilityRows { grid, facets, rows: noise(grid.len() * facets, 5) }
}

#[test]
fn normal_deviates_pass_the_chi_squared_test() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let values: Vec<f64> = (0..1_000_000).map(|_| f64::from(gaussian(&mut rng))).collect();
    let p = crate::testing::chi_square::p_value_of_normal(&values);
    assert!(p > 0.01, "{p}");
}

#[test]
fn the_table_is_the_weighted_gram_matrix_in_mirrored_blocks_too() {
    // 168 nodes are three whole blocks of views and part of a fourth.
    let (grid, facets, columns) = (PolarGrid::new(6, 24), 37, 3);
    let visibility = rows(grid, facets);
    let (weights, y) = (noise(facets, 6), noise(facets * columns, 7));
    let table = visibility_table(&visibility, &weights, &y, columns);
    let nodes = grid.len();
    assert_eq!(table.len(), nodes * nodes * columns);
    let read: Vec<(usize, usize)> = (0..200).map(|k| (k * 7 % nodes, k * 31 % nodes)).collect();
    let part = visibility_at(&visibility, &weights, &y, columns, &read);
    for (at, (got, want)) in part.iter().zip(&table).enumerate() {
        let node = at / columns;
        let want = if read.contains(&(node / nodes, node % nodes)) { *want } else { 0.0 };
        assert!((got - want).abs() < 1e-5 * want.abs() + 1e-6, "{at}: {got} {want}");
    }
    for o in 0..nodes {
        for i in 0..nodes {
            for c in 0..columns {
                let v = |node: usize, s: usize| f64::from(visibility.rows[node * facets + s]);
                let want: f64 =
                    (0..facets).map(|s| f64::from(weights[s] * y[s * columns + c]) * v(i, s) * v(o, s)).sum();
                let got = f64::from(table[(o * nodes + i) * columns + c]);
                assert!((got - want).abs() < 1e-5 * want.abs() + 1e-6, "{i} {o} {c}: {got} {want}");
            }
        }
    }
}

/// `‖N - N L Lᵀ‖² / ‖N‖²` from an explicit N, over pairs of nodes weighted by solid angle.
fn lost(
    visibility: &VisibilityRows,
    weights: &[f32],
    features: &[f32],
    count: usize,
    leading: &[f32],
    rank: usize,
) -> f64 {
    let (nodes, facets) = (visibility.grid.len(), visibility.facets);
    let (mut all, mut left) = (0.0, 0.0);
    for o in 0..nodes {
        for i in 0..nodes {
            let measure = f64::from(visibility.grid.solid_angle(i) * visibility.grid.solid_angle(o));
            let n: Vec<f64> = (0..count)
                .map(|f| {
                    (0..facets)
                        .map(|s| {
                            let visible = visibility.rows[i * facets + s] * visibility.rows[o * facets + s];
                            f64::from(weights[s] * visible * features[s * count + f])
                        })
                        .sum()
                })
                .collect();
            let kept: Vec<f64> =
                (0..rank).map(|k| (0..count).map(|f| n[f] * f64::from(leading[f * rank + k])).sum()).collect();
            let norm: f64 = n.iter().map(|x| x * x).sum();
            all += measure * norm;
            left += measure * (norm - kept.iter().map(|x| x * x).sum::<f64>());
        }
    }
    left / all
}

#[test]
fn leading_features_lose_no_more_of_n_than_asked() {
    let (grid, facets, count) = (PolarGrid::new(4, 8), 60, 24);
    let visibility = rows(grid, facets);
    let weights = noise(facets, 8);
    // Features that decrease, as those of a basis do.
    let features: Vec<f32> = noise(facets * count, 9)
        .iter()
        .enumerate()
        .map(|(k, x)| (x - 0.5) * 0.75_f32.powi((k % count) as i32))
        .collect();
    let mut last = 0;
    for kept in [0.9, 0.99, 0.999] {
        let (leading, rank) = leading_features(&visibility, &weights, &features, count, kept, count, 1).unwrap();
        assert!(rank > last && rank < count, "{kept}: rank {rank}");
        last = rank;
        for a in 0..rank {
            for b in 0..rank {
                let dot: f32 = (0..count).map(|f| leading[f * rank + a] * leading[f * rank + b]).sum();
                assert!((dot - f32::from(a == b)).abs() < 1e-4, "columns {a} and {b} are not orthonormal: {dot}");
            }
        }
        let lost = lost(&visibility, &weights, &features, count, &leading, rank);
        // The sketch estimates N's energies; the factor two covers its noise.
        assert!(lost < 2.0 * (1.0 - kept), "{kept}: lost {lost} at rank {rank}");
    }
}

#[test]
fn features_that_depend_on_each_other_give_no_more_than_their_rank() {
    let (grid, facets) = (PolarGrid::new(4, 8), 40);
    let visibility = rows(grid, facets);
    let (weights, plain) = (noise(facets, 8), noise(facets * 3, 9));
    // Sixty features spanned by three, and more features than random vectors, which is the other branch.
    let features: Vec<f32> = (0..facets)
        .flat_map(|s| {
            (0..60).map({
                let plain = &plain;
                move |f| plain[s * 3 + f % 3] * (1.0 + f as f32)
            })
        })
        .collect();
    let (leading, rank) = leading_features(&visibility, &weights, &features, 60, 0.999_999, 8, 1).unwrap();
    assert_eq!(rank, 3);
    assert!(lost(&visibility, &weights, &features, 60, &leading, rank) < 1e-5);
}
