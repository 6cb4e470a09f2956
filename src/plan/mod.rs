//! The plan: which effects a scene calls for, why, and at what predicted cost.
//!
//! Every effect is one row of the table in `effects.rs`: its name, its kind, the switch that forces it, and the
//! function that decides it. [`Plan::new`] evaluates the rows.

mod algorithm;
mod context;
mod effects;
mod features;
mod interreflection;
mod methods;
mod refinement;
mod settings;
mod slab;
#[cfg(test)]
mod tests;

use serde::Serialize;

pub use algorithm::VisibilityAlgorithm;
use context::Context;
pub use context::IMAGE_CHECK_PAIRS;
pub use effects::{effect_names, switch_mut};
pub use features::{ColorMapFeatures, Costs, LargeScaleFeatures, SceneFeatures};
pub use refinement::{Refinement, finer_interreflection};
pub use settings::{Backend, Preset, ProductMethod, Settings, VisibilityMethod};
pub use slab::{SlabDecision, SlabFeatures, SlabSettings};

use crate::interreflection::{BouncedShare, InterreflectionSettings};
use crate::scene::{Scene, Switch};

/// The part of the program that an effect belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EffectKind {
    /// Light transport: leaving the effect out changes what is simulated.
    Physics,
    /// A property that is read off the scene.
    Scene,
    /// A way to compute the same result in less time.
    Method,
}

/// One effect of the plan, as `biscale plan --json` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    pub name: &'static str,
    pub kind: EffectKind,
    pub on: bool,
    pub reason: String,
    pub predicted_ms: f64,
    /// Milliseconds of the stage; `None` until it has run.
    pub measured_ms: Option<f64>,
    /// True if the user forced the effect on or off.
    pub forced: bool,
    /// An upper bound of the relative L2 change of `f̄` if the effect, which is off by itself, were turned on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// The part of the reflected light that the effect adds or would add, if it was measured.
    #[serde(flatten)]
    pub light: Option<BouncedShare>,
    /// Light that is missing because the effect is off, if it may be more than the preset's tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
}

/// Light that an effect would add.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LeftOut {
    /// The part of the reflected light, the effect included.
    pub share: f64,
    /// Standard error of `share`.
    pub std_error: f64,
    /// The part that the preset tolerates.
    pub tolerance: f64,
    /// Milliseconds that the effect would take.
    pub predicted_ms: f64,
}

/// The decisions for one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub algorithm: VisibilityAlgorithm,
    /// Try the low-rank representation first. It must pass its check against the direct sum.
    pub try_low_rank: bool,
    /// The resolution at which the light that facets send to each other is added; `None` if it is not.
    pub interreflection: Option<InterreflectionSettings>,
    /// The part of the reflected light that facets send to each other and that is not computed; `None` if it was not measured.
    pub light_left_out: Option<f64>,
    /// Try a table for images first. It must pass its check against the BRDF.
    pub try_shading_table: bool,
    /// All effects, physics first.
    pub effects: Vec<Effect>,
}

impl Plan {
    /// Decides every effect of a scene.
    pub fn new(features: &SceneFeatures, settings: &Settings, costs: &Costs) -> Self {
        let context = Context::new(features, settings, costs);
        Self {
            algorithm: context.algorithm,
            try_low_rank: context.try_low_rank,
            interreflection: context
                .interreflection
                .then(|| InterreflectionSettings { mirrors: context.mirrors(), ..settings.interreflection(features) }),
            light_left_out: features.light_left_out(context.interreflection),
            try_shading_table: context.try_shading_table,
            effects: effects::decide_all(&context),
        }
    }

    /// Returns true if the algorithm computes more than one horizon per azimuth.
    pub fn overhangs(&self) -> bool {
        matches!(
            self.algorithm,
            VisibilityAlgorithm::OcclusionIntervals | VisibilityAlgorithm::CpuMaps | VisibilityAlgorithm::GpuMaps
        )
    }

    /// Decides the effects of the object and its lights again, for a scene that differs in nothing else.
    pub fn decide_large_scale(&mut self, scene: &Scene) {
        effects::decide_large_scale(&mut self.effects, LargeScaleFeatures::of(scene), &scene.effects);
    }

    /// Returns true if an effect is on.
    pub fn is_on(&self, name: &str) -> bool {
        self.effects.iter().any(|effect| effect.name == name && effect.on)
    }

    /// Records the error of the low-rank representation against the direct sum, and whether it is used.
    pub fn note_low_rank(&mut self, is_used: bool, rel_l2: f64) {
        if let Some(effect) = self.effect_mut("low_rank") {
            effect.on = is_used;
            let verdict = if is_used { "used" } else { "not used, summed directly" };
            effect
                .reason
                .push_str(&format!("; its error against the direct sum is {:.1} %: {verdict}", rel_l2 * 100.0));
        }
    }

    /// Records the resolution of interreflection, which refinement may have raised.
    pub fn note_interreflection(&mut self, settings: InterreflectionSettings) {
        if self.interreflection == Some(settings) {
            return;
        }
        self.interreflection = Some(settings);
        if let Some(effect) = self.effect_mut("interreflection") {
            let InterreflectionSettings { useful_rays: rays, grid, .. } = settings;
            effect.reason.push_str(&format!("; refined to {rays} rays and {} directions", grid.len()));
        }
    }

    /// Records the milliseconds of stages beside what was predicted for their effects.
    pub fn note_times(&mut self, times: &[(&'static str, f64)]) {
        for (stage, ms) in times {
            let name = if *stage == "product" && self.try_low_rank { "low_rank" } else { stage };
            if let Some(effect) = self.effect_mut(name) {
                effect.measured_ms = Some(*ms);
            }
        }
    }

    fn effect_mut(&mut self, name: &str) -> Option<&mut Effect> {
        self.effects.iter_mut().find(|effect| effect.name == name)
    }
}

/// The part of the light that the lights which are left out as too faint hold together at most.
pub const FAINT_FRACTION: f32 = 1e-3;

/// The state of an effect: as forced, else as decided.
fn is_on(switch: Switch, decided: bool) -> bool {
    match switch {
        Switch::Auto => decided,
        Switch::On => true,
        Switch::Off => false,
    }
}
