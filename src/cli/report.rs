//! `biscale report` measures accuracy against time.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::base::{Error, InputError, print_on_stderr, regular_file, replace_file};
use crate::cache::KeyBuilder;
use crate::effective::EffectiveBrdf;
use crate::reference::ReferenceSettings;
use crate::render::RenderScene;
use crate::report::{Machine, Report, SceneReport, Thumbnail, ThumbnailRenderer, difference_png};
use crate::scene;
use crate::scene::LoadedScene;
use crate::tuning::candidates::{Candidate, Family, candidates, with_settings};
use crate::tuning::quality_scale;
use crate::tuning::sweep::{ReferenceValues, SweepPoint, reference_point};
use crate::tuning::timed_result::{TimedResult, time};
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use super::{ReportArgs, check_outputs};

/// Results of an interrupted run, from which the next run continues.
#[derive(Debug, Serialize, Deserialize)]
struct SavedProgress {
    machine: Machine,
    scenes: BTreeMap<String, SavedScene>,
}

#[derive(Debug, Serialize, Deserialize)]
struct SavedScene {
    /// The key of everything that the reference and the points depend on, in hexadecimal digits.
    key: String,
    #[serde(rename = "truth")]
    reference: ReferenceValues,
    points: Vec<SweepPoint>,
}

const PROGRESS_FILE: &str = "progress.json";
/// Files that the command writes.
const FILES: [&str; 4] = ["report.html", "report.csv", "report.json", PROGRESS_FILE];
/// Largest part of a scene's time for the reference.
const REFERENCE_SHARE: f64 = 0.35;

pub fn run(args: &ReportArgs) -> Result<()> {
    let mut scenes: Vec<LoadedScene> =
        args.scenes.iter().map(|name| scene::open_argument(name, &args.set)).collect::<crate::base::Result<_>>()?;
    std::fs::create_dir_all(&args.output).map_err(|error| {
        Error::from(InputError::new("output", error, "a folder that can be created and written").in_file(&args.output))
    })?;
    for (name, loaded) in args.scenes.iter().zip(&scenes) {
        check_outputs(name, loaded, &[], FILES.map(|file| args.output.join(file)))?;
        // All files of all scenes are read before the first scene is measured, which takes minutes.
        crate::gpu::pipeline().materials(loaded)?;
        RenderScene::new(loaded)?;
    }
    for loaded in &mut scenes {
        *loaded = crate::gpu::pipeline().with_same_light(loaded)?;
    }
    let machine = Machine::here();
    let mut progress = resume(&args.output, &machine);
    let mut report = Report { machine, command: command_line(), scenes: Vec::new() };
    for loaded in &scenes {
        let known = known_results(&mut progress, loaded, args.pairs)?;
        let first = if known.is_none() { first_points(args, loaded, &mut report)? } else { Vec::new() };
        report.scenes.push(one_scene(args, loaded, (known, first), &mut progress)?);
        // The page is written after each scene, so that an interrupted run leaves a page.
        write(&args.output, &report)?;
    }
    if !args.quiet {
        print_on_stderr(format_args!("wrote {}", args.output.join("report.html").display()));
    }
    Ok(())
}

/// Results in the folder of an earlier run on the same machine with the same version.
fn resume(folder: &Path, machine: &Machine) -> SavedProgress {
    let empty = SavedProgress { machine: machine.clone(), scenes: BTreeMap::new() };
    regular_file::read(&folder.join(PROGRESS_FILE))
        .ok()
        .and_then(|bytes| serde_json::from_slice::<SavedProgress>(&bytes).ok())
        .filter(|found| found.machine == *machine)
        .unwrap_or(empty)
}

fn save(folder: &Path, progress: &SavedProgress) -> Result<()> {
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

/// The key of the reference and of the points of a scene: the scene without its quality, its files, the pairs and the build.
fn key(loaded: &LoadedScene, pairs: usize) -> Result<String> {
    let mut scene = loaded.scene.clone();
    scene.quality = crate::scene::Quality { seed: scene.quality.seed, ..Default::default() };
    let mut key = KeyBuilder::of_stage("report");
    key.counts("pairs", [pairs]).numbers("scene", &serde_json::to_vec(&scene)?);
    let pipeline = crate::gpu::pipeline();
    for file in loaded.files() {
        key.key("file", &pipeline.file_key(&loaded.base_dir, &file));
    }
    Ok(key.finish().name())
}

/// Writes and prints the quality levels by their stated errors, each as soon as it is known. Returns them, so that the
/// reference of the scene can measure them later.
fn first_points(args: &ReportArgs, loaded: &LoadedScene, report: &mut Report) -> Result<Vec<TimedResult>> {
    let mut results = Vec::new();
    report.scenes.push(SceneReport::without_reference(&loaded.name, args.pairs));
    let all = candidates(false, overhangs(loaded), 0);
    for candidate in all.iter().filter(|candidate| candidate.family == Family::QualityScale) {
        let result = time(loaded, candidate)?;
        if let (Some(point), Some(scene)) = (result.stated_point(), report.scenes.last_mut()) {
            if !args.quiet {
                let SweepPoint { scene, ms, psnr_db, rel_l2, settings, .. } = &point;
                let percent = 100.0 * rel_l2;
                print_on_stderr(format_args!(
                    "{scene}: {ms:.1} ms, {psnr_db:.1} dB, {percent:.2} % stated: {settings}"
                ));
            }
            scene.points.push(point);
            write(&args.output, report)?;
        }
        results.push(result);
    }
    report.scenes.pop();
    Ok(results)
}

/// The results of an earlier run for a scene with the same inputs.
fn known_results(progress: &mut SavedProgress, loaded: &LoadedScene, pairs: usize) -> Result<Option<SavedScene>> {
    let key = key(loaded, pairs)?;
    Ok(progress.scenes.remove(&loaded.name).filter(|known| known.key == key))
}

fn one_scene(
    args: &ReportArgs,
    loaded: &LoadedScene,
    (known, first): (Option<SavedScene>, Vec<TimedResult>),
    progress: &mut SavedProgress,
) -> Result<SceneReport> {
    let bar = bar(args.quiet, &loaded.name);
    let started = Instant::now();
    let budget = Duration::from_secs_f64(args.minutes * 60.0);
    let mut state = match known {
        Some(known) => known,
        None => {
            let (key, reference) = (key(loaded, args.pairs)?, reference(args, loaded, budget, &bar)?);
            let points = first.iter().map(|result| result.point(&reference)).collect();
            SavedScene { key, reference, points }
        }
    };
    let list = in_order(candidates(has_measured(loaded), overhangs(loaded), args.combinations));
    bar.set_length(list.len() as u64);
    let mut left_out = 0;
    for (k, candidate) in list.iter().enumerate() {
        bar.set_position(k as u64);
        if state.points.iter().any(|point| point.settings == candidate.cli_args()) {
            continue;
        }
        if started.elapsed() > budget && candidate.family != Family::Preset {
            left_out += 1;
            continue;
        }
        bar.set_message(candidate.cli_args());
        state.points.push(time(loaded, candidate)?.point(&state.reference));
        progress.scenes.insert(loaded.name.clone(), state);
        save(&args.output, progress)?;
        state = match progress.scenes.remove(&loaded.name) {
            Some(state) => state,
            None => return Err(Error::failed("the results of a scene are missing").into()),
        };
    }
    bar.set_message("images");
    let thumbnails = thumbnails(loaded, &bar)?;
    bar.finish_and_clear();
    let mut points = state.points.clone();
    let reference = &state.reference;
    points.push(reference_point(&loaded.name, reference));
    let scene = SceneReport {
        name: loaded.name.clone(),
        pairs: args.pairs,
        reference_error: reference.std_error,
        reference_passes: reference.passes,
        reference_seconds: reference.seconds,
        points,
        thumbnails,
        left_out,
    };
    progress.scenes.insert(loaded.name.clone(), state);
    save(&args.output, progress)?;
    Ok(scene)
}

fn reference(args: &ReportArgs, loaded: &LoadedScene, budget: Duration, bar: &ProgressBar) -> Result<ReferenceValues> {
    let start = Instant::now();
    let settings = ReferenceSettings { facets: 16_384, max_passes: 64, target: 2e-3, seed: 20_110_807 };
    bar.set_length(100);
    Ok(ReferenceValues::new(loaded, args.pairs, &settings, |passes, error| {
        let spent = start.elapsed().as_secs_f64() / (budget.as_secs_f64() * REFERENCE_SHARE);
        bar.set_position((spent * 100.0).min(100.0) as u64);
        bar.set_message(format!("reference, {passes} passes, standard error {:.2} %", error * 100.0));
        passes < 4 || spent < 1.0
    })?)
}

/// Presets first, then single settings and combinations in turns, so that a time limit leaves out some of both.
fn in_order(all: Vec<Candidate>) -> Vec<Candidate> {
    let (mut presets, rest): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|candidate| candidate.family == Family::Preset);
    let (single, combinations): (Vec<_>, Vec<_>) =
        rest.into_iter().partition(|candidate| candidate.family != Family::Combination);
    let (mut single, mut combinations) = (single.into_iter(), combinations.into_iter());
    loop {
        let next: Vec<Candidate> = single.next().into_iter().chain(combinations.next()).collect();
        if next.is_empty() {
            return presets;
        }
        presets.extend(next);
    }
}

/// Returns true if the surface overhangs, so that one horizon per azimuth does not describe its visibility.
fn overhangs(loaded: &LoadedScene) -> bool {
    let settings = with_settings(loaded, &quality_scale::candidate_at(0.0, false));
    settings.and_then(|scene| crate::gpu::pipeline().effective(&scene)).is_ok_and(|outcome| outcome.plan.overhangs())
}

fn has_measured(loaded: &LoadedScene) -> bool {
    let pipeline = crate::gpu::pipeline();
    pipeline.materials(loaded).is_ok_and(|assignment| {
        assignment.materials.iter().any(|material| material.brdf.terms.iter().any(|term| term.measured().is_some()))
    })
}

/// Facets of the finest image: four times those of `fine`, and fewer for measured BRDFs, which read a table per facet.
const FINEST_FACETS: [usize; 2] = [65_536, 16_384];

fn thumbnails(loaded: &LoadedScene, bar: &ProgressBar) -> Result<Vec<Thumbnail>> {
    let renderer = ThumbnailRenderer::new(loaded)?;
    let image = |preset: &'static str, set: &[String]| -> Result<_> {
        let candidate = Candidate { family: Family::Preset, preset, set: set.to_vec() };
        let brdf: std::sync::Arc<EffectiveBrdf> =
            crate::gpu::pipeline().effective(&with_settings(loaded, &candidate)?)?.brdf;
        Ok(renderer.image(&*brdf)?)
    };
    let facets = FINEST_FACETS[usize::from(has_measured(loaded))];
    bar.set_message("the finest image");
    let finest = image("fine", &[format!("quality.facets={facets}"), "quality.method=\"direct\"".to_owned()])?;
    let label = format!("direct sum of {facets} facets");
    let mut all = vec![Thumbnail {
        label,
        image: renderer.png(&finest)?,
        difference: None,
        mean_delta_e: 0.0,
        high_delta_e: 0.0,
    }];
    for preset in ["draft", "standard", "wu2011"] {
        bar.set_message(format!("image at {preset}"));
        let shown = image(preset, &[])?;
        let mut delta_e = renderer.difference(&shown, &finest);
        let difference = Some(difference_png(&delta_e)?);
        delta_e.sort_by(f32::total_cmp);
        let mean_delta_e = delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32;
        let high_delta_e = delta_e.get(delta_e.len() * 95 / 100).copied().unwrap_or(0.0);
        all.push(Thumbnail {
            label: preset.to_owned(),
            image: renderer.png(&shown)?,
            difference,
            mean_delta_e,
            high_delta_e,
        });
    }
    Ok(all)
}

/// A progress bar for one scene. It is drawn on terminals only.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_an_earlier_run_are_used_only_while_the_scene_its_files_and_the_pairs_are_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("scene.toml", "[tile]\ngeometry = { kind = \"mesh\", path = \"tile.obj\" }\n");
        write("tile.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        let loaded = scene::open(&folder.path().join("scene.toml").to_string_lossy(), &[]).unwrap();
        let key_of = |pairs| key(&loaded, pairs).unwrap();
        let first = key_of(200);
        assert_eq!(first, key_of(200));
        assert_ne!(first, key_of(100));
        let mut other = loaded.clone();
        other.scene.quality.preset = "fine".to_owned();
        assert_eq!(first, key(&other, 200).unwrap(), "the quality is no input of the reference");
        other.scene.tile.size = [2.0, 1.0].into();
        assert_ne!(first, key(&other, 200).unwrap());
        write("tile.obj", "v 0 0 0\nv 1 0 0.1\nv 0 1 0\nf 1 2 3\n");
        assert_ne!(first, key_of(200));
    }
}
