//! What must be true of every case with every evaluator; a sentence each.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::cases::{brdfs, geometries};
use crate::lab::{ROWS, Row, examine};

/// All rows that break a rule, in one message.
fn assert_none(rows: impl Iterator<Item = String>) {
    let broken: Vec<String> = rows.collect();
    assert!(broken.is_empty(), "{} of the cases:\n{}", broken.len(), broken.join("\n"));
}

fn name(row: &Row) -> String {
    format!("{}: {}, {}", row.family, row.case, row.evaluator)
}

#[test]
fn every_value_of_every_case_and_evaluator_is_finite_and_not_negative() {
    assert_none(ROWS.iter().filter(|row| row.unsound > 0).map(|row| format!("{}: {}", name(row), row.unsound)));
}

#[test]
fn nothing_reflects_with_light_or_viewer_at_or_under_the_horizon() {
    assert_none(ROWS.iter().filter(|r| r.under_horizon > 0).map(|r| format!("{}: {}", name(r), r.under_horizon)));
}

#[test]
fn nothing_explodes_in_the_last_hundredth_of_a_degree() {
    // A lobe may be brighter there, where Fresnel is 1, than anywhere that was looked at: a hundred times at most.
    assert_none(ROWS.iter().filter(|r| r.explosion > 100.0).map(|r| format!("{}: {:.1}", name(r), r.explosion)));
}

/// G of the forms that are built so; the reference in standard errors, see `lab::reference`.
const RECIPROCITY: f64 = 1e-6;
/// Of the factored form: half vectors of (i,o) and (o,i) differ in their last bits, and lobes multiply that.
const FACTORED: f64 = 2e-5;

#[test]
fn light_and_viewer_swap_in_every_case_and_evaluator() {
    let limit = |row: &Row| match row.evaluator {
        "reference" => 6e-8,
        "low rank" => FACTORED,
        _ => RECIPROCITY,
    };
    assert_none(
        ROWS.iter().filter(|r| r.reciprocity > limit(r)).map(|r| format!("{}: {:.1e}", name(r), r.reciprocity)),
    );
}

#[test]
fn the_projected_area_of_closed_tiles_is_the_base_area_times_the_cosine() {
    let beyond = |row: &&Row| row.area.is_some_and(|[error, bound]| error > bound);
    assert_none(ROWS.iter().filter(beyond).map(|row| format!("{}: {:?}", name(row), row.area)));
}

#[test]
fn no_case_sends_back_more_light_than_its_material() {
    let beyond = |row: &&Row| row.albedo.is_some_and(|[albedo, bound]| albedo > bound);
    assert_none(ROWS.iter().filter(beyond).map(|row| format!("{}: {:?}", name(row), row.albedo)));
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
}
