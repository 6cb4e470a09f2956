//! True errors of shipped scenes and of hard tiles beside the errors that the program states.

use std::path::Path;

use biscale::metrics::{Pair, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene;
use biscale::scene::LoadedScene;

use crate::hard_tiles::{BOUNDS, Measured, PAIRS_SEED, RayCast, TrueValues, all, measure};
use crate::svg::{COLORS, Chart, LogAxis};
use crate::tiles::reference;

/// Number of pairs of shipped scenes.
const PAIRS: usize = 200;
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;
/// Bounds of the standard errors of true values, well below the 4 % that `fine` promises.
const RAYS: RayCast = RayCast { points: 4096, max_passes: 32, target: 4e-3 };
const REFERENCE: ReferenceSettings = ReferenceSettings { facets: 4096, max_passes: 12, target: 4e-3, seed: 99 };

/// Prints the errors of all scenes and draws them in `docs/measurements/errors.svg`, or prints the errors of the scenes
/// whose name contains `part`.
///
/// # Errors
/// The bench fails if a scene exceeds a bound without a warning, if the stated errors are not calibrated, or if the
/// chart cannot be written.
pub fn errors(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    let is_chosen = |name: &str| part.is_none_or(|part| name.contains(part));
    print(
        "| scene | preset | true error (seeds 1, 2, 3) | stated error | true PSNR | stated PSNR | reference |"
            .to_owned(),
    );
    print("|---|---|---|---|---|---|---|".to_owned());
    let mut found: Vec<(String, Measured)> = Vec::new();
    let mut examine = |name: &str, loaded: &LoadedScene, pairs: &[Pair], truth: &TrueValues| {
        for (preset, ..) in BOUNDS {
            let runs: Vec<Measured> = SEEDS.map(|seed| measure(loaded, preset, seed, pairs, truth)).collect();
            print(row(name, preset, &runs, truth));
            found.extend(runs.into_iter().map(|run| (name.to_owned(), run)));
        }
    };
    for tile in all().iter().filter(|tile| is_chosen(tile.name)) {
        let folder = tempfile::tempdir().map_err(|error| format!("temporary folder: {error}"))?;
        let loaded = tile.open(folder.path(), "standard", 1);
        let pairs = mirror_biased_pairs(tile.pairs(), PAIRS_SEED);
        examine(tile.name, &loaded, &pairs, &tile.true_values(&loaded, &pairs, &RAYS));
    }
    let pairs = mirror_biased_pairs(PAIRS, PAIRS_SEED);
    for name in scene::shipped::names().filter(|name| is_chosen(name)) {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).map_err(|error| error.to_string())?;
        examine(&format!("`{name}`"), &loaded, &pairs, &shipped_truth(&loaded, &pairs));
    }
    if part.is_none() {
        draw(&found)?;
    }
    summary(&found, print)
}

fn shipped_truth(loaded: &LoadedScene, pairs: &[Pair]) -> TrueValues {
    let (values, std_error) = reference(&Pipeline::new(), loaded, pairs, &REFERENCE);
    TrueValues { values, std_error }
}

fn row(name: &str, preset: &str, runs: &[Measured], truth: &TrueValues) -> String {
    let all = |value: &dyn Fn(&Measured) -> String| runs.iter().map(value).collect::<Vec<_>>().join(", ");
    let percent = |value: f64| format!("{:.2}", 100.0 * value);
    let reference =
        if truth.std_error > 0.0 { format!("± {} %", percent(truth.std_error)) } else { "closed form".to_owned() };
    format!(
        "| {name} | `{preset}` | {} % | {} % | {} dB | {} dB | {reference} |",
        all(&|run| format!("{}{}", if run.is_resolved { "" } else { "≈ " }, percent(run.errors.rel_l2))),
        all(&|run| run.stated.map_or("-".to_owned(), |(rel_l2, _)| percent(rel_l2))),
        all(&|run| format!("{:.1}", run.errors.psnr_db)),
        all(&|run| run.stated.map_or("-".to_owned(), |(_, psnr_db)| format!("{psnr_db:.1}"))),
    )
}

/// Prints the number of kept bounds and the calibration of the stated errors.
fn summary(found: &[(String, Measured)], print: &mut dyn FnMut(String)) -> Result<(), String> {
    print(String::new());
    for (preset, rel_l2, psnr_db) in BOUNDS {
        let runs = || found.iter().map(|(_, run)| run).filter(|run| run.preset == preset);
        let within = runs().filter(|run| run.is_within_bounds()).count();
        let broken = runs().filter(|run| run.broken_promise().is_some()).count();
        print(format!(
            "- `{preset}`: {within} of {} runs are within {:.0} % and {psnr_db} dB, {} warn, {broken} break the promise.",
            runs().count(),
            100.0 * rel_l2,
            runs().count() - within - broken
        ));
    }
    let ratios: Vec<f64> = found.iter().filter_map(|(_, run)| run.calibration()).collect();
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let good = ratios.iter().filter(|ratio| (0.5..=2.0).contains(*ratio)).count();
    let count = ratios.len();
    print(format!("- Stated over true: {good} of {count} runs between 0.5 and 2, at least {least:.2}."));
    let broken: Vec<String> =
        found.iter().filter_map(|(name, run)| Some(format!("{name}: {}", run.broken_promise()?))).collect();
    if !broken.is_empty() {
        return Err(format!("{} promises are broken:\n{}", broken.len(), broken.join("\n")));
    }
    if 10 * good < 9 * count || least < 1.0 / 3.0 {
        return Err(format!("found {good} of {count} ratios between 0.5 and 2 and a least ratio of {least:.2}"));
    }
    Ok(())
}

/// Draws stated against true errors, with lines at equal errors and at factors of 2 and 3.
fn draw(found: &[(String, Measured)]) -> Result<(), String> {
    let range = [1e-4, 1.0];
    let mut chart = Chart::new(LogAxis::over(range), "true relative L2", LogAxis::over(range), "stated relative L2");
    for (factor, color, dashed) in
        [(1.0, "#333", false), (2.0, "#999", true), (0.5, "#999", true), (3.0, "#ccc", true), (1.0 / 3.0, "#ccc", true)]
    {
        let (low, high) = (range[0] / f64::min(factor, 1.0), range[1] / f64::max(factor, 1.0));
        chart.line(&[(low, factor * low), (high, factor * high)], color, dashed);
    }
    for (k, (preset, ..)) in BOUNDS.into_iter().enumerate() {
        chart.dot(1.5e-4, 0.5 / 2.0_f64.powi(k as i32), 4.0, COLORS[k], preset);
        chart.label(1.5e-4, 0.42 / 2.0_f64.powi(k as i32), COLORS[k], preset);
        for (name, run) in found.iter().filter(|(_, run)| run.preset == preset && run.is_resolved) {
            if let Some((rel_l2, _)) = run.stated {
                chart.dot(run.errors.rel_l2, rel_l2, 2.5, COLORS[k], &format!("{name}, {preset}, seed {}", run.seed));
            }
        }
    }
    let style = "<style>text { font: 12px sans-serif; fill: #333; } .grid { stroke: #eee; }</style>\
                 <rect width='100%' height='100%' fill='#fff'/>";
    let svg = chart.finish().replacen("<svg ", "<svg xmlns='http://www.w3.org/2000/svg' ", 1).replacen(
        '>',
        &format!(">{style}"),
        1,
    );
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/measurements/errors.svg");
    std::fs::write(&path, svg).map_err(|error| format!("{}: {error}", path.display()))
}
