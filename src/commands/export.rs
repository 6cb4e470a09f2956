//! `biscale export`: the effective BRDF as a table.

use std::path::Path;

use anyhow::Result;
use biscale::export::{self, ExportMeta, ExportReport, ExportResolution};
use biscale::pipeline::Pipeline;
use serde::Serialize;

use super::print_json;
use crate::ExportArgs;

#[derive(Serialize)]
struct Report {
    output: String,
    pairs: usize,
    bytes: u64,
    resampling_rel_l2: f64,
    /// Null where the table reads without error.
    resampling_psnr_db: f64,
    form: String,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    let streams = args.output == Path::new("-");
    if !streams {
        // Before the long work.
        export::check_ending(&args.output)?;
    }
    let loaded = args.scene.open()?;
    let mut pipeline = Pipeline::new();
    let outcome = pipeline.effective(&loaded)?;
    args.scene.notes(&outcome);
    let tile = &loaded.scene.tile;
    let meta = ExportMeta {
        scene: loaded.name.clone(),
        quality: format!("{}; {}", outcome.settings.preset.name(), outcome.brdf.form.describe()),
        seed: outcome.settings.seed,
        tile_size: tile.size.to_array(),
        tile_unit: tile.unit.clone(),
        closes_plane: pipeline.mesh(&loaded)?.closes_plane,
        notes: outcome.notes.clone(),
    };
    let [theta, phi] = args.resolution;
    let resolution = ExportResolution { theta_i: theta, phi_i: phi, theta_o: theta, phi_o: phi };
    let bar = bar(args.scene.quiet);
    let progress = |part: f32| bar.set_position((part * 1000.0) as u64);
    let report = if streams {
        export::write_csv(&outcome.brdf, &meta, &resolution, &mut std::io::stdout().lock(), &progress)
    } else {
        export::write(&outcome.brdf, &meta, &resolution, &args.output, &progress)
    };
    bar.finish_and_clear();
    let ExportReport { pairs, bytes, resampling } = report?;
    // Standard output holds the table itself then.
    if args.scene.json && !streams {
        return print_json(&Report {
            output: args.output.display().to_string(),
            pairs,
            bytes,
            resampling_rel_l2: resampling.rel_l2,
            resampling_psnr_db: resampling.psnr_db,
            form: outcome.brdf.form.describe(),
        });
    }
    if !args.scene.quiet {
        eprintln!(
            "{pairs} pairs, {bytes} bytes; read bilinearly they differ from eval by {:.1} % ({:.1} dB)",
            100.0 * resampling.rel_l2,
            resampling.psnr_db
        );
    }
    Ok(())
}

/// A bar on a terminal, nothing in a pipe.
fn bar(quiet: bool) -> indicatif::ProgressBar {
    if quiet {
        return indicatif::ProgressBar::hidden();
    }
    let bar = indicatif::ProgressBar::new(1000);
    if let Ok(style) = indicatif::ProgressStyle::with_template("tabulating {wide_bar} {percent} %, {eta} left") {
        bar.set_style(style);
    }
    bar
}
