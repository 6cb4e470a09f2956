//! `biscale report`: accuracy against time.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::base::{Error, InputError, replace_file};
use crate::effective::EffectiveBrdf;
use crate::reference::ReferenceSettings;
use crate::report::{Machine, Report, SceneReport, Thumbnail, ThumbnailRenderer, difference_png};
use crate::scene;
use crate::scene::LoadedScene;
use crate::tuning::candidates::{Candidate, Family, candidates, with_settings};
use crate::tuning::quality_scale;
use crate::tuning::sweep::{Point, Truth, measure, reference_point};
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use super::ReportArgs;

/// What a run that was broken off has found so far, for the next one to go on from.
#[derive(Debug, Serialize, Deserialize)]
struct Progress {
    machine: Machine,
    scenes: BTreeMap<String, SceneProgress>,
}

#[derive(Debug, Serialize, Deserialize)]
struct SceneProgress {
    /// All but the quality of the scene, and the number of pairs: what the truth and the points belong to.
    key: String,
    truth: Truth,
    points: Vec<Point>,
}

const PROGRESS_FILE: &str = "progress.json";
/// Of a scene's time, what the reference may take.
const REFERENCE_SHARE: f64 = 0.35;

pub fn run(args: &ReportArgs) -> Result<()> {
    let scenes: Vec<LoadedScene> =
        args.scenes.iter().map(|name| scene::open(name, &args.set)).collect::<crate::base::Result<_>>()?;
    std::fs::create_dir_all(&args.output).map_err(|error| {
        Error::from(InputError::new("output", error, "a folder that can be made or written").in_file(&args.output))
    })?;
    let machine = Machine::here();
    let mut progress = resume(&args.output, &machine);
    let mut report = Report { machine, command: command_line(), scenes: Vec::new() };
    for loaded in &scenes {
        report.scenes.push(one_scene(args, loaded, &mut progress)?);
        // A page after each scene: what is broken off is not lost.
        write(&args.output, &report)?;
    }
    if !args.quiet {
        eprintln!("wrote {}", args.output.join("report.html").display());
    }
    Ok(())
}

/// What stands in the folder from a run on the same machine and version.
fn resume(folder: &Path, machine: &Machine) -> Progress {
    let fresh = Progress { machine: machine.clone(), scenes: BTreeMap::new() };
    std::fs::read(folder.join(PROGRESS_FILE))
        .ok()
        .and_then(|bytes| serde_json::from_slice::<Progress>(&bytes).ok())
        .filter(|found| found.machine == *machine)
        .unwrap_or(fresh)
}

fn save(folder: &Path, progress: &Progress) -> Result<()> {
    Ok(replace_file(&folder.join(PROGRESS_FILE), &serde_json::to_vec(progress)?)?)
}

fn write(folder: &Path, report: &Report) -> Result<()> {
    replace_file(&folder.join("report.html"), report.html().as_bytes())?;
    replace_file(&folder.join("report.csv"), report.csv().as_bytes())?;
    replace_file(&folder.join("report.json"), serde_json::to_string_pretty(&report.json())?.as_bytes())?;
    Ok(())
}

fn command_line() -> String {
    std::iter::once("biscale".to_owned()).chain(std::env::args().skip(1)).collect::<Vec<_>>().join(" ")
}

/// What the truth and the points of a scene depend on.
fn key(loaded: &LoadedScene, pairs: usize) -> Result<String> {
    let mut scene = loaded.scene.clone();
    scene.quality = crate::scene::Quality { seed: scene.quality.seed, ..Default::default() };
    Ok(format!("{pairs} {}", serde_json::to_string(&scene)?))
}

fn one_scene(args: &ReportArgs, loaded: &LoadedScene, progress: &mut Progress) -> Result<SceneReport> {
    let bar = bar(args.quiet, &loaded.name);
    let started = Instant::now();
    let budget = Duration::from_secs_f64(args.minutes * 60.0);
    let key = key(loaded, args.pairs)?;
    let known = progress.scenes.remove(&loaded.name).filter(|known| known.key == key);
    let mut state = match known {
        Some(known) => known,
        None => SceneProgress { key, truth: truth(args, loaded, budget, &bar)?, points: Vec::new() },
    };
    let list = in_order(candidates(has_measured(loaded), overhangs(loaded), args.combinations));
    bar.set_length(list.len() as u64);
    let mut left_out = 0;
    for (k, candidate) in list.iter().enumerate() {
        bar.set_position(k as u64);
        if state.points.iter().any(|point| point.settings == candidate.words()) {
            continue;
        }
        if started.elapsed() > budget && candidate.family != Family::Preset {
            left_out += 1;
            continue;
        }
        bar.set_message(candidate.words());
        state.points.push(measure(loaded, candidate, &state.truth)?.0);
        progress.scenes.insert(loaded.name.clone(), state);
        save(&args.output, progress)?;
        state = match progress.scenes.remove(&loaded.name) {
            Some(state) => state,
            None => return Err(Error::failed("a scene's progress was lost").into()),
        };
    }
    bar.set_message("pictures");
    let thumbnails = thumbnails(loaded, &bar)?;
    bar.finish_and_clear();
    let mut points = state.points.clone();
    points.push(reference_point(&loaded.name, &state.truth));
    let truth = &state.truth;
    let scene = SceneReport {
        name: loaded.name.clone(),
        pairs: args.pairs,
        reference_error: truth.own,
        reference_passes: truth.passes,
        reference_seconds: truth.seconds,
        points,
        thumbnails,
        left_out,
    };
    progress.scenes.insert(loaded.name.clone(), state);
    save(&args.output, progress)?;
    Ok(scene)
}

fn truth(args: &ReportArgs, loaded: &LoadedScene, budget: Duration, bar: &ProgressBar) -> Result<Truth> {
    let start = Instant::now();
    let settings = ReferenceSettings { facets: 16_384, max_passes: 64, target: 2e-3, seed: 20_110_807 };
    bar.set_length(100);
    Ok(Truth::new(loaded, args.pairs, &settings, |passes, error| {
        let spent = start.elapsed().as_secs_f64() / (budget.as_secs_f64() * REFERENCE_SHARE);
        bar.set_position((spent * 100.0).min(100.0) as u64);
        bar.set_message(format!("reference, {passes} passes, standard error {:.2} %", error * 100.0));
        passes < 4 || spent < 1.0
    })?)
}

/// Presets first, then knobs and combinations in turn: what time leaves out is a bit of each.
fn in_order(all: Vec<Candidate>) -> Vec<Candidate> {
    let (mut presets, rest): (Vec<_>, Vec<_>) = all.into_iter().partition(|one| one.family == Family::Preset);
    let (knobs, combinations): (Vec<_>, Vec<_>) = rest.into_iter().partition(|one| one.family != Family::Combination);
    let (mut knobs, mut combinations) = (knobs.into_iter(), combinations.into_iter());
    loop {
        let next: Vec<Candidate> = knobs.next().into_iter().chain(combinations.next()).collect();
        if next.is_empty() {
            return presets;
        }
        presets.extend(next);
    }
}

/// Whether one horizon an azimuth does not tell what a facet sees.
fn overhangs(loaded: &LoadedScene) -> bool {
    let settings = with_settings(loaded, &quality_scale::rung(0.0, false));
    settings.and_then(|scene| crate::gpu::pipeline().effective(&scene)).is_ok_and(|outcome| outcome.plan.overhangs())
}

fn has_measured(loaded: &LoadedScene) -> bool {
    let pipeline = crate::gpu::pipeline();
    pipeline.materials(loaded).is_ok_and(|assignment| {
        assignment.materials.iter().any(|material| material.brdf.terms.iter().any(|term| term.measured().is_some()))
    })
}

/// Facets of the finest picture: four times those of `fine`, fewer where each costs a look-up.
const FINEST: [usize; 2] = [65_536, 16_384];

fn thumbnails(loaded: &LoadedScene, bar: &ProgressBar) -> Result<Vec<Thumbnail>> {
    let studio = ThumbnailRenderer::new(loaded)?;
    let image = |preset: &'static str, set: &[String]| -> Result<_> {
        let candidate = Candidate { family: Family::Preset, preset, set: set.to_vec() };
        let brdf: std::sync::Arc<EffectiveBrdf> =
            crate::gpu::pipeline().effective(&with_settings(loaded, &candidate)?)?.brdf;
        Ok(studio.image(&*brdf)?)
    };
    let facets = FINEST[usize::from(has_measured(loaded))];
    bar.set_message("the finest picture");
    let finest = image("fine", &[format!("quality.facets={facets}"), "quality.method=\"direct\"".to_owned()])?;
    let label = format!("direct sum of {facets} facets");
    let mut all =
        vec![Thumbnail { label, image: studio.png(&finest)?, difference: None, mean_delta_e: 0.0, high_delta_e: 0.0 }];
    for preset in ["draft", "standard", "wu2011"] {
        bar.set_message(format!("picture at {preset}"));
        let shown = image(preset, &[])?;
        let mut delta_e = studio.difference(&shown, &finest);
        let difference = Some(difference_png(&delta_e)?);
        delta_e.sort_by(f32::total_cmp);
        let mean_delta_e = delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32;
        let high_delta_e = delta_e.get(delta_e.len() * 95 / 100).copied().unwrap_or(0.0);
        all.push(Thumbnail {
            label: preset.to_owned(),
            image: studio.png(&shown)?,
            difference,
            mean_delta_e,
            high_delta_e,
        });
    }
    Ok(all)
}

/// A bar on a terminal, nothing in a pipe.
fn bar(quiet: bool, scene: &str) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(1);
    if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len} {msg} ({eta} left)") {
        bar.set_style(style);
    }
    bar.set_prefix(scene.to_owned());
    bar
}
