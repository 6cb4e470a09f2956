//! What must be true of every case with every evaluator; a sentence each.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::cases::{brdfs, geometries};
use crate::lab::{ROWS, Row, examine};

/// All rows that break a rule, in one message.
pub fn assert_none(rows: impl Iterator<Item = String>) {
    let broken: Vec<String> = rows.collect();
    assert!(broken.is_empty(), "{} of the cases:\n{}", broken.len(), broken.join("\n"));
}

fn name(row: &Row) -> String {
    format!("{}: {}, {}", row.family, row.case, row.evaluator)
}

fn is_sound(row: &Row) -> Option<String> {
    (row.unsound > 0).then(|| format!("{}: {} values that are negative or not finite", name(row), row.unsound))
}

fn is_dark_under_the_horizon(row: &Row) -> Option<String> {
    (row.under_horizon > 0).then(|| format!("{}: {} values under the horizon", name(row), row.under_horizon))
}

/// A lobe may be brighter in the last hundredth of a degree, where Fresnel is 1, than anywhere that was looked at: a hundred
/// times at most.
fn keeps_calm_at_grazing(row: &Row) -> Option<String> {
    (row.explosion > 100.0).then(|| format!("{}: {:.1} times as bright at grazing", name(row), row.explosion))
}

/// G of the forms that are built so; the reference in standard errors, see `lab::reference`.
const RECIPROCITY: f64 = 1e-6;
/// Of the factored form: half vectors of (i,o) and (o,i) differ in their last bits, and lobes multiply that.
const FACTORED: f64 = 2e-5;

fn is_reciprocal(row: &Row) -> Option<String> {
    let limit = match row.evaluator {
        "reference" => 6e-8,
        "low rank" => FACTORED,
        _ => RECIPROCITY,
    };
    (row.reciprocity > limit).then(|| format!("{}: {:.1e} when swapped", name(row), row.reciprocity))
}

fn has_the_area_of_its_base(row: &Row) -> Option<String> {
    row.area.filter(|[error, bound]| error > bound).map(|pair| format!("{}: area {pair:?}", name(row)))
}

fn conserves_energy(row: &Row) -> Option<String> {
    row.albedo.filter(|[albedo, bound]| albedo > bound).map(|pair| format!("{}: albedo {pair:?}", name(row)))
}

/// All of them.
pub fn broken(row: &Row) -> Vec<String> {
    [
        is_sound,
        is_dark_under_the_horizon,
        keeps_calm_at_grazing,
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
fn nothing_reflects_with_light_or_viewer_at_or_under_the_horizon() {
    assert_none(ROWS.iter().filter_map(is_dark_under_the_horizon));
}

#[test]
fn nothing_explodes_in_the_last_hundredth_of_a_degree() {
    assert_none(ROWS.iter().filter_map(keeps_calm_at_grazing));
}

#[test]
fn light_and_viewer_swap_in_every_case_and_evaluator() {
    assert_none(ROWS.iter().filter_map(is_reciprocal));
}

#[test]
fn the_projected_area_of_closed_tiles_is_the_base_area_times_the_cosine() {
    assert_none(ROWS.iter().filter_map(has_the_area_of_its_base));
}

#[test]
fn no_case_sends_back_more_light_than_its_material() {
    assert_none(ROWS.iter().filter_map(conserves_energy));
}

#[test]
fn a_flat_white_tile_is_a_furnace_that_returns_everything() {
    for row in ROWS.iter().filter(|row| ["flat", "height 0"].contains(&row.case) && row.family.ends_with("white")) {
        if let Some([albedo, _]) = row.albedo {
            let most = if row.evaluator == "wu2011" { 0.1 } else { 0.02 };
            assert!((albedo - 1.0).abs() < most, "{}: {albedo}", name(row));
        }
    }
}

#[test]
#[ignore = "every eighth case; BISCALE_TABLE=1 for all, half an hour: the table that docs/hard_cases.txt keeps"]
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
    let mut beyond = Vec::new();
    let fine = std::env::var_os("BISCALE_WU2011_FULL").is_none().then_some(60);
    let mut cases = [geometries(), brdfs()].concat();
    if let Ok(part) = std::env::var("BISCALE_CASES") {
        cases.retain(|case| case.name.contains(&part) || case.family.contains(&part));
    } else if std::env::var_os("BISCALE_TABLE").is_none() {
        cases = cases.into_iter().step_by(8).collect();
    }
    for some in cases.chunks(4) {
        // A few side by side, in order.
        let examined: Vec<Vec<Row>> = some.par_iter().with_max_len(1).map(|case| examine(case, fine)).collect();
        for row in examined.into_iter().flatten() {
            beyond.extend(broken(&row));
            let pair = |pair: Option<[f64; 2]>| pair.map_or("-".to_owned(), |[a, b]| format!("{a:.3} ({b:.3})"));
            println!(
                "{:<18} {:<24} {:<10} {:>8} {:>8} {:>9.2} {:>9.1e}  {:>15} {:>15} {:>8.1}%",
                row.family,
                row.case,
                row.evaluator,
                row.unsound,
                row.under_horizon,
                row.explosion,
                row.reciprocity,
                pair(row.area),
                pair(row.albedo),
                100.0 * row.against_direct
            );
            let entry = worst.entry(row.evaluator).or_default();
            let part = |pair: Option<[f64; 2]>| pair.map_or(0.0, |[a, b]| a / b);
            let found = [(row.unsound + row.under_horizon) as f64, row.reciprocity, part(row.area), part(row.albedo)];
            for (worst, found) in entry.iter_mut().zip(found) {
                *worst = worst.max(found);
            }
        }
    }
    println!("\nworst, by evaluator: unsound values, swap, area and albedo as parts of their bounds");
    for (evaluator, [unsound, swap, area, albedo]) in worst {
        println!("{evaluator:<10} {unsound:>4} {swap:>9.1e} {area:>7.3} {albedo:>7.3}");
    }
    assert_none(beyond.into_iter());
}
