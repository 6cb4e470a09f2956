//! From a scene with a slab to what the slab transmits and reflects.

use std::sync::Arc;
use std::time::Instant;

use super::Pipeline;
use super::stage::{Keyed, StageTimes, elapsed_ms};
use super::stages::{BuildFace, CorrelateFaces, FaceNormals, ReadSvbtdf, TraceInner};
use crate::base::{InputError, Result};
use crate::cache::{Key, KeyBuilder};
use crate::diagnostics::{Health, SlabHealthInputs};
use crate::plan::{Effect, Settings, SlabDecision, SlabFeatures, SlabSettings};
use crate::scene::{Alpha, LoadedScene, SlabSpec, Switch};
use crate::slab::capture::svbtdf::Svbtdf;
use crate::slab::{Method, Optics, Slab, alpha_of, dual_error};

/// A slab, and how it was computed.
#[derive(Debug, Clone)]
pub struct SlabOutcome {
    pub slab: Arc<Slab>,
    /// Key of all that paths through the slab depend on: both faces and the material between them.
    pub paths_key: Key,
    /// The plan's rows: the slab and its inner reflections.
    pub effects: Vec<Effect>,
    pub settings: SlabSettings,
    /// The stages that ran this time.
    pub times: StageTimes,
    /// Relative L2 of Eq. 11 against Eq. 1 on 32 pairs.
    pub dual_error: f64,
    pub health: Health,
    /// The captured sheet of a scene with one: its pixels have lobes of their own.
    pub svbtdf: Option<Arc<Svbtdf>>,
}

/// Checks that a scene has no slab, before a command or a computation that does not support slabs.
///
/// # Errors
/// The scene has a slab.
pub fn refuse_slab(loaded: &LoadedScene, command: &str) -> Result<()> {
    if loaded.scene.slab.is_none() {
        return Ok(());
    }
    let expected = format!(
        "a scene without it: {command} knows no slabs; the commands `eval`, `transmit`, `render`, `export`, `fit`, `rig`, `plan` and `profile` do"
    );
    Err(InputError::new("slab", "a scene with a slab", expected).in_file(&loaded.name).into())
}

impl Pipeline {
    /// The normals of both faces of a slab.
    fn slab_faces(
        &self,
        loaded: &LoadedScene,
        slab: &SlabSpec,
        settings: &SlabSettings,
        times: &mut StageTimes,
    ) -> Result<[Keyed<FaceNormals>; 2]> {
        let [top, bottom] = slab.faces();
        let mut face = |face| self.get(BuildFace::new(loaded, face, settings, &self.env)?, times);
        Ok([face(top)?, face(bottom)?])
    }

    /// The slab of a scene at its own quality.
    ///
    /// # Errors
    /// The scene has no slab, a face cannot be used, or [`crate::base::Error::Cancelled`].
    pub fn slab(&self, loaded: &LoadedScene) -> Result<SlabOutcome> {
        let spec = loaded.scene.slab.as_ref().ok_or_else(|| InputError::new("slab", "nothing", "a slab"))?;
        let bounces = spec.bounces == Switch::On;
        self.slab_with(loaded, spec, bounces)
    }

    /// As [`Self::slab`], but without the table of inner reflections, for a caller that traces photons itself.
    ///
    /// # Errors
    /// As [`Self::slab`].
    pub fn slab_of_faces(&self, loaded: &LoadedScene) -> Result<SlabOutcome> {
        let spec = loaded.scene.slab.as_ref().ok_or_else(|| InputError::new("slab", "nothing", "a slab"))?;
        self.slab_with(loaded, spec, false)
    }

    fn slab_with(&self, loaded: &LoadedScene, spec: &SlabSpec, bounces: bool) -> Result<SlabOutcome> {
        let settings = Settings::of(&loaded.scene).slab();
        let mut times = StageTimes::new();
        let [top, bottom] = self.slab_faces(loaded, spec, &settings, &mut times)?;
        let correlation = CorrelateFaces { top: &top, bottom: &bottom, table_side: settings.virtual_table };
        let virtual_face = self.get(correlation, &mut times)?;
        let optics = optics(spec);
        let captured = match &spec.svbtdf {
            Some(path) => Some(self.get(ReadSvbtdf::new(loaded, path, &self.env), &mut times)?),
            None => None,
        };
        let captured_key = captured.as_ref().map(|captured| captured.key);
        let captured = captured.map(|captured| captured.value);
        let inner = if bounces && captured.is_none() {
            let (photons, seed) = (settings.photons, settings.seed);
            let trace = TraceInner { top: &top, bottom: &bottom, optics, photons, seed };
            Some(self.get(trace, &mut times)?.value)
        } else {
            None
        };
        let mut paths_key = KeyBuilder::of_stage("slab_paths");
        paths_key.key("top", &top.key).key("bottom", &bottom.key).flags("bounces", [bounces]);
        let Optics { eta, thickness, absorption, diffuse } = optics;
        paths_key.numbers("optics", &[eta, absorption, diffuse]).numbers("thickness", &[thickness]);
        if let Some(captured) = &captured_key {
            paths_key.key("svbtdf", captured);
        }
        let start = Instant::now();
        let alpha = match spec.alpha {
            Alpha::Auto => alpha_of(&top.ndf, &bottom.ndf),
            Alpha::Given(alpha) => f64::from(alpha),
        };
        let mut slab = Slab {
            top: top.ndf.clone(),
            bottom: bottom.ndf.clone(),
            virtual_face: virtual_face.value,
            facets: None,
            optics,
            alpha,
            method: Method::Dual,
            inner,
            below: Arc::default(),
            photons: settings.photons,
            seed: settings.seed,
            captured: captured.as_ref().map(|captured| captured.mean.clone()),
        };
        if let Some(captured) = &captured {
            slab.optics.eta = glam::DVec3::splat(captured.svbtdf.optics.eta);
        }
        let dual_error = dual_error(&slab);
        let decision = match &slab.captured {
            Some(captured) => SlabDecision::of_capture(captured.len()),
            None => SlabDecision::new(&SlabFeatures::of(&slab, spec.method, dual_error), &settings),
        };
        if decision.method == Method::Faces {
            slab = slab.by_faces(settings.facets.max(1));
        }
        times.push(("slab", elapsed_ms(start)));
        let relief = top.relief.max(bottom.relief);
        let inputs = SlabHealthInputs { dual_error, bound: settings.bound, relief };
        let health = Health::of_slab(&slab, &inputs);
        let mut effects = decision.effects;
        for effect in &mut effects {
            let name = if effect.name == "slab" { "slab" } else { "slab_inner" };
            effect.measured_ms = times.iter().find(|(stage, _)| *stage == name).map(|(_, ms)| *ms);
        }
        let svbtdf = captured.map(|captured| captured.svbtdf.clone());
        let paths_key = paths_key.finish();
        Ok(SlabOutcome { slab: Arc::new(slab), paths_key, effects, settings, times, dual_error, health, svbtdf })
    }
}

fn optics(spec: &SlabSpec) -> Optics {
    Optics {
        eta: spec.eta.as_dvec3(),
        thickness: f64::from(spec.thickness),
        absorption: spec.absorption.as_dvec3(),
        diffuse: spec.diffuse.as_dvec3(),
    }
}
