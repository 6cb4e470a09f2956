//! Invariants of every case with every evaluator, one per test.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::cases::{brdfs, geometries};
use crate::examination::{ROWS, Row, examine};

/// Fails with all violations in one message.
pub fn assert_none(violations: impl Iterator<Item = String>) {
    let violations: Vec<String> = violations.collect();
    assert!(violations.is_empty(), "{} violations:\n{}", violations.len(), violations.join("\n"));
}

fn name(row: &Row) -> String {
    format!("{}: {}, {}", row.family, row.case, row.evaluator)
}

fn is_sound(row: &Row) -> Option<String> {
    (row.unsound > 0).then(|| format!("{}: {} values that are negative or not finite", name(row), row.unsound))
}

fn is_zero_below_the_horizon(row: &Row) -> Option<String> {
    (row.below_horizon > 0).then(|| format!("{}: {} values above 0 below the horizon", name(row), row.below_horizon))
}

/// In the last hundredth of a degree, where Fresnel is 1, a lobe may be a hundred times as bright as elsewhere.
fn is_bounded_at_grazing(row: &Row) -> Option<String> {
    (row.grazing > 100.0).then(|| format!("{}: {:.1} times as bright at grazing", name(row), row.grazing))
}

/// Bound of the direct sum, the table and the paper's product.
const MAX_DIFFERENCE: f64 = 1e-6;
/// Bound of low-rank factors. Half vectors of (i, o) and (o, i) differ in their last bits, and lobes amplify that.
const MAX_DIFFERENCE_OF_FACTORS: f64 = 2e-5;

fn is_reciprocal(row: &Row) -> Option<String> {
    let limit = match row.evaluator {
        // Six standard errors.
        "reference" => 6e-8,
        "low rank" => MAX_DIFFERENCE_OF_FACTORS,
        _ => MAX_DIFFERENCE,
    };
    (row.reciprocity > limit).then(|| format!("{}: {:.1e} when swapped", name(row), row.reciprocity))
}

fn has_the_area_of_its_base(row: &Row) -> Option<String> {
    row.area.filter(|[error, bound]| error > bound).map(|pair| format!("{}: area {pair:?}", name(row)))
}

fn conserves_energy(row: &Row) -> Option<String> {
    row.albedo.filter(|[albedo, bound]| albedo > bound).map(|pair| format!("{}: albedo {pair:?}", name(row)))
}

/// Returns the violations of all invariants.
pub fn violations(row: &Row) -> Vec<String> {
    [
        is_sound,
        is_zero_below_the_horizon,
        is_bounded_at_grazing,
        is_reciprocal,
        has_the_area_of_its_base,
        conserves_energy,
    ]
    .iter()
    .filter_map(|rule| rule(row))
    .collect()
}

#[test]
fn every_value_of_every_case_and_evaluator_is_finite_and_not_negative() {
    assert_none(ROWS.iter().filter_map(is_sound));
}

#[test]
fn every_value_with_light_or_viewer_at_or_below_the_horizon_is_zero() {
    assert_none(ROWS.iter().filter_map(is_zero_below_the_horizon));
}

#[test]
fn values_in_the_last_hundredth_of_a_degree_are_bounded() {
    assert_none(ROWS.iter().filter_map(is_bounded_at_grazing));
}

#[test]
fn every_case_and_evaluator_is_reciprocal() {
    assert_none(ROWS.iter().filter_map(is_reciprocal));
}

#[test]
fn the_projected_area_of_closed_tiles_is_the_base_area_times_the_cosine() {
    assert_none(ROWS.iter().filter_map(has_the_area_of_its_base));
}

#[test]
fn no_case_reflects_more_light_than_its_material() {
    assert_none(ROWS.iter().filter_map(conserves_energy));
}

#[test]
fn a_flat_white_tile_reflects_all_light() {
    for row in ROWS.iter().filter(|row| ["flat", "height 0"].contains(&row.case) && row.family.ends_with("white")) {
        if let Some([albedo, _]) = row.albedo {
            let most = if row.evaluator == "wu2011" { 0.1 } else { 0.02 };
            assert!((albedo - 1.0).abs() < most, "{}: {albedo}", name(row));
        }
    }
}

/// Prints the rows of every eighth case, or of all with `BISCALE_TABLE=1`. `BISCALE_CASES` selects the cases whose name
/// or family contains it. With `BISCALE_WU2011_FULL=1`, the paper's basis has its full number of directions.
#[test]
#[ignore = "minutes: every eighth case; `cargo bench --bench measure -- hard-cases` runs all"]
fn the_table_of_all_cases_and_evaluators() {
    println!(
        "{:<18} {:<24} {:<10} {:>8} {:>8} {:>9} {:>9}  {:>15} {:>15} {:>9}",
        "family",
        "case",
        "evaluator",
        "unsound",
        "horizon",
        "grazing",
        "swap",
        "area (bound)",
        "albedo (bound)",
        "direct"
    );
    let mut worst: BTreeMap<&str, [f64; 4]> = BTreeMap::new();
    let mut found = Vec::new();
    let m_directions = std::env::var_os("BISCALE_WU2011_FULL").is_none().then_some(60);
    let mut cases = [geometries(), brdfs()].concat();
    if let Ok(part) = std::env::var("BISCALE_CASES") {
        cases.retain(|case| case.name.contains(&part) || case.family.contains(&part));
    } else if std::env::var_os("BISCALE_TABLE").is_none() {
        cases = cases.into_iter().step_by(8).collect();
    }
    for some in cases.chunks(4) {
        // Four at a time, in order.
        let examined: Vec<Vec<Row>> = some.par_iter().with_max_len(1).map(|case| examine(case, m_directions)).collect();
        for row in examined.into_iter().flatten() {
            found.extend(violations(&row));
            let pair = |pair: Option<[f64; 2]>| pair.map_or("-".to_owned(), |[a, b]| format!("{a:.3} ({b:.3})"));
            println!(
                "{:<18} {:<24} {:<10} {:>8} {:>8} {:>9.2} {:>9.1e}  {:>15} {:>15} {:>8.1}%",
                row.family,
                row.case,
                row.evaluator,
                row.unsound,
                row.below_horizon,
                row.grazing,
                row.reciprocity,
                pair(row.area),
                pair(row.albedo),
                100.0 * row.against_direct
            );
            let entry = worst.entry(row.evaluator).or_default();
            let part = |pair: Option<[f64; 2]>| pair.map_or(0.0, |[a, b]| a / b);
            let parts = [(row.unsound + row.below_horizon) as f64, row.reciprocity, part(row.area), part(row.albedo)];
            for (worst, part) in entry.iter_mut().zip(parts) {
                *worst = worst.max(part);
            }
        }
    }
    println!("\nworst values per evaluator: unsound values, swap, and area and albedo divided by their bounds");
    for (evaluator, [unsound, swap, area, albedo]) in worst {
        println!("{evaluator:<10} {unsound:>4} {swap:>9.1e} {area:>7.3} {albedo:>7.3}");
    }
    assert_none(found.into_iter());
}
