//! Measurements that `docs/measurements` holds: `cargo bench --bench measure -- NAME [ARGUMENT]` prints one and
//! replaces the lines between `<!-- measure: NAME -->` and `<!-- end -->` of a page. Without a name, it lists the
//! names. A page stays as it is if a measurement misses a bound.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing measurement may panic")]

mod accuracy;
mod bounced_share;
mod budgets;
mod capture;
mod capture_sheet;
#[path = "../../tests/numerics/choosing.rs"]
mod choosing;
mod clustered_sums;
mod errors;
mod factored;
#[path = "../../tests/hard_tiles/mod.rs"]
mod hard_tiles;
mod image_points;
mod in_tests;
mod interpolation;
mod interreflection;
mod rays;
#[path = "../../tests/numerics/reference.rs"]
mod reference;
mod shading_tables;
mod slabs;
mod table;
#[path = "../../tests/numerics/tiles.rs"]
mod tiles;

use std::process::ExitCode;

use in_tests::InTests;
use table::Table;

const LIB: &[&str] = &["--lib"];

/// Computes a measurement.
enum Source {
    /// Takes an argument of the command line.
    Here(fn(Option<&str>, &mut Table) -> Result<(), String>),
    /// An ignored test, because the measurement needs private items.
    Test(InTests),
}

const fn in_lib(test: &'static str) -> Source {
    Source::Test(InTests { binary: LIB, test })
}

const MEASUREMENTS: &[(&str, &str, Source)] = &[
    ("accuracy", "errors of the presets (or of a list of presets) on four tiles: half an hour", Source::Here(accuracy)),
    (
        "bounced-share",
        "the share of bounced light that decides, and what interreflection takes: a minute",
        Source::Here(bounced_share),
    ),
    ("budgets", "time that a budget leads to on ten scenes", Source::Here(budgets)),
    ("brdf", "nanoseconds per evaluation of each BRDF", in_lib("nanoseconds_per_evaluation")),
    ("cache-costs", "milliseconds of the disk cache", in_lib("costs_of_caching")),
    ("capture", "errors and times of captured points: half a minute", Source::Here(capture)),
    (
        "capture-sheet",
        "errors, time and memory of captured sheets (or of one, PIXELSxDOTS): minutes",
        Source::Here(capture_sheet),
    ),
    ("choosing", "PSNR that targets in dB reach on ten scenes: minutes", Source::Here(choosing)),
    (
        "color-maps",
        "errors of filtered colour maps against the core on a Gaussian tile",
        in_lib("the_table_of_color_maps_against_the_core"),
    ),
    ("color-map-speed", "milliseconds of the colours of an image of 1920 x 1080 pixels", in_lib("the_table_of_speeds")),
    ("color-zoom", "errors of images under colour maps at every distance: minutes", in_lib("the_table_of_zooms")),
    ("errors", "true and stated errors of the presets on hard tiles: many minutes", Source::Here(errors)),
    ("errors-fine", "true and stated errors of hard tiles at `fine`: many minutes", Source::Here(errors_fine)),
    ("factored", "true and stated errors of low-rank factors that a scene asks for: minutes", Source::Here(factored)),
    ("few-facets", "errors of sums over 700 facets with few distinct normals", Source::Here(few_facets)),
    ("gpu-table", "time of a shading table on the CPU and on the GPU", in_lib("the_table_of_a_height_field_is_timed")),
    ("half-floats", "errors of shading tables in half precision", in_lib("half_floats_would_change_a_table_by_this")),
    (
        "hard-cases",
        "invariants of every hard case with every evaluator: half an hour",
        Source::Test(InTests { binary: &["--test", "hard_cases"], test: "the_table_of_all_cases_and_evaluators" }),
    ),
    ("image-points", "errors and times of images interpolated between points", Source::Here(image_points)),
    ("interpolation", "errors of low-rank factors by interpolation alone", Source::Here(interpolation)),
    (
        "interreflection",
        "error and time of interreflection against path tracing: twenty minutes",
        Source::Here(interreflection),
    ),
    ("latency", "time from an edit in the editor to its images", in_lib("latency_from_a_slider")),
    (
        "latency-stops",
        "time from a dragged stop of a colour map to its images in the editor",
        in_lib("latency_from_a_dragged_stop"),
    ),
    ("lobes", "nanoseconds per facet of each analytic lobe", in_lib("nanoseconds_per_facet")),
    ("map-resolution", "error and time of shadow maps against resolution", in_lib("resolution_against_error")),
    ("map-speed", "speed of shadow maps on the CPU and on the GPU", in_lib("speed_of_the_cpu_and_of_the_gpu")),
    ("rays", "millions of rays per second on five tiles (and writes them to a FOLDER)", Source::Here(rays)),
    (
        "seen-through",
        "errors of images seen through slabs against 4096 paths: a minute",
        in_lib("checkerboards_by_distance_and_times"),
    ),
    (
        "slab-figure-7",
        "a checkerboard behind patterned glass by several models, as images",
        in_lib("figure_7_by_the_slab_by_one_refraction"),
    ),
    ("slabs", "errors of the models of slabs against photons, and their times: minutes", Source::Here(slabs)),
    ("table-grids", "errors of shading tables on grids of different shapes", Source::Here(grids)),
    ("table-steps", "errors of shading tables against facets, azimuths and nodes", Source::Here(steps)),
    ("table-trials", "times of the trial of a shading table and of the whole table", Source::Here(trials)),
];

fn accuracy(presets: Option<&str>, table: &mut Table) -> Result<(), String> {
    accuracy::accuracy(presets, &mut |line| table.line(line))
}

/// Fails if fewer than nine of ten choices reach the target and keep what is said. The argument is a number of scenes;
/// the page holds all.
fn choosing(count: Option<&str>, table: &mut Table) -> Result<(), String> {
    let count = count.map_or(Ok(usize::MAX), str::parse).map_err(|error| format!("number of scenes: {error}"))?;
    let kept = choosing::targets(count, &mut |line| table.line(line));
    let choosing::Kept { target, statement, all, misses } = &kept;
    table.line(String::new());
    table.line(format!("{target} of {all} choices reach the target within 1.5 dB, {statement} keep the statement."));
    if 10 * target.min(statement) >= 9 * all && count == usize::MAX { Ok(()) } else { Err(misses.join("; ")) }
}

/// Fails if fewer than nine of the ten scenes keep the budget.
fn budgets(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    let (hits, misses) = budgets::budgets(&mut |line| table.line(line));
    if hits >= 9 { Ok(()) } else { Err(format!("found {hits} of ten: {misses:?}")) }
}

/// A measurement of many rows, or of those whose name contains `part`, which the page does not hold.
fn whole_or_part(
    part: Option<&str>,
    table: &mut Table,
    measure: impl Fn(Option<&str>, &mut dyn FnMut(String)) -> Result<(), String>,
) -> Result<(), String> {
    match part {
        Some(_) => measure(part, &mut |line| println!("{line}")),
        None => measure(None, &mut |line| table.line(line)),
    }
}

fn errors(part: Option<&str>, table: &mut Table) -> Result<(), String> {
    whole_or_part(part, table, errors::errors)
}

fn errors_fine(part: Option<&str>, table: &mut Table) -> Result<(), String> {
    whole_or_part(part, table, errors::at_fine)
}

fn factored(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    factored::factored(&mut |line| table.line(line))
}

fn few_facets(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    clustered_sums::few_facets(&mut |line| table.line(line))
}

fn interreflection(part: Option<&str>, table: &mut Table) -> Result<(), String> {
    whole_or_part(part, table, interreflection::interreflection)
}

fn bounced_share(part: Option<&str>, table: &mut Table) -> Result<(), String> {
    whole_or_part(part, table, bounced_share::bounced_share)
}

fn interpolation(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    interpolation::interpolation(&mut |line| table.line(line));
    Ok(())
}

/// The page holds the figures of either form.
fn rays(folder: Option<&str>, table: &mut Table) -> Result<(), String> {
    rays::rays(folder, &mut |line| table.line(line))
}

fn capture(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    capture::capture(&mut |line| table.line(line));
    Ok(())
}

fn capture_sheet(sheet: Option<&str>, table: &mut Table) -> Result<(), String> {
    match sheet {
        // The page holds the figures of all sheets.
        Some(_) => capture_sheet::capture_sheet(sheet, &mut |line| println!("{line}")),
        None => capture_sheet::capture_sheet(None, &mut |line| table.line(line)),
    }
}

fn slabs(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    slabs::slabs(&mut |line| table.line(line));
    Ok(())
}

fn image_points(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    image_points::image_points(&mut |line| table.line(line));
    Ok(())
}

fn trials(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    shading_tables::trials(&mut |line| table.line(line));
    Ok(())
}

fn grids(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    shading_tables::grids(&mut |line| table.line(line));
    Ok(())
}

fn steps(_: Option<&str>, table: &mut Table) -> Result<(), String> {
    shading_tables::steps(&mut |line| table.line(line));
    Ok(())
}

fn main() -> ExitCode {
    // Cargo adds `--bench`.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let Some(name) = arguments.first() else {
        for (name, description, _) in MEASUREMENTS {
            println!("{name:<16} {description}");
        }
        return ExitCode::SUCCESS;
    };
    let Some((name, _, source)) = MEASUREMENTS.iter().find(|(other, ..)| other == name) else {
        let names: Vec<&str> = MEASUREMENTS.iter().map(|(name, ..)| *name).collect();
        eprintln!("error: found the measurement `{name}`, expected one of: {}", names.join(", "));
        return ExitCode::from(2);
    };
    let argument = arguments.get(1).map(String::as_str);
    let mut table = Table::default();
    let measured = match source {
        Source::Here(run) => run(argument, &mut table),
        Source::Test(test) => test.run(&mut table),
    };
    match measured.and_then(|()| table.write(name)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
