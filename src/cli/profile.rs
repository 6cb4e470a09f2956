//! `biscale profile` measures the milliseconds from an edit to the effective BRDF or to the image.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::Instant;

use crate::base::{Cancel, Error, InputError};
use crate::pipeline::{Outcome, Pipeline, ShadingBrdf, StageTimes};
use crate::render::RenderScene;
use crate::scene::LoadedScene;
use anyhow::Result;
use serde::Serialize;

use super::render_path::RenderPath;
use super::to_image::ToImage;
use super::{EditArg, ProfileArgs};
use super::{print_json, profile_slab};

#[derive(Serialize)]
struct Report {
    stages: BTreeMap<&'static str, f64>,
    total_ms: f64,
    /// Path of the edited parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    edited: Option<String>,
    runs: u32,
    #[serde(rename = "form")]
    representation: String,
}

pub fn run(args: &ProfileArgs) -> Result<()> {
    let (loaded, ()) = args.scene.open(|loaded| {
        if args.image || args.edit == Some(EditArg::Camera) {
            // A missing object or environment is reported before the tile is computed.
            RenderScene::new(loaded)?;
        }
        Ok(())
    })?;
    let measured =
        if loaded.scene.slab.is_some() { profile_slab::measure(args, &loaded)? } else { measure(args, &loaded)? };
    let report = report_of(args, measured);
    if args.scene.json { print_json(&report) } else { print(&report) }
}

/// Timed runs.
pub(super) struct TimedRuns {
    /// Milliseconds of each run, and of the stages that ran in it.
    pub runs: Vec<(f64, StageTimes)>,
    /// Path of the edited parameter.
    pub parameter: Option<String>,
    pub representation: String,
}

fn measure(args: &ProfileArgs, loaded: &LoadedScene) -> Result<TimedRuns> {
    let mut edited = loaded.clone();
    let parameter = match args.edit {
        Some(EditArg::Geometry) => Some(edited.scene.nudge_geometry().ok_or_else(|| no_parameter("tile.geometry"))?),
        Some(EditArg::Brdf) => Some(edited.scene.nudge_brdf().ok_or_else(|| no_parameter("material"))?),
        Some(EditArg::Color) => Some(edited.scene.nudge_color().ok_or_else(|| no_parameter("material"))?),
        Some(EditArg::Face | EditArg::Eta | EditArg::Thickness) => return Err(no_parameter("slab").into()),
        Some(EditArg::Camera) | None => None,
    };
    let mut pipeline = crate::gpu::pipeline();
    let mut outcome = pipeline.effective(loaded)?;
    args.scene.notes(&outcome);
    let mut to_image = if args.image { Some(ToImage::new(loaded, &outcome, args.size)?) } else { None };
    let mut representation = outcome.brdf.representation.describe();
    let mut camera = match args.edit {
        Some(EditArg::Camera) => Some(CameraEdit::new(&pipeline, loaded, &outcome)?),
        _ => None,
    };
    if let Some(camera) = &camera {
        representation = camera.shading_brdf.brdf.representation.describe();
    }
    let mut runs: Vec<(f64, StageTimes)> = Vec::new();
    for run in 0..=args.repeat {
        let start = Instant::now();
        let times = match (&mut camera, args.edit) {
            (None, Some(_)) if to_image.is_some() => {
                let Some(to_image) = &mut to_image else { continue };
                let times = to_image.run(&mut pipeline, if run % 2 == 0 { &edited } else { loaded })?;
                representation.clone_from(&to_image.representation);
                times
            }
            (Some(camera), _) => camera.run(args.size)?,
            (None, Some(_)) => {
                // Runs alternate between the two scenes, so that each run is an edit.
                outcome = pipeline.effective(if run % 2 == 0 { &edited } else { loaded })?;
                outcome.times.clone()
            }
            (None, None) => {
                outcome = crate::gpu::pipeline().effective(loaded)?;
                outcome.times.clone()
            }
        };
        let total = start.elapsed().as_secs_f64() * 1e3;
        // The first run is a warm-up.
        if run > 0 {
            runs.push((total, times));
        }
    }
    Ok(TimedRuns { runs, parameter, representation })
}

/// The medians of timed runs.
fn report_of(args: &ProfileArgs, measured: TimedRuns) -> Report {
    let TimedRuns { runs, parameter, representation } = measured;
    Report {
        stages: medians(&runs),
        total_ms: median(runs.iter().map(|run| run.0).collect()),
        edited: parameter,
        runs: args.repeat,
        representation,
    }
}

/// A move of the camera, which changes neither the shading BRDF nor the shadows of the object.
struct CameraEdit {
    render_scene: RenderScene,
    path: RenderPath,
    shading_brdf: ShadingBrdf,
}

impl CameraEdit {
    fn new(pipeline: &Pipeline, loaded: &LoadedScene, outcome: &Outcome) -> Result<Self> {
        let mut render_scene = RenderScene::with(pipeline, loaded)?;
        let path = RenderPath::of(&render_scene, outcome)?;
        render_scene.cache_shadows(pipeline)?;
        let shading_brdf = path.shading_brdf(outcome, &Cancel::default())?;
        Ok(Self { render_scene, path, shading_brdf })
    }

    /// Turns the camera, renders the image and returns the milliseconds of its stages.
    fn run(&mut self, size: [usize; 2]) -> Result<StageTimes> {
        self.render_scene.camera.azimuth_deg += 2.0;
        let times = self.path.show(&self.render_scene, &self.shading_brdf.brdf, size)?;
        Ok(vec![("g_buffer", times.gbuffer_ms), ("shadows", times.shadows_ms), ("shading", times.shading_ms)])
    }
}

fn print(report: &Report) -> Result<()> {
    let mut out = std::io::stdout().lock();
    if let Some(edited) = &report.edited {
        writeln!(out, "edited {edited}")?;
    }
    for (name, ms) in &report.stages {
        writeln!(out, "{name:<12} {ms:>10.2} ms")?;
    }
    writeln!(
        out,
        "{:<12} {:>10.2} ms   (median of {} runs; {})",
        "total", report.total_ms, report.runs, report.representation
    )?;
    Ok(())
}

/// The median milliseconds of each stage over the runs in which it ran.
fn medians(runs: &[(f64, StageTimes)]) -> BTreeMap<&'static str, f64> {
    let mut stages: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for (name, ms) in runs.iter().flat_map(|(_, times)| times) {
        stages.entry(name).or_default().push(*ms);
    }
    stages.into_iter().map(|(name, ms)| (name, median(ms))).collect()
}

pub(super) fn no_parameter(place: &str) -> Error {
    InputError::new(place, "no numeric parameter", "a parameter that can be changed by 5 %").into()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => 0.0,
        _ if n % 2 == 1 => values[n / 2],
        _ => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}
