//! PSNR and time that `--target-db` and `--budget-ms` reach on shipped scenes. `benches/measure` includes this file.

use std::time::Instant;

use biscale::base::Cancel;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene;
use biscale::tuning::choose::{Target, choose};
use biscale::tuning::quality_scale::FINEST;
use glam::Vec3;

use crate::tiles::reference;

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

/// Pairs of a set. A few bright pairs decide the error of one set, so the error is the mean of several.
const SET: usize = 500;
const SETS: usize = 2;

/// Prints the chosen and the measured PSNR and time of every `step`th scene, for a target of 40 dB and a budget of 150
/// ms. Returns how many scenes reach the target and the budget, and the misses.
///
/// # Errors
/// If a scene misses the target by 6 dB.
pub fn choices(step: usize, print: &mut dyn FnMut(String)) -> Result<([usize; 2], Vec<String>), String> {
    let pairs = mirror_biased_pairs(SETS * SET, 99);
    print("| scene | 40 dB: said | got | time | 150 ms: said | got |".to_owned());
    print("|---|---|---|---|---|---|".to_owned());
    let (mut hits, mut misses) = ([0, 0], Vec::new());
    for name in SCENES.into_iter().step_by(step) {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).unwrap();
        // A seed that choosing does not use.
        let settings = ReferenceSettings { facets: 16_384, max_passes: 12, target: 2e-3, seed: 4711 };
        let (exact, std_error) = reference(&Pipeline::new(), &loaded, &pairs, &settings);
        let for_psnr = choose(&loaded, Target::Psnr(40.0), &Cancel::default(), |_| {}).unwrap();
        let outcome = Pipeline::new().effective(&for_psnr.scene).unwrap();
        let values: Vec<Vec3> = pairs.iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let power_of_set = |(values, exact): (&[Vec3], &[Vec3])| {
            let errors = compare(values, exact);
            // The standard error of the reference is subtracted in squares.
            let without = (errors.rel_l2.powi(2) - std_error.powi(2)).max(1e-12);
            10_f64.powf(-0.1 * errors.psnr_db) * without / errors.rel_l2.powi(2)
        };
        let power: f64 = values.chunks(SET).zip(exact.chunks(SET)).map(power_of_set).sum();
        let psnr_db = -10.0 * (power / SETS as f64).log10();
        let is_coarsest = for_psnr.reached.level == 0.0;
        let reaches_target = (psnr_db - 40.0).abs() <= 3.0 || (psnr_db > 40.0 && is_coarsest);
        hits[0] += usize::from(reaches_target);
        if !reaches_target {
            misses.push(format!("{name}: {psnr_db:.1} dB"));
        }
        if psnr_db <= 34.0 {
            return Err(format!("{name}: found {psnr_db:.1} dB, expected more than 34 dB"));
        }
        let budget_ms = 150.0;
        let for_time = choose(&loaded, Target::Milliseconds(budget_ms), &Cancel::default(), |_| {}).unwrap();
        let pipeline = Pipeline::new();
        pipeline.effective(&for_time.scene).unwrap();
        let mut times: Vec<f64> = (1..6)
            .map(|seed| {
                let mut scene = for_time.scene.clone();
                scene.scene.quality.seed ^= seed;
                let start = Instant::now();
                pipeline.effective(&scene).unwrap();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let ms = times[2];
        let is_finest = for_time.reached.level >= FINEST - 0.3;
        let keeps_budget = (ms / budget_ms - 1.0).abs() <= 0.2 || (ms < budget_ms && is_finest);
        hits[1] += usize::from(keeps_budget);
        if !keeps_budget {
            misses.push(format!("{name}: {ms:.0} ms"));
        }
        print(format!(
            "| `{name}` | {:.1} dB | {psnr_db:.1} dB | {:.1} ms | {:.1} ms | {ms:.1} ms |",
            for_psnr.reached.psnr_db, for_psnr.reached.ms, for_time.reached.ms
        ));
    }
    Ok((hits, misses))
}

/// Times hold on an idle machine only, so the test does not check them.
#[test]
#[ignore = "minutes of reference: three scenes; `cargo bench --bench measure -- choosing` prints ten"]
fn a_target_of_40_db_is_not_missed_by_6_db() {
    let (hits, misses) = choices(4, &mut |line| eprintln!("{line}")).unwrap();
    eprintln!("{hits:?} of three scenes reach the target and the budget; misses: {misses:?}");
}
