//! `biscale eval` evaluates f̄ at the direction pairs of a file.

use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use crate::base::csv::CsvFile;
use crate::base::{Error, InputError, print_on_stderr, require_finite};
use crate::diagnostics::Health;
use crate::effective::{ErrorEstimate, ErrorEstimator};
use crate::math::directions::direction_of_angles;
use crate::metrics::Pair;
use crate::pipeline::Pipeline;
use crate::plan::{Preset, Settings};
use crate::scene::LoadedScene;
use anyhow::Result;
use glam::{DVec3, Vec3};
use serde::Serialize;

use super::EvalArgs;
use super::watch::Watch;
use super::{cache, check_outputs, print_json};

const HEADER: &str = "theta_i,phi_i,theta_o,phi_o";
/// The range of polar angles in files, for messages.
pub(super) const POLAR_ANGLE: &str = "a polar angle in radians, from -π to π";

/// Angles of one line of the file [rad].
struct Row {
    angles: [f64; 4],
}

pub fn run(args: &EvalArgs) -> Result<()> {
    args.scene.check_json(&args.output)?;
    check_ending(&args.output)?;
    let (loaded, rows) = args.scene.open(|loaded| {
        args.scene.check_input("--pairs", &args.pairs)?;
        check_outputs(&args.scene.scene, loaded, &[&args.pairs], [&args.output])?;
        Ok(read(&args.pairs)?)
    })?;
    let settings = Settings::from_quality(&loaded.scene.quality);
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let evaluation = if loaded.scene.slab.is_some() {
        of_slab(args, &mut pipeline, &loaded, &rows)?
    } else if settings.preset == Preset::Reference {
        of_reference(args, &pipeline, &loaded, &settings, &rows)?
    } else {
        of_outcome(args, &mut pipeline, &loaded, &rows)?
    };
    cache::finish(&cache, args.scene.quiet);
    let Evaluation { values, errors, representation, error, health } = evaluation;
    require_finite(&values)?;
    if !args.scene.quiet {
        notes(&loaded, &rows, &values).iter().for_each(|note| print_on_stderr(format_args!("note: {note}")));
    }
    if args.standard_error {
        require_finite(&errors)?;
    }
    let text = table(&rows, &values, args.standard_error.then_some(&errors));
    if args.output == Path::new("-") {
        std::io::stdout().lock().write_all(text.as_bytes())?;
        return Ok(());
    }
    crate::base::replace_file(&args.output, text.as_bytes())?;
    if args.scene.json {
        let output = args.output.display().to_string();
        return print_json(&Report { output, pairs: values.len(), representation, error, health });
    }
    Ok(())
}

/// Checks that the output has no ending of a table that `export` writes.
fn check_ending(output: &Path) -> Result<(), Error> {
    let is_csv = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    if is_csv || crate::export::check_ending(output).is_err() {
        return Ok(());
    }
    let expected = "a name that ends in .csv: `biscale export` writes the other tables";
    Err(InputError::new("output", output.display(), expected).into())
}

/// Notes about pairs whose values are 0 for a reason that the values do not show.
fn notes(loaded: &LoadedScene, rows: &[Row], values: &[Vec3]) -> Vec<String> {
    let is_below = |row: &&Row| row.angles[0].abs().max(row.angles[2].abs()) >= std::f64::consts::FRAC_PI_2;
    let below = rows.iter().filter(is_below).count();
    if loaded.scene.slab.is_some() {
        let text = "light that keeps its direction or is mirrored by level facets is not in these values: see `biscale transmit`";
        return if !values.is_empty() && values.iter().all(|value| *value == Vec3::ZERO) {
            vec![text.to_owned()]
        } else {
            Vec::new()
        };
    }
    let text =
        || format!("{below} of {} pairs have a direction at or below the horizon, where the value is 0", rows.len());
    if below > 0 { vec![text()] } else { Vec::new() }
}

/// Values of f̄ at the pairs, and a description of the result that they come from.
struct Evaluation {
    values: Vec<Vec3>,
    /// Standard errors; empty if they were not computed.
    errors: Vec<Vec3>,
    representation: String,
    error: Option<ErrorEstimate>,
    health: Health,
}

fn of_slab(args: &EvalArgs, pipeline: &mut Pipeline, loaded: &LoadedScene, rows: &[Row]) -> Result<Evaluation> {
    let directions: Vec<(DVec3, DVec3)> = rows.iter().map(Row::directions).collect();
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let slab = pipeline.slab_values(loaded, &directions)?;
    drop(watch);
    args.scene.warn(&slab.health);
    let (values, errors, representation, health) = (slab.values, slab.errors, slab.representation, slab.health);
    Ok(Evaluation { values, errors, representation, error: None, health })
}

fn of_reference(
    args: &EvalArgs,
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    settings: &Settings,
    rows: &[Row],
) -> Result<Evaluation> {
    let pairs: Vec<Pair> = rows.iter().map(Row::pair).collect();
    let bar = progress(settings.reference_passes, args.scene.quiet);
    let mut reached = (0, 0.0);
    let estimates = pipeline.reference(loaded, &pairs, None, |passes, error| {
        reached = (passes, error);
        bar.set_position(passes as u64);
        bar.set_message(format!("standard error {:.2} %", error * 100.0));
        true
    })?;
    bar.finish_and_clear();
    let mut health = pipeline.input_health(loaded)?;
    health.warnings.extend(missed_target(settings, reached));
    args.scene.warn(&health);
    let (values, errors) = estimates.iter().map(|estimate| (estimate.f_bar, estimate.standard_error)).unzip();
    Ok(Evaluation { values, errors, representation: "reference sum".to_owned(), error: None, health })
}

/// A warning if the reference ended at its largest number of passes, with a larger error than its target.
fn missed_target(settings: &Settings, (passes, error): (usize, f64)) -> Option<String> {
    let Settings { reference_target: target, reference_facets: facets, .. } = *settings;
    (error > target).then(|| {
        let samples = (passes * facets) as f64 * (error / target).powi(2);
        format!(
            "the reference has a standard error of {:.2} % after {passes} passes, more than its target of {:.2} %: it needs \
             about {samples:.0} reference_samples",
            error * 100.0,
            target * 100.0
        )
    })
}

fn of_outcome(args: &EvalArgs, pipeline: &mut Pipeline, loaded: &LoadedScene, rows: &[Row]) -> Result<Evaluation> {
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let outcome = pipeline.effective(loaded)?;
    args.scene.notes(&outcome);
    let pairs: Vec<Pair> = rows.iter().map(Row::pair).collect();
    let values = outcome.brdf.eval_pairs(&pairs, &watch.cancel())?;
    let estimator = if args.standard_error || args.scene.json { outcome.errors_unless(&watch.cancel())? } else { None };
    let errors = match estimator.filter(|_| args.standard_error) {
        Some(estimator) => estimator.standard_errors(&pairs, &watch.cancel())?,
        None => Vec::new(),
    };
    drop(watch);
    Ok(Evaluation {
        values,
        errors,
        representation: outcome.brdf.representation.describe(),
        error: estimator.map(ErrorEstimator::estimate),
        health: outcome.health().clone(),
    })
}

/// The values as CSV, with standard errors if they are wanted; unknown ones are empty cells.
fn table(rows: &[Row], values: &[Vec3], errors: Option<&Vec<Vec3>>) -> String {
    let mut text = format!("{HEADER},r,g,b{}\n", if errors.is_some() { ",se_r,se_g,se_b" } else { "" });
    for (k, (row, value)) in rows.iter().zip(values).enumerate() {
        let [a, b, c, d] = row.angles;
        let _ = write!(text, "{a},{b},{c},{d},{},{},{}", value.x, value.y, value.z);
        if let Some(errors) = errors {
            let error = errors.get(k).copied().unwrap_or(Vec3::NAN);
            let cell = |error: f32| if error.is_nan() { String::new() } else { error.to_string() };
            let _ = write!(text, ",{},{},{}", cell(error.x), cell(error.y), cell(error.z));
        }
        text.push('\n');
    }
    text
}

/// JSON that `--json` prints if the values go to a file.
#[derive(Serialize)]
struct Report {
    output: String,
    pairs: usize,
    #[serde(rename = "form")]
    representation: String,
    /// Stated error; absent for a reference, and for the paper's method.
    error: Option<ErrorEstimate>,
    health: Health,
}

/// A progress bar over reference passes. It is drawn on terminals only.
fn progress(passes: usize, quiet: bool) -> indicatif::ProgressBar {
    if quiet {
        return indicatif::ProgressBar::hidden();
    }
    let bar = indicatif::ProgressBar::new(passes as u64);
    if let Ok(style) =
        indicatif::ProgressStyle::with_template("reference {wide_bar} {pos}/{len} passes, {msg}, {eta} left")
    {
        bar.set_style(style);
    }
    bar
}

impl Row {
    /// Directions towards the light and the viewer.
    fn directions(&self) -> (DVec3, DVec3) {
        let [theta_i, phi_i, theta_o, phi_o] = self.angles;
        (direction_of_angles(theta_i, phi_i), direction_of_angles(theta_o, phi_o))
    }

    /// As [`Row::directions`]. Directions at and below the horizon have no light.
    fn pair(&self) -> Pair {
        let (i, o) = self.directions();
        // The cosine of an angle beyond a turn may be positive.
        let bounded = |direction: DVec3, theta: f64| {
            let direction = direction.as_vec3();
            let is_above = theta.abs() < std::f64::consts::FRAC_PI_2;
            if is_above { direction } else { direction.with_z(direction.z.min(0.0)) }
        };
        Pair { i: bounded(i, self.angles[0]), o: bounded(o, self.angles[2]) }
    }
}

/// Returns true for polar angles in radians. Larger ones are likely in degrees.
pub(super) fn is_polar_angle(angle: f64) -> bool {
    angle.abs() <= std::f64::consts::PI + 1e-6
}

fn read(path: &Path) -> Result<Vec<Row>, Error> {
    let file = CsvFile::read(path, HEADER)?;
    let mut columns = [0; 4];
    for (column, wanted) in columns.iter_mut().zip(HEADER.split(',')) {
        let place = file.names().iter().position(|name| name == wanted);
        *column = place.ok_or_else(|| file.header_error(HEADER))?;
    }
    file.rows()
        .map(|row| {
            if row.len() != file.names().len() {
                return Err(row.length_error().into());
            }
            let mut angles = [0.0; 4];
            for (at, (angle, &column)) in angles.iter_mut().zip(&columns).enumerate() {
                *angle = if at % 2 == 0 {
                    row.number(column, POLAR_ANGLE, is_polar_angle)?
                } else {
                    row.number(column, "an angle in radians", |_| true)?
                };
            }
            Ok(Row { angles })
        })
        .collect()
}
