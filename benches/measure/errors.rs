//! True and stated errors of hard tiles and of shipped scenes.

use std::path::Path;

use biscale::metrics::{Pair, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::report::svg::{Chart, LogAxis};
use biscale::scene::{self, LoadedScene};

use crate::hard_tiles::{HardTile, Measured, PAIRS_SEED, RayCast, TrueValues, Truth, all, measure};
use crate::reference::reference;

const PRESETS: [&str; 2] = ["draft", "standard"];
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;
/// Direction pairs of a true error. Of 200, a single one at grazing angles may hold most of the squared error.
const PAIRS: usize = 800;
/// Bounds of the standard errors of true values of hard tiles.
const RAYS: RayCast = RayCast { points: 4096, max_passes: 16, target: 4e-3 };
/// The same for shipped scenes.
const REFERENCE: ReferenceSettings = ReferenceSettings { facets: 16_384, max_passes: 8, target: 1e-3, seed: 99 };
/// Errors below this are rounding.
const MIN_ERROR: f64 = 1e-5;
/// The plot of stated against true errors.
const PLOT: &str = "docs/measurements/errors.svg";

/// The errors of one tile: three seeds at each of [`PRESETS`], or at one preset.
struct Row {
    name: String,
    presets: Vec<Vec<Measured>>,
    std_error: f64,
}

/// Prints the errors of all hard tiles and shipped scenes, or of those whose name contains `part`.
///
/// # Errors
/// A temporary folder cannot be created, a scene cannot be opened, or the plot cannot be written.
pub fn errors(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    let is_wanted = |name: &str| part.is_none_or(|part| name.contains(part));
    let mut rows = hard_tiles(&PRESETS, |tile| is_wanted(tile.name), print)?;
    print(format!("\n{}", header("shipped scene", &PRESETS)));
    for name in shipped().into_iter().filter(|name| is_wanted(name)) {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).map_err(|error| error.to_string())?;
        let pairs = mirror_biased_pairs(PAIRS, PAIRS_SEED);
        let truths = true_values(&loaded, &pairs).map_err(|error| error.to_string())?;
        let of = |k: usize| SEEDS.map(|seed| measure(&loaded, PRESETS[k], seed, &pairs, &truths[k])).collect();
        let std_error = truths[1].std_error;
        rows.push(Row { name: name.to_owned(), presets: vec![of(0), of(1)], std_error });
        print(rows[rows.len() - 1].text());
    }
    print(format!("\n{}", calibration(&rows)));
    if part.is_none() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PLOT);
        std::fs::write(&path, plot(&rows)).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

/// Prints the errors of the hard tiles at `fine`, or of those whose name contains `part`. Level tiles are left out: they
/// are exact.
///
/// # Errors
/// A temporary folder cannot be created.
pub fn at_fine(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    let is_level = |tile: &HardTile| matches!(tile.truth, Truth::Level(_));
    let is_wanted = |tile: &HardTile| !is_level(tile) && part.is_none_or(|part| tile.name.contains(part));
    let rows = hard_tiles(&["fine"], is_wanted, print)?;
    print(format!("\n{}", calibration(&rows)));
    Ok(())
}

/// Prints a table of hard tiles and returns its rows.
fn hard_tiles(
    presets: &[&str],
    is_wanted: impl Fn(&HardTile) -> bool,
    print: &mut dyn FnMut(String),
) -> Result<Vec<Row>, String> {
    print(header("tile", presets));
    let mut rows = Vec::new();
    for tile in all().iter().filter(|tile| is_wanted(tile)) {
        let folder = tempfile::tempdir().map_err(|error| format!("temporary folder: {error}"))?;
        let loaded = tile.open(folder.path(), "standard", 1);
        let (pairs, truth) = tile.pairs_and_values(&loaded, PAIRS, &RAYS);
        let of = |preset: &&str| SEEDS.map(|seed| measure(&loaded, preset, seed, &pairs, &truth)).collect();
        let presets = presets.iter().map(of).collect();
        rows.push(Row { name: tile.name.to_owned(), presets, std_error: truth.std_error });
        print(rows[rows.len() - 1].text());
    }
    Ok(rows)
}

fn header(what: &str, presets: &[&str]) -> String {
    let columns: String = presets.iter().map(|preset| format!(" `{preset}`: true | stated | PSNR |")).collect();
    format!("| {what} |{columns} true values |\n|{}", "---|".repeat(2 + 3 * presets.len()))
}

/// The reference with the light that each preset simulates: a coarser one may leave interreflection out.
fn true_values(loaded: &LoadedScene, pairs: &[Pair]) -> biscale::Result<[TrueValues; 2]> {
    let pipeline = Pipeline::new();
    let [draft, standard] = PRESETS.map(|preset| {
        let mut loaded = loaded.clone();
        loaded.scene.quality.preset = preset.to_owned();
        pipeline.with_same_light(&loaded)
    });
    let (draft, standard) = (draft?, standard?);
    let of = |loaded: &LoadedScene| {
        let (values, std_error) = reference(&pipeline, loaded, pairs, &REFERENCE);
        TrueValues { values, std_error }
    };
    let of_standard = of(&standard);
    let is_same = draft.scene.effects.interreflection == standard.scene.effects.interreflection;
    Ok([if is_same { of_standard.clone() } else { of(&draft) }, of_standard])
}

/// The shipped scenes that only reflect. Two scenes of Table 4 and `table3` share tile and materials with others.
fn shipped() -> Vec<&'static str> {
    let others = ["table3", "table4_cup", "fig9b_cylinder_stripes"];
    let all = scene::shipped::names();
    all.filter(|name| !name.starts_with("slab") && !name.ends_with("color_map") && !others.contains(name)).collect()
}

/// The runs whose true error is resolved, with the preset.
fn resolved<'a>(rows: &'a [Row]) -> impl Iterator<Item = (&'a Row, usize, &'a Measured)> {
    let runs = |row: &'a Row| {
        row.presets.iter().enumerate().flat_map(move |(k, runs)| runs.iter().map(move |run| (row, k, run)))
    };
    rows.iter().flat_map(runs).filter(|(.., run)| run.is_resolved && run.errors.rel_l2 > MIN_ERROR)
}

/// A sentence on the ratio of stated and true errors.
fn calibration(rows: &[Row]) -> String {
    let mut ratios: Vec<f64> = resolved(rows).map(|(.., run)| run.stated / run.errors.rel_l2).collect();
    ratios.sort_by(f64::total_cmp);
    let decibels: Vec<f64> = ratios.iter().filter(|ratio| **ratio > 0.0).map(|ratio| 20.0 * ratio.log10()).collect();
    let share = |is_counted: &dyn Fn(f64) -> bool| {
        100.0 * ratios.iter().filter(|ratio| is_counted(**ratio)).count() as f64 / ratios.len().max(1) as f64
    };
    format!(
        "Stated over true error of {} resolved runs: {:.0} % between 0.5 and 2, {:.0} % below 0.5, {:.0} % above 2; smallest {:.2}, median {:.2}, largest {:.1}; RMS without zeros {:.1} dB.",
        ratios.len(),
        share(&|ratio| (0.5..=2.0).contains(&ratio)),
        share(&|ratio| ratio < 0.5),
        share(&|ratio| ratio > 2.0),
        ratios.first().copied().unwrap_or_default(),
        ratios.get(ratios.len() / 2).copied().unwrap_or_default(),
        ratios.last().copied().unwrap_or_default(),
        (decibels.iter().map(|db| db * db).sum::<f64>() / decibels.len().max(1) as f64).sqrt(),
    )
}

/// Stated against true errors, with lines at a half of, equal to, and twice the true error.
fn plot(rows: &[Row]) -> String {
    let percent = |run: &Measured| (100.0 * run.errors.rel_l2, 100.0 * run.stated.max(MIN_ERROR));
    let values = || resolved(rows).flat_map(|(.., run)| <[f64; 2]>::from(percent(run)));
    let axis = LogAxis::over(values());
    let mut chart = Chart::new(axis, "true relative L2 [%]", axis, "stated relative L2 [%]");
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
    for (factor, dashed) in [(0.5_f64, true), (1.0, false), (2.0, true)] {
        chart.line(&[(low / factor.max(1.0), low * factor.min(1.0)), (high, high * factor)], "#8a8a8a", dashed);
    }
    for (row, preset, run) in resolved(rows) {
        let (x, y) = percent(run);
        chart.dot(x, y, 3.0, ["#d97706", "#2563eb"][preset], &format!("{}, {}", row.name, PRESETS[preset]));
    }
    chart.file()
}

impl Row {
    fn text(&self) -> String {
        let all = |runs: &[Measured], value: &dyn Fn(&Measured) -> String| {
            runs.iter().map(value).collect::<Vec<_>>().join(", ")
        };
        let sign = |run: &Measured| if run.is_resolved { "" } else { "≈ " };
        let mut cells = vec![self.name.clone()];
        for runs in &self.presets {
            cells.push(all(runs, &|run| format!("{}{:.2} %", sign(run), 100.0 * run.errors.rel_l2)));
            cells.push(all(runs, &|run| {
                format!("{:.2} %{}", 100.0 * run.stated, if run.warns { " (warned)" } else { "" })
            }));
            cells.push(all(runs, &|run| format!("{:.1} dB", run.errors.psnr_db)));
        }
        let closed = self.std_error == 0.0;
        cells.push(if closed { "closed form".to_owned() } else { format!("± {:.2} %", 100.0 * self.std_error) });
        format!("| {} |", cells.join(" | "))
    }
}
