//! `--target-db` and `--budget-ms` on scenes that nothing was tuned for: what was asked, what came out.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

use std::time::Instant;

use biscale::base::Cancel;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene;
use biscale::tuning::choose::{Target, choose};
use glam::Vec3;

const SCENES: [&str; 10] = [
    "fig1b_silver_shallow",
    "fig4a_pearl_cup",
    "fig4c_ward_cup",
    "fig5c_uneven",
    "fig5d_pentagonal",
    "fig6a_velvet_spread",
    "fig8a_hammered",
    "fig8b_ripples",
    "table4_teapot",
    "table4_cup",
];

/// Errors are reported over sets of so many pairs (DESIGN.md, Sec. 7); a few bright ones decide a single set's.
const SET: usize = 500;
const SETS: usize = 2;

/// A seed that choosing does not use.
fn right(loaded: &scene::LoadedScene, pairs: &[biscale::metrics::Pair]) -> (Vec<Vec3>, f64) {
    let settings = ReferenceSettings { facets: 16_384, max_passes: 12, target: 2e-3, seed: 4711 };
    let mut own = 0.0;
    let estimates = Pipeline::new()
        .with_reference(loaded, |reference| {
            reference.estimate(pairs, &settings, |_, error| {
                own = error;
                true
            })
        })
        .unwrap();
    (estimates.iter().map(|one| one.f_bar).collect(), own)
}

#[test]
#[ignore = "minutes of reference: three scenes; BISCALE_TABLE=1 prints asked, got and milliseconds of all ten"]
fn nine_of_ten_scenes_get_the_decibels_and_milliseconds_that_were_asked_for() {
    let pairs = mirror_biased_pairs(SETS * SET, 99);
    eprintln!("{:<24} {:>10} {:>10} {:>10} {:>10}", "scene", "asked", "said", "got", "ms");
    let (mut hits, mut misses) = ([0, 0], Vec::new());
    let all = std::env::var_os("BISCALE_TABLE").is_some();
    for name in SCENES.into_iter().step_by(if all { 1 } else { 4 }) {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).unwrap();
        let (truth, own) = right(&loaded, &pairs);
        let chosen = choose(&loaded, Target::Decibels(40.0), &Cancel::default(), |_| {}).unwrap();
        let outcome = Pipeline::new().effective(&chosen.scene).unwrap();
        let values: Vec<Vec3> = pairs.iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let of_set = |(values, truth): (&[Vec3], &[Vec3])| {
            let errors = compare(values, truth);
            // The truth has an error of its own.
            let ours = (errors.rel_l2.powi(2) - own.powi(2)).max(1e-12);
            10_f64.powf(-0.1 * errors.psnr_db) * ours / errors.rel_l2.powi(2)
        };
        let power: f64 = values.chunks(SET).zip(truth.chunks(SET)).map(of_set).sum();
        let got = -10.0 * (power / SETS as f64).log10();
        let coarsest = chosen.got.rung == 0.0;
        let good = (got - 40.0).abs() <= 3.0 || (got > 40.0 && coarsest);
        hits[0] += usize::from(good);
        if !good {
            misses.push(format!("{name}: {got:.1} dB"));
        }
        eprintln!("{name:<24} {:>7} dB {:>7.1} dB {got:>7.1} dB {:>7.1} ms", 40, chosen.got.psnr_db, chosen.got.ms);
        assert!(got > 34.0, "{name}: {got:.1} dB is not nearly 40");
        let asked = 150.0;
        let chosen = choose(&loaded, Target::Milliseconds(asked), &Cancel::default(), |_| {}).unwrap();
        let mut pipeline = Pipeline::new();
        pipeline.effective(&chosen.scene).unwrap();
        let mut times: Vec<f64> = (1..6)
            .map(|seed| {
                let mut scene = chosen.scene.clone();
                scene.scene.quality.seed ^= seed;
                let start = Instant::now();
                pipeline.effective(&scene).unwrap();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let got = times[2];
        let finest = chosen.got.rung >= biscale::tuning::quality_scale::FINEST - 0.3;
        let good = (got / asked - 1.0).abs() <= 0.2 || (got < asked && finest);
        hits[1] += usize::from(good);
        if !good {
            misses.push(format!("{name}: {got:.0} ms"));
        }
        eprintln!("{name:<24} {asked:>7} ms {:>7.1} ms {got:>7.1} ms", chosen.got.ms);
    }
    eprintln!("{hits:?} of ten, {misses:?}");
    // Times hold on an idle machine only, and nine of ten is said of ten.
    if all {
        assert!(hits[0] >= 9 && hits[1] >= 9, "{misses:?}");
    }
}
