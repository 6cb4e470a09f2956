//! `biscale export` writes the effective BRDF as a table.

use std::path::Path;

use crate::base::{InputError, print_on_stderr};
use crate::diagnostics::Health;
use crate::effective::{ErrorEstimate, ErrorEstimator};
use crate::export;
use crate::export::slab::SlabFormat;
use crate::export::{ExportMeta, ExportOptions, ExportReport, ExportResolution, RadianceBasis};
use crate::pipeline::{Outcome, SlabOutcome};
use crate::scene::LoadedScene;
use crate::slab::DiscLobe;
use anyhow::Result;
use serde::Serialize;

use super::watch::Watch;
use super::{ExportArgs, RadianceArg};
use super::{cache, check_outputs, print_json, progress_bar, progress_on};

/// Relative L2 of a table that is read back, above which its lobes are mostly wrong.
const MAX_RESAMPLING_ERROR: f64 = 0.5;

/// A written table as `--json` prints it.
#[derive(Serialize)]
pub struct Report {
    output: String,
    /// The text file beside the table.
    note: Option<String>,
    pairs: usize,
    bytes: u64,
    /// Mean of `|read - eval|` over the mean of `eval`.
    resampling_mean: f64,
    resampling_rel_l2: f64,
    /// Null if the table is read without error.
    resampling_psnr_db: f64,
    /// Relative L2 between the azimuths that an isotropic format averages.
    anisotropy_lost: Option<f64>,
    #[serde(rename = "form")]
    representation: String,
    /// Directional-hemispherical reflectances: theta and phi in degrees, then R, G, B.
    reflectance: Vec<[f32; 5]>,
    /// Stated error of the effective BRDF.
    error: Option<ErrorEstimate>,
    health: Health,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    args.scene.check_json(&args.output)?;
    let to_stdout = args.output == Path::new("-");
    let outputs = if to_stdout { Vec::new() } else { export::outputs(&args.output)? };
    let options = options(args)?;
    let (loaded, ()) = args.scene.open(|loaded| {
        if loaded.scene.slab.is_some() {
            check_slab(args, loaded)?;
        }
        check_outputs(&args.scene.scene, loaded, &[], &outputs)
    })?;
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    if loaded.scene.slab.is_some() {
        let outcome = pipeline.slab(&loaded)?;
        drop(watch);
        return of_slab(args, &loaded, &outcome, &options);
    }
    let outcome = pipeline.effective(&loaded)?;
    drop(watch);
    args.scene.notes(&outcome);
    let meta = ExportMeta::of(&loaded, &outcome, pipeline.mesh(&loaded)?.closes_plane);
    let bar = progress_bar("tabulating", args.scene.quiet);
    let progress = progress_on(&bar);
    if to_stdout {
        // Standard output holds the table, so nothing else is printed there.
        export::write_csv(&outcome.brdf, &meta, &options, &mut std::io::stdout().lock(), &progress)?;
        bar.finish_and_clear();
        cache::finish(&cache, args.scene.quiet);
        return Ok(());
    }
    let report = export::write(&outcome.brdf, &meta, &options, &args.output, &progress);
    bar.finish_and_clear();
    let report = report?;
    cache::finish(&cache, args.scene.quiet);
    print_report(args, &outcome, &report)
}

/// The options of the table, checked. A resolution is refused for the formats whose directions are fixed.
fn options(args: &ExportArgs) -> Result<ExportOptions> {
    if (args.resolution.is_some() || args.resolution_o.is_some()) && has_fixed_grid(args) {
        let expected =
            "a format whose directions are free: .npz, .csv, .exr, .bsdf, .astm, or .xml with --radiance tensor-tree";
        let found = format!("the output {}", args.output.display());
        let option = if args.resolution.is_some() { "--resolution" } else { "--resolution-o" };
        return Err(crate::Error::from(InputError::new(option, found, expected)).into());
    }
    let options = ExportOptions {
        resolution: resolution(args),
        radiance: match args.radiance {
            RadianceArg::Klems => RadianceBasis::Klems,
            RadianceArg::TensorTree => RadianceBasis::TensorTree,
        },
    };
    if let Some(resolution) = &options.resolution {
        resolution.check()?;
    }
    Ok(options)
}

/// Returns true for a format whose directions are fixed.
fn has_fixed_grid(args: &ExportArgs) -> bool {
    let ending = args.output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "binary" | "bin" => true,
        "xml" => matches!(args.radiance, RadianceArg::Klems),
        _ => false,
    }
}

/// Checks that the format suits a slab.
fn check_slab(args: &ExportArgs, loaded: &LoadedScene) -> Result<(), crate::Error> {
    if SlabFormat::of(&args.output)? == SlabFormat::Mitsuba {
        export::mitsuba::check(loaded)?;
    }
    Ok(())
}

impl Report {
    /// The report on a table of `outcome` at `output`.
    pub fn new(output: &Path, outcome: &Outcome, written: &ExportReport) -> Self {
        let reading = &written.reading;
        let mut health = outcome.health().clone();
        health.warnings.extend(warning(written).map(str::to_owned));
        Self {
            output: output.display().to_string(),
            note: written.note.as_ref().map(|note| note.display().to_string()),
            pairs: written.pairs,
            bytes: written.bytes,
            resampling_mean: reading.mean,
            resampling_rel_l2: reading.errors.rel_l2,
            resampling_psnr_db: reading.errors.psnr_db,
            anisotropy_lost: written.anisotropy_lost,
            representation: outcome.brdf.representation.describe(),
            error: outcome.errors().map(ErrorEstimator::estimate),
            health,
            reflectance: written.reflectances.rows(),
        }
    }
}

/// The warning on a table that is read with a large error.
fn warning(written: &ExportReport) -> Option<&'static str> {
    (!(0.0..=MAX_RESAMPLING_ERROR).contains(&written.reading.errors.rel_l2)).then_some(
        "the table misses most of the highlights: choose .bsdf, which adapts to lobes, raise --resolution if the format has it \
         (64x64 for a tensor tree), or raise the roughness",
    )
}

/// Prints size, errors and reflectances of a table, as JSON or in words on standard error.
fn print_report(args: &ExportArgs, outcome: &Outcome, written: &ExportReport) -> Result<()> {
    if let (Some(warning), false) = (warning(written), args.scene.quiet) {
        print_on_stderr(format_args!("warning: {warning}"));
    }
    if args.scene.json {
        return print_json(&Report::new(&args.output, outcome, written));
    }
    if !args.scene.quiet {
        describe(written);
    }
    Ok(())
}

/// Describes a table on standard error.
fn describe(report: &ExportReport) {
    print_on_stderr(format_args!(
        "{} pairs, {} bytes; the table differs from eval by {:.1} % in the mean and {:.1} % ({:.1} dB) in relative L2",
        report.pairs,
        report.bytes,
        100.0 * report.reading.mean,
        100.0 * report.reading.errors.rel_l2,
        report.reading.errors.psnr_db
    ));
    if let Some(lost) = report.anisotropy_lost {
        print_on_stderr(format_args!(
            "the format is isotropic: differences of {:.1} % (relative L2) between azimuths of the tile are lost",
            100.0 * lost
        ));
    }
    print_on_stderr("directional-hemispherical reflectance (R G B):");
    report.reflectances.lines().iter().for_each(|line| print_on_stderr(format_args!("  {line}")));
    if let Some(note) = &report.note {
        print_on_stderr(format_args!("{} describes the conventions and the scene", note.display()));
    }
}

/// Writes a slab.
fn of_slab(args: &ExportArgs, loaded: &LoadedScene, outcome: &SlabOutcome, options: &ExportOptions) -> Result<()> {
    args.scene.warn(&outcome.health);
    let bar = progress_bar("tabulating", args.scene.quiet);
    let format = SlabFormat::of(&args.output)?;
    let written = format.write(&outcome.slab, loaded, options, &args.output, &progress_on(&bar));
    bar.finish_and_clear();
    let written = written?;
    let normal = glam::DVec3::Z;
    let [straight, mirrored] = outcome.slab.straight(normal);
    let transmitted = DiscLobe::transmitted(&outcome.slab, normal, SIDE).total() + straight;
    let reflected = DiscLobe::reflected(&outcome.slab, normal, SIDE).total() + mirrored;
    let note = written.note.as_ref().map(|note| note.display().to_string());
    if args.scene.json {
        return print_json(&serde_json::json!({
            "output": args.output.display().to_string(),
            "note": note,
            "pairs": written.pairs,
            "transmitted": transmitted.to_array(),
            "reflected": reflected.to_array(),
            "form": outcome.describe(),
            "health": outcome.health,
        }));
    }
    if !args.scene.quiet {
        print_on_stderr(format_args!(
            "{} pairs; light along the normal: {:.4} transmitted, {:.4} reflected (means of the channels)",
            written.pairs,
            transmitted.element_sum() / 3.0,
            reflected.element_sum() / 3.0
        ));
        if let Some(note) = note {
            print_on_stderr(format_args!("{note} describes the conventions and the scene"));
        }
    }
    Ok(())
}

/// Cells per side of the disc over which the light along the normal is summed.
const SIDE: usize = 96;

/// The requested resolution: `--resolution` for both directions, `--resolution-o` for the second one alone.
fn resolution(args: &ExportArgs) -> Option<ExportResolution> {
    let [theta, phi] = args.resolution.or(args.resolution_o)?;
    let [theta_o, phi_o] = args.resolution_o.unwrap_or([theta, phi]);
    Some(ExportResolution { theta_i: theta, phi_i: phi, theta_o, phi_o })
}
