//! Hard tiles: the invariants of every case, and known answers.

use std::collections::BTreeSet;

use biscale::base::Cancel;
use biscale::metrics::{Pair, compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use glam::Vec3;
use rayon::prelude::*;

use crate::cases::Case;
use crate::evaluators::Evaluator;
use crate::examination::{Row, measured, pairs};
use crate::hard_tiles::{HardTile, PAIRS_SEED, RayCast, Truth, all, measure};
use crate::invariants::{assert_none, violations};

/// Tiles of the ordinary tests. Each has a closed form and takes less than a second.
const QUICK: [&str; 6] = [
    "40 white texels",
    "mirrors, level",
    "white stripe",
    "grooves of 4 pitches",
    "grooves of 10 pitches, turned",
    "one hole of 2.25 %",
];

fn quick() -> Vec<HardTile> {
    all().into_iter().filter(|tile| QUICK.contains(&tile.name)).collect()
}

/// Returns the rows of evaluators on a hard tile.
fn rows(tile: &HardTile, preset: &str, evaluators: &[&'static str]) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let (tile_text, brdf) = (tile.tile.clone(), String::new());
    let case = Case { family: "hard tiles", name: tile.name, tile: tile_text, brdf, mesh: None };
    let pairs = pairs();
    let (mut direct, mut rows): (Vec<Vec3>, Vec<Row>) = Default::default();
    for &name in evaluators {
        let mut loaded = tile.open(folder.path(), preset, 1);
        let method = if name == "low rank" { "low_rank" } else { "direct" };
        loaded.scene.quality.method = Some(method.to_owned());
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let table = || outcome.shading_brdf(&Cancel::default()).unwrap().brdf;
        let brdf = if name == "table" { table() } else { outcome.brdf.clone() };
        let evaluator = Evaluator { name, brdf, health: outcome.health().clone() };
        if direct.is_empty() {
            direct = pairs.iter().map(|pair| evaluator.brdf.eval(pair.i, pair.o)).collect();
        }
        rows.push(measured(&case, &evaluator, &pairs, &direct));
    }
    rows
}

/// Returns the violations of all hard tiles.
fn all_violations(preset: &str, evaluators: &[&'static str]) -> Vec<String> {
    let of = |tile: &HardTile| rows(tile, preset, evaluators).iter().flat_map(violations).collect::<Vec<_>>();
    all().par_iter().with_max_len(1).flat_map_iter(of).map(|text| format!("{preset}: {text}")).collect()
}

#[test]
fn there_are_forty_hard_tiles_with_names_of_their_own() {
    let names: BTreeSet<&str> = all().iter().map(|tile| tile.name).collect();
    assert_eq!(names.len(), 40);
    assert!(QUICK.iter().all(|name| names.contains(name)));
}

#[test]
fn every_hard_tile_keeps_every_invariant_at_draft() {
    assert_none(all_violations("draft", &["direct"]).into_iter());
}

#[test]
#[ignore = "minutes: all presets, with direct sums, tables and low-rank factors"]
fn every_hard_tile_keeps_every_invariant_with_every_evaluator() {
    let violations = ["draft", "standard", "fine"].into_iter().flat_map(|preset| {
        // Low-rank factors at `fine` are left out to save time.
        let evaluators: &[&str] =
            if preset == "fine" { &["direct", "table"] } else { &["direct", "table", "low rank"] };
        all_violations(preset, evaluators)
    });
    assert_none(violations);
}

/// Fails if a closed form differs from the rays by more than four standard errors. Every second pair is near the normal,
/// so that it sees into deep grooves.
fn assert_closed_form(tile: &HardTile, settings: &RayCast) {
    let mut pairs = mirror_biased_pairs(200, 3);
    let lift = |direction: Vec3| (direction * Vec3::new(0.05, 0.05, 1.0)).normalize_or(Vec3::Z);
    pairs.iter_mut().step_by(2).for_each(|pair| *pair = Pair { i: lift(pair.i), o: lift(pair.o) });
    let folder = tempfile::tempdir().unwrap();
    let loaded = tile.open(folder.path(), "draft", 1);
    let exact = tile.true_values(&loaded, &pairs, settings);
    let cast = tile.ray_cast(&loaded, &pairs, settings);
    let error = compare(&cast.values, &exact.values).rel_l2;
    eprintln!("{}: rays differ by {:.2} % ± {:.2} %", tile.name, 100.0 * error, 100.0 * cast.std_error);
    assert!(exact.values.iter().any(|value| value.max_element() > 0.0), "{}: all values are 0", tile.name);
    // Few rays pass through the smallest holes.
    assert!(cast.std_error < 0.2, "{}: the standard error of the rays is {}", tile.name, cast.std_error);
    // Corners in f32 change the width of the thinnest stripes by 0.3 %.
    assert!(error < 4.0 * cast.std_error + 3e-3, "{}: {error}, expected {}", tile.name, cast.std_error);
}

#[test]
fn closed_forms_of_hard_tiles_agree_with_rays() {
    let settings = RayCast { points: 1024, max_passes: 8, target: 0.0 };
    quick().iter().for_each(|tile| assert_closed_form(tile, &settings));
}

#[test]
#[ignore = "a minute: all closed forms"]
fn every_closed_form_agrees_with_rays() {
    let settings = RayCast { points: 2048, max_passes: 16, target: 0.0 };
    let tiles = all().into_iter().filter(|tile| !matches!(tile.truth, Truth::RayCast));
    tiles.for_each(|tile| assert_closed_form(&tile, &settings));
}

#[test]
fn level_tiles_are_exact_at_every_preset_and_seed() {
    let tiles = all().into_iter().filter(|tile| matches!(tile.truth, Truth::Level(_)));
    let mut count = 0;
    for tile in tiles {
        let pairs = mirror_biased_pairs(50, PAIRS_SEED);
        let folder = tempfile::tempdir().unwrap();
        let loaded = tile.open(folder.path(), "draft", 1);
        let truth = tile.true_values(&loaded, &pairs, &RayCast { points: 1, max_passes: 1, target: 0.0 });
        for (preset, seed) in [("draft", 1), ("standard", 2), ("fine", 3)] {
            let error = measure(&loaded, preset, seed, &pairs, &truth).errors.rel_l2;
            // Corners in f32 change the width of the thinnest stripes by 0.3 %.
            assert!(error < 4e-3, "{}, {preset}: {error}", tile.name);
        }
        count += 1;
    }
    assert!(count > 8, "{count}");
}

#[test]
fn rare_texels_and_slots_on_relief_are_not_missed() {
    for (name, bound) in
        [("white texels on V-grooves", 0.5), ("white texels on hammered relief", 0.5), ("mirrors on rods", 0.5)]
    {
        let tile = all().into_iter().find(|tile| tile.name == name).unwrap();
        let pairs = mirror_biased_pairs(60, PAIRS_SEED);
        let folder = tempfile::tempdir().unwrap();
        let loaded = tile.open(folder.path(), "standard", 1);
        let truth = tile.true_values(&loaded, &pairs, &RayCast { points: 2048, max_passes: 8, target: 0.0 });
        for seed in 1..=3 {
            let error = measure(&loaded, "standard", seed, &pairs, &truth).errors.rel_l2;
            eprintln!("{name}, seed {seed}: {:.1} % ± {:.1} %", 100.0 * error, 100.0 * truth.std_error);
            assert!(error < bound, "{name}, seed {seed}: {error}");
        }
    }
}
