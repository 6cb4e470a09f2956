//! Times of the stages of a slab after an edit, for `biscale profile`.

use std::time::Instant;

use anyhow::Result;

use super::profile::{TimedRuns, no_parameter};
use super::{EditArg, ProfileArgs};
use crate::base::{Cancel, Error, InputError};
use crate::pipeline::{Pipeline, StageTimes};
use crate::render::seen_through::SlabScene;
use crate::render::{RenderScene, Rendered};
use crate::scene::{LoadedScene, SlabFace};

/// Times runs from the edit to the slab, or to its image.
///
/// # Errors
/// The scene has no such parameter, or as [`Pipeline::slab`] and [`SlabScene::with`].
pub(super) fn measure(args: &ProfileArgs, loaded: &LoadedScene) -> Result<TimedRuns> {
    let mut edited = loaded.clone();
    let parameter = edit(args.edit, &mut edited)?;
    let mut pipeline = Pipeline::new();
    let outcome = pipeline.slab(loaded)?;
    let mut representation = outcome.describe();
    let shows = args.image || args.edit == Some(EditArg::Camera);
    let view = if shows {
        let render_scene = RenderScene::with(&pipeline, loaded)?;
        let scene = SlabScene::with(&pipeline, loaded, &outcome, &render_scene)?;
        representation = format!("{representation}; {}", scene.describe());
        Some((render_scene, scene))
    } else {
        None
    };
    let mut runs = Vec::new();
    for run in 0..=args.repeat {
        // Runs alternate between the two scenes, so that each run is an edit.
        let loaded = if run % 2 == 0 { &edited } else { loaded };
        let start = Instant::now();
        let times = match (&view, args.edit) {
            (Some((render_scene, scene)), Some(EditArg::Camera)) => shown(scene, render_scene, args.size)?,
            (view, edit) => {
                if edit.is_none() {
                    pipeline = Pipeline::new();
                }
                let outcome = pipeline.slab(loaded)?;
                let mut times = outcome.times.clone();
                if let Some((render_scene, _)) = view {
                    let scene = SlabScene::with(&pipeline, loaded, &outcome, render_scene)?;
                    times.extend(scene.times.iter().copied());
                    times.extend(shown(&scene, render_scene, args.size)?);
                }
                times
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

/// Edits a scene; returns the path of the parameter.
fn edit(edit: Option<EditArg>, edited: &mut LoadedScene) -> Result<Option<String>, Error> {
    let scene = &mut edited.scene;
    let is_own_tile = |face: &SlabFace| matches!(face, SlabFace::Tile(tile) if tile.scene.is_none());
    let shows_tile = scene.slab.as_ref().is_some_and(|slab| slab.faces().iter().any(|(_, face)| is_own_tile(face)));
    let parameter = match edit {
        None | Some(EditArg::Camera) => return Ok(None),
        Some(EditArg::Face) => scene.nudge_face().ok_or_else(|| no_parameter("slab.top"))?,
        Some(EditArg::Eta) => scene.nudge_eta().ok_or_else(|| no_parameter("slab.eta"))?,
        Some(EditArg::Thickness) => scene.nudge_thickness().ok_or_else(|| no_parameter("slab.thickness"))?,
        Some(EditArg::Geometry) if shows_tile => scene.nudge_geometry().ok_or_else(|| no_parameter("tile.geometry"))?,
        Some(EditArg::Geometry | EditArg::Brdf | EditArg::Color) => {
            let expected = "face, eta, thickness or camera; geometry if a face of the slab is this scene's tile";
            return Err(InputError::new("--edit", "a parameter that the slab does not depend on", expected).into());
        }
    };
    Ok(Some(parameter))
}

/// Renders the image; returns the times of its parts.
fn shown(scene: &SlabScene, render_scene: &RenderScene, size: [usize; 2]) -> Result<StageTimes> {
    let Rendered { times, .. } = scene.render(render_scene, size, 1, &Cancel::default())?;
    Ok(vec![("g_buffer", times.gbuffer_ms), ("shading", times.shading_ms)])
}
