//! Error and time of the light that facets send to each other, against path tracing.

use std::ops::RangeInclusive;
use std::path::Path;

use biscale::effective::Representation;
use biscale::metrics::{Pair, mirror_biased_pairs};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::reference::ReferenceSettings;
use biscale::report::svg::{Chart, LogAxis};
use biscale::scene::{LoadedScene, Switch};

use crate::tiles::open;

const BRDFS: [(&str, &str, &str); 6] = [
    ("matte 0.9", r#"{ kind = "lambertian", albedo = 0.9 }"#, "#2563eb"),
    ("matte 0.99", r#"{ kind = "lambertian", albedo = 0.99 }"#, "#0891b2"),
    ("GGX 0.1", r#"{ kind = "ggx", roughness = 0.1, f0 = 1 }"#, "#475569"),
    ("GGX 0.2", r#"{ kind = "ggx", roughness = 0.2, f0 = 1 }"#, "#d97706"),
    ("GGX 0.5", r#"{ kind = "ggx", roughness = 0.5, f0 = 1 }"#, "#b91c1c"),
    ("mixture", r#"[{ kind = "lambertian", albedo = 0.4 }, { kind = "ggx", roughness = 0.2, f0 = 0.5 }]"#, "#7c3aed"),
];
const PRESETS: [&str; 3] = ["draft", "standard", "fine"];
const BOUNCES: [usize; 5] = [1, 2, 4, 8, 16];
/// As many as a scene can ask for.
const ALL: usize = 64;
const PAIRS: usize = 48;
/// Relative L2 of the standard errors at which path tracing ends.
const TARGET: f64 = 0.005;
/// Numbers of independent references per case, whose spread is the standard error.
const SEEDS: RangeInclusive<u64> = 8..=256;
/// The tiles that the plots show, the first with solid lines.
const DRAWN: [&str; 2] = ["V-grooves", "egg-crate"];
/// The plots of the errors against bounces and against time.
const PLOTS: [&str; 2] =
    ["docs/measurements/interreflection_bounces.svg", "docs/measurements/interreflection_time.svg"];

/// The interreflected part of `f̄` at some pairs by path tracing, and the relative L2 of its standard errors.
struct Traced {
    values: Vec<f64>,
    std_error: f64,
}

/// Errors of one tile and BRDF (relative L2 of the interreflected part), with milliseconds.
struct Row {
    name: String,
    color: &'static str,
    std_error: f64,
    share: f64,
    presets: Vec<(f64, f64)>,
    /// Errors that the results of the presets state.
    stated: Vec<f64>,
    bounces: Vec<(f64, f64)>,
}

/// Prints the errors of all cases, or of those whose name contains `part`.
///
/// # Errors
/// A plot cannot be written.
pub fn interreflection(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    let pairs = mirror_biased_pairs(PAIRS, 12);
    let columns: Vec<String> = PRESETS.iter().map(|preset| format!("`{preset}`")).collect();
    let limits: Vec<String> = BOUNCES.iter().map(|count| format!("at most {count}")).collect();
    print(format!(
        "| tile, BRDF | share | {} | {} | path tracing |\n|---|---|{}---|",
        columns.join(" | "),
        limits.join(" | "),
        "---|".repeat(columns.len() + limits.len())
    ));
    let mut rows = Vec::new();
    for (tile, geometry) in tiles() {
        for (brdf, spec, color) in BRDFS {
            let name = format!("{tile}, {brdf}");
            if part.is_none_or(|part| name.contains(part)) {
                rows.push(measure(name, [&geometry, spec], color, &pairs));
                print(rows[rows.len() - 1].text());
            }
        }
    }
    if part.is_none() {
        for (path, plot) in PLOTS.iter().zip([against_bounces(&rows), against_time(&rows)]) {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
            std::fs::write(&path, plot).map_err(|error| format!("{}: {error}", path.display()))?;
        }
    }
    Ok(())
}

fn tiles() -> [(&'static str, String); 4] {
    const N: usize = 32;
    let grooves =
        r#"{ kind = "grooves", profile = "v", count = 2, depth = 0.25, side_angle_deg = 45, rotation_deg = 0 }"#;
    let at = |k: usize| (std::f64::consts::TAU * (k as f64 + 0.5) / N as f64).sin();
    let row = |j: usize| (0..N).map(|i| format!("{:.6}", 0.15 * at(i) * at(j))).collect::<Vec<_>>().join(",");
    let rows: Vec<String> = (0..N).map(|j| format!("[{}]", row(j))).collect();
    [
        ("V-grooves", grooves.to_owned()),
        ("egg-crate", format!(r#"{{ kind = "heightfield", values = [{}] }}"#, rows.join(","))),
        ("pyramids", r#"{ kind = "pyramids", height = 0.5 }"#.to_owned()),
        ("weave", r#"{ kind = "weave", pattern = "twill" }"#.to_owned()),
    ]
}

fn scene([geometry, brdf]: [&str; 2], preset: &str, bounces: usize) -> LoadedScene {
    let mut loaded = open(geometry, brdf, preset);
    loaded.scene.effects.interreflection = if bounces > 0 { Switch::On } else { Switch::Off };
    loaded.scene.effects.bounces = bounces.max(1);
    loaded
}

fn traced(tile: [&str; 2], pairs: &[Pair]) -> Traced {
    let mut moments = vec![[0.0_f64; 2]; pairs.len()];
    let mut seed = 0;
    loop {
        seed += 1;
        // Both estimates sum the same facets, so that direct reflection cancels.
        let settings = ReferenceSettings { facets: 4096, max_passes: 4, target: 0.0, seed };
        let [all, direct] = [ALL, 0].map(|bounces| {
            let estimate =
                |reference: &biscale::reference::Reference<'_>| reference.estimate(pairs, &settings, |_, _| true);
            Pipeline::new().with_reference(&scene(tile, "standard", bounces), estimate).unwrap()
        });
        for (sums, (all, direct)) in moments.iter_mut().zip(all.iter().zip(&direct)) {
            let value = f64::from(all.f_bar.x - direct.f_bar.x);
            sums[0] += value;
            sums[1] += value * value;
        }
        let n = seed as f64;
        let values: Vec<f64> = moments.iter().map(|[sum, _]| sum / n).collect();
        let variance = |([_, squares], mean): (&[f64; 2], &f64)| (squares / n - mean * mean).max(0.0) / (n - 1.0);
        let noise: f64 = moments.iter().zip(&values).map(variance).sum();
        let std_error = (noise / values.iter().map(|value| value * value).sum::<f64>()).sqrt();
        if seed >= *SEEDS.start() && (std_error <= TARGET || seed >= *SEEDS.end()) {
            return Traced { std_error, values };
        }
    }
}

fn measure(name: String, tile: [&str; 2], color: &'static str, pairs: &[Pair]) -> Row {
    let truth = traced(tile, pairs);
    let norm: f64 = truth.values.iter().map(|value| value * value).sum();
    let value = |outcome: &Outcome, pair: &Pair| f64::from(outcome.brdf.eval(pair.i, pair.o).x);
    let run = |preset: &str, bounces: usize| {
        let [on, off] = [bounces, 0].map(|bounces| Pipeline::new().effective(&scene(tile, preset, bounces)).unwrap());
        let error = |(pair, right): (&Pair, &f64)| (value(&on, pair) - value(&off, pair) - right).powi(2);
        let error: f64 = pairs.iter().zip(&truth.values).map(error).sum();
        let stages = on.times.iter().filter(|(stage, _)| ["transport", "interreflection"].contains(stage));
        let total: f64 = pairs.iter().map(|pair| value(&on, pair).powi(2)).sum();
        let stated = match &on.brdf.representation {
            Representation::Interreflecting(_, bounced) => bounced.rel_error(),
            _ => 0.0,
        };
        ((error / norm).sqrt(), stages.map(|(_, ms)| ms).sum::<f64>(), (norm / total).sqrt(), stated)
    };
    let runs: Vec<_> = PRESETS.iter().map(|preset| run(preset, ALL)).collect();
    let limited = BOUNCES.iter().map(|bounces| run("standard", *bounces));
    Row {
        name,
        color,
        std_error: truth.std_error,
        share: runs[1].2,
        presets: runs.iter().map(|(error, ms, ..)| (*error, *ms)).collect(),
        stated: runs.iter().map(|(.., stated)| *stated).collect(),
        bounces: limited.map(|(error, ms, ..)| (error, ms)).collect(),
    }
}

impl Row {
    fn text(&self) -> String {
        let presets = self.presets.iter().zip(&self.stated);
        let cells =
            presets.map(|((error, ms), stated)| format!("{:.2} ({:.1}) %, {ms:.0} ms", 100.0 * error, 100.0 * stated));
        let limited = self.bounces.iter().map(|(error, _)| format!("{:.1} %", 100.0 * error));
        let cells: Vec<String> = cells.chain(limited).collect();
        let (share, noise) = (100.0 * self.share, 100.0 * self.std_error);
        format!("| {} | {share:.0} % | {} | ± {noise:.2} % |", self.name, cells.join(" | "))
    }
}

/// Errors at `standard` against the largest number of bounces.
fn against_bounces(rows: &[Row]) -> String {
    let points = |row: &Row| -> Vec<(f64, f64)> {
        let limited = BOUNCES.iter().zip(&row.bounces).map(|(count, (error, _))| (*count as f64, 100.0 * error));
        limited.chain([(ALL as f64, 100.0 * row.presets[1].0)]).collect()
    };
    chart(rows, "largest number of bounces", &points)
}

/// Errors of the presets against the milliseconds of interreflection.
fn against_time(rows: &[Row]) -> String {
    chart(rows, "time of interreflection [ms]", &|row| {
        row.presets.iter().map(|(error, ms)| (*ms, 100.0 * error)).collect()
    })
}

fn chart(rows: &[Row], label: &str, points: &dyn Fn(&Row) -> Vec<(f64, f64)>) -> String {
    let is_drawn = |row: &&Row| DRAWN.iter().any(|tile| row.name.starts_with(tile));
    let rows: Vec<&Row> = rows.iter().filter(is_drawn).collect();
    let values = |axis: fn((f64, f64)) -> f64| LogAxis::over(rows.iter().copied().flat_map(points).map(axis));
    let mut chart = Chart::new(values(|point| point.0), label, values(|point| point.1), "relative L2 [%]");
    for row in rows {
        let points = points(row);
        chart.line(&points, row.color, !row.name.starts_with(DRAWN[0]));
        points.iter().for_each(|(x, y)| chart.dot(*x, *y, 3.0, row.color, &row.name));
    }
    chart.file()
}
