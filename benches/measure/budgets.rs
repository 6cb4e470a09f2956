//! Time that `--budget-ms` leads to on shipped scenes.

use std::time::Instant;

use biscale::base::Cancel;
use biscale::pipeline::Pipeline;
use biscale::scene;
use biscale::tuning::choose::{Target, choose};
use biscale::tuning::quality_scale::FINEST;

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

/// Prints the time that a budget of 150 ms leads to. Returns how many of ten scenes keep it within 20 %, and the others.
pub fn budgets(print: &mut dyn FnMut(String)) -> (usize, Vec<String>) {
    print("| scene | 150 ms: said | got |".to_owned());
    print("|---|---|---|".to_owned());
    let (mut hits, mut misses) = (0, Vec::new());
    for name in SCENES {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).unwrap();
        let budget_ms = 150.0;
        let chosen = choose(&loaded, Target::Milliseconds(budget_ms), &Cancel::default(), |_| {}).unwrap();
        let pipeline = Pipeline::new();
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
        let ms = times[2];
        let is_finest = chosen.reached.level >= FINEST - 0.3;
        let keeps_budget = (ms / budget_ms - 1.0).abs() <= 0.2 || (ms < budget_ms && is_finest);
        hits += usize::from(keeps_budget);
        if !keeps_budget {
            misses.push(format!("{name}: {ms:.0} ms"));
        }
        print(format!("| `{name}` | {:.1} ms | {ms:.1} ms |", chosen.reached.ms));
    }
    (hits, misses)
}
