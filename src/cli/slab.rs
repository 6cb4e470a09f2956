//! Values of slabs at direction pairs, for `biscale eval`.

use anyhow::Result;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::watch::Watch;
use crate::base::{Cancel, Error, InputError};
use crate::diagnostics::Health;
use crate::pipeline::{Pipeline, SlabOutcome};
use crate::plan::{Preset, Settings};
use crate::reference::photons::{PairSettings, PairTruth};
use crate::scene::{LoadedScene, Switch};

/// `f̄` of pairs with their standard errors, which are empty unless the values are a reference.
pub struct SlabValues {
    pub values: Vec<Vec3>,
    pub errors: Vec<Vec3>,
    pub representation: String,
    pub health: Health,
}

/// Standard error over the value at which the photons of a pair end.
const TARGET: f64 = 5e-3;

/// Evaluates the slab of a scene at pairs of directions towards the light and the viewer, on any side.
///
/// # Errors
/// As [`Pipeline::slab`].
pub fn eval(
    pipeline: &mut Pipeline,
    loaded: &LoadedScene,
    pairs: &[(DVec3, DVec3)],
    quiet: bool,
) -> Result<SlabValues> {
    let watch = Watch::new(quiet);
    let cancel = watch.cancel();
    pipeline.set_cancel(cancel.clone());
    let settings = Settings::of(&loaded.scene);
    let is_reference = settings.preset == Preset::Reference;
    if is_reference {
        require_faces(loaded, "the quality `reference`")?;
    }
    let outcome = if is_reference { pipeline.slab_of_faces(loaded)? } else { pipeline.slab(loaded)? };
    if is_reference {
        return reference(loaded, &outcome, pairs, &cancel);
    }
    let slab = &outcome.slab;
    let values = pairs.par_iter().map(|(i, o)| slab.eval(*i, *o).as_vec3()).collect();
    let representation = describe(&outcome);
    Ok(SlabValues { values, errors: Vec::new(), representation, health: outcome.health })
}

fn reference(
    loaded: &LoadedScene,
    outcome: &SlabOutcome,
    pairs: &[(DVec3, DVec3)],
    cancel: &Cancel,
) -> Result<SlabValues> {
    let slab = &outcome.slab;
    let settings = PairSettings {
        walks: outcome.settings.reference_walks,
        target: TARGET,
        bounces: loaded.scene.slab.as_ref().is_some_and(|slab| slab.bounces == Switch::On),
        seed: outcome.settings.seed,
    };
    let truth = PairTruth::of_pairs((&slab.top, &slab.bottom), &slab.optics, pairs, &settings, cancel)?;
    let (values, errors) = truth.iter().map(|pair| (pair.f_bar.as_vec3(), pair.standard_error.as_vec3())).unzip();
    let representation = "photons through random facets of both faces".to_owned();
    Ok(SlabValues { values, errors, representation, health: outcome.health.clone() })
}

/// The slab in words.
pub fn describe(outcome: &SlabOutcome) -> String {
    let slab = &outcome.slab;
    if let Some(captured) = &slab.captured {
        return format!("captured sheet: mean over its pixels, {} representatives", captured.len());
    }
    let method = match slab.method {
        crate::slab::Method::Dual => "dual-microfacet model".to_owned(),
        crate::slab::Method::Faces => format!("sum over {} facets", outcome.settings.facets.max(1)),
    };
    format!("{method}; top: {}; bottom: {}; alpha {:.2}", slab.top.describe(), slab.bottom.describe(), slab.alpha)
}

/// Checks that photons and facets are asked for only if the slab has faces.
///
/// # Errors
/// The scene shows a captured sheet.
pub fn require_faces(loaded: &LoadedScene, asked: &str) -> Result<(), Error> {
    if loaded.scene.slab.as_ref().is_some_and(|slab| slab.svbtdf.is_some()) {
        let expected = "the mean of its pixels: a captured sheet has no faces";
        return Err(InputError::new("slab.svbtdf", format!("a captured sheet and {asked}"), expected).into());
    }
    Ok(())
}

/// Checks that a scene has no slab, before a command that knows none reads or writes anything.
///
/// # Errors
/// The scene has a slab.
pub fn refuse(loaded: &LoadedScene, command: &str) -> Result<()> {
    if loaded.scene.slab.is_none() {
        return Ok(());
    }
    let expected = format!(
        "a scene without it: `biscale {command}` knows no slabs; `eval`, `transmit`, `render`, `export`, `fit`, `plan` and `profile` do"
    );
    Err(crate::Error::from(InputError::new("slab", "a scene with a slab", expected)).into())
}
