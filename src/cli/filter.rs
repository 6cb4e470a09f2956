//! `biscale filter` evaluates filtered colour maps at queries, writes their prefiltered table, and compares them with the
//! naive map and the reference.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use serde::Serialize;

use super::filter_image::{Comparison, side_by_side};
use super::filter_queries::{Queries, evaluate};
use super::watch::Watch;
use super::{FilterArgs, FilterMethod, cache, check_outputs, print_json};
use crate::base::{Error, InputError, print_on_stderr, require_finite};
use crate::export::color_table;

/// JSON that `--json` prints.
#[derive(Serialize)]
struct Report {
    #[serde(skip_serializing_if = "Option::is_none")]
    output: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    queries: Option<usize>,
    method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    table: Option<color_table::TableError>,
    #[serde(skip_serializing_if = "Option::is_none")]
    side_by_side: Option<Vec<Comparison>>,
}

pub fn run(args: &FilterArgs) -> Result<()> {
    args.output.iter().try_for_each(|output| args.scene.check_json(output))?;
    if let Some(table) = &args.table {
        color_table::check(table)?;
    }
    if let Some(image) = args.side_by_side.as_ref().filter(|path| path.extension().is_none_or(|e| e != "png")) {
        return Err(Error::from(InputError::new("--side-by-side", image.display(), "a file that ends in .png")).into());
    }
    let outputs: Vec<&PathBuf> = [&args.output, &args.table, &args.side_by_side].into_iter().flatten().collect();
    let inputs: Vec<&Path> = args.queries.iter().map(PathBuf::as_path).collect();
    let (loaded, queries) = args.scene.open(|loaded| {
        inputs.iter().try_for_each(|path| args.scene.check_input("--queries", path))?;
        check_outputs(&args.scene.scene, loaded, &inputs, &outputs)?;
        Ok(args.queries.as_deref().map(Queries::read).transpose()?)
    })?;
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let filter = pipeline.color_filter(&loaded)?;
    drop(watch);
    args.scene.notes(&filter.outcome);
    if !args.scene.quiet {
        filter.warnings().iter().for_each(|warning| print_on_stderr(format_args!("warning: {warning}")));
    }
    let layer = args.layer.as_deref();
    let mut report = Report { output: None, queries: None, method: name(args.method), table: None, side_by_side: None };
    if let (Some(queries), Some(output)) = (&queries, &args.output) {
        let rows = evaluate(queries, args.method, layer, &filter, &pipeline, &loaded)?;
        rows.rows.iter().try_for_each(|row| require_finite(&row[..]))?;
        let text = queries.table(&rows);
        if output == Path::new("-") {
            std::io::stdout().lock().write_all(text.as_bytes())?;
        } else {
            crate::base::replace_file(output, text.as_bytes())?;
        }
        report.output = Some(output.display().to_string());
        report.queries = Some(rows.rows.len());
    }
    if let Some(path) = &args.table {
        let index = filter.layer(layer, "any driver", |_| true)?;
        report.table = Some(color_table::write(path, filter.table(index), &filter.map.layers[index].mapped.stops)?);
    }
    if let Some(path) = &args.side_by_side {
        report.side_by_side = Some(side_by_side(path, &filter, &pipeline, &loaded, layer)?);
    }
    cache::finish(&cache, args.scene.quiet);
    if args.scene.json {
        return print_json(&report);
    }
    if !args.scene.quiet {
        for part in report.side_by_side.iter().flatten() {
            let [r, g, b] = part.mean;
            print_on_stderr(format_args!(
                "{:<8} rms {:.4}, mean {r:.4} {g:.4} {b:.4}, {:.1} ms",
                part.method, part.rms, part.ms
            ));
        }
    }
    Ok(())
}

fn name(method: FilterMethod) -> &'static str {
    match method {
        FilterMethod::Filtered => "filtered",
        FilterMethod::Naive => "naive",
        FilterMethod::Truth => "truth",
    }
}
