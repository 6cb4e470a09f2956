//! The table of effects: one row per effect, physics first. Decisions on methods are in `methods.rs`.
//!
//! A new effect is a row here and a switch in `[effects]` (`src/scene/effects.rs`).

use super::algorithm::{SHALLOW_PART, maps_ms, max_blocked_part, scan_ms};
use super::context::Context;
use super::{
    Effect, EffectKind, FAINT_FRACTION, LargeScaleFeatures, LeftOut, Preset, VisibilityAlgorithm, VisibilityMethod,
    interreflection, is_on, methods,
};
use crate::effective::Wu2011Settings;
use crate::interreflection::BouncedShare;
use crate::scene::{Effects, Switch};

/// An effect and the function that decides it.
struct Row {
    name: &'static str,
    kind: EffectKind,
    /// The field of `[effects]` that forces the effect; `None` if no such field exists.
    switch: Option<fn(&mut Effects) -> &mut Switch>,
    decide: fn(&Context<'_>, Switch) -> Decision,
}

/// The decision on one effect.
pub(super) struct Decision {
    on: bool,
    reason: String,
    predicted_ms: f64,
    /// An upper bound of the relative L2 change of `f̄` if the effect were turned on.
    bound: Option<f64>,
    light: Option<BouncedShare>,
    left_out: Option<LeftOut>,
}

impl Decision {
    pub fn new(on: bool, reason: impl Into<String>) -> Self {
        Self { on, reason: reason.into(), predicted_ms: 0.0, bound: None, light: None, left_out: None }
    }

    pub fn costs(self, predicted_ms: f64) -> Self {
        Self { predicted_ms, ..self }
    }

    pub fn changes_at_most(self, bound: f64) -> Self {
        Self { bound: Some(bound), ..self }
    }

    pub fn adds(self, light: Option<BouncedShare>) -> Self {
        Self { light, ..self }
    }

    pub fn leaves_out(self, left_out: Option<LeftOut>) -> Self {
        Self { left_out, ..self }
    }

    fn effect(self, name: &'static str, kind: EffectKind, switch: Switch) -> Effect {
        let Self { on, reason, predicted_ms, bound, light, left_out } = self;
        let forced = switch != Switch::Auto;
        let bound = bound.filter(|_| !on && !forced);
        Effect { name, kind, on, reason, predicted_ms, measured_ms: None, forced, bound, light, left_out }
    }
}

/// The bound of an effect that only changes the order of a sum.
pub(super) const ROUNDING: f64 = 1e-4;
/// The bound of treating normals that differ only by rounding as equal.
pub(super) const SAME_NORMALS: f64 = 1e-3;
/// The bound of an effect that does not touch f̄.
const UNCHANGED: f64 = 0.0;

use EffectKind::{Method as ByMethod, Physics, Scene as OfScene};

static ROWS: &[Row] = &[
    Row { name: "visibility", kind: Physics, switch: Some(|effects| &mut effects.visibility), decide: visibility },
    Row { name: "overhangs", kind: Physics, switch: None, decide: overhangs },
    Row {
        name: "interreflection",
        kind: Physics,
        switch: Some(|effects| &mut effects.interreflection),
        decide: interreflection::decide,
    },
    Row {
        name: "self_shadow",
        kind: Physics,
        switch: Some(|effects| &mut effects.self_shadow),
        decide: |context, switch| self_shadow(context.features.large_scale, switch),
    },
    Row { name: "anisotropy", kind: Physics, switch: Some(|effects| &mut effects.anisotropy), decide: anisotropy },
    Row { name: "slab", kind: Physics, switch: None, decide: slab },
    Row { name: "color_map_filtering", kind: Physics, switch: None, decide: color_map_filtering },
    Row {
        name: "material_groups",
        kind: OfScene,
        switch: Some(|effects| &mut effects.material_groups),
        decide: material_groups,
    },
    Row {
        name: "color_weights",
        kind: OfScene,
        switch: Some(|effects| &mut effects.color_weights),
        decide: color_weights,
    },
    Row { name: "color_channels", kind: OfScene, switch: None, decide: color_channels },
    Row {
        name: "black_materials",
        kind: OfScene,
        switch: Some(|effects| &mut effects.black_materials),
        decide: black_materials,
    },
    Row { name: "measured_brdf", kind: OfScene, switch: None, decide: measured_brdf },
    Row { name: "projected_area", kind: OfScene, switch: None, decide: projected_area },
    Row { name: "lights", kind: OfScene, switch: None, decide: |context, _| lights(context.features.large_scale) },
    Row {
        name: "faint_lights",
        kind: OfScene,
        switch: Some(|effects| &mut effects.faint_lights),
        decide: faint_lights,
    },
    Row { name: "low_rank", kind: ByMethod, switch: None, decide: methods::low_rank },
    Row {
        name: "picture_table",
        kind: ByMethod,
        switch: Some(|effects| &mut effects.picture_table),
        decide: methods::shading_table,
    },
    Row {
        name: "exact_lobes",
        kind: ByMethod,
        switch: Some(|effects| &mut effects.exact_lobes),
        decide: methods::exact_lobes,
    },
    Row {
        name: "mirror_symmetry",
        kind: ByMethod,
        switch: Some(|effects| &mut effects.mirror_symmetry),
        decide: methods::mirror_symmetry,
    },
];

/// Evaluates all rows.
pub(super) fn decide_all(context: &Context<'_>) -> Vec<Effect> {
    let mut forced = context.settings.effects.clone();
    let mut decide = |row: &Row| {
        let switch = row.switch.map_or(Switch::Auto, |field| *field(&mut forced));
        (row.decide)(context, switch).effect(row.name, row.kind, switch)
    };
    ROWS.iter().map(&mut decide).collect()
}

/// Decides the rows of the object and the lights again, for a scene that differs in nothing else.
pub(super) fn decide_large_scale(effects: &mut [Effect], large_scale: LargeScaleFeatures, switches: &Effects) {
    for effect in effects {
        let (decision, switch) = match effect.name {
            "self_shadow" => (self_shadow(large_scale, switches.self_shadow), switches.self_shadow),
            "lights" => (lights(large_scale), Switch::Auto),
            _ => continue,
        };
        *effect = decision.effect(effect.name, effect.kind, switch);
    }
}

/// The names of all effects that a field of `[effects]` forces, in the order of the table.
pub fn effect_names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().filter(|row| row.switch.is_some()).map(|row| row.name)
}

/// The field of `[effects]` that forces an effect; `None` if the effect has none.
pub fn switch_mut<'a>(effects: &'a mut Effects, name: &str) -> Option<&'a mut Switch> {
    let row = ROWS.iter().find(|row| row.name == name)?;
    row.switch.map(|field| field(effects))
}

/// Milliseconds of a shadow map on a GPU.
const GPU_MAP_MS: f64 = 0.06;

fn visibility(context: &Context<'_>, switch: Switch) -> Decision {
    let Context { features, settings, costs, algorithm, .. } = *context;
    let facets = settings.facets as f64;
    let azimuths = settings.horizon_azimuths as f64;
    let cause = match settings.visibility_method {
        VisibilityMethod::Auto => "surfaces overhang",
        _ => "asked for by quality.visibility",
    };
    let of_map = format!(
        "{}: a horizon map of {azimuths} azimuths",
        if features.extruded { "no overhangs, and no change along one direction" } else { "no overhangs" },
    );
    let (reason, predicted_ms) = match algorithm {
        VisibilityAlgorithm::None => (no_visibility(context, switch), 0.0),
        VisibilityAlgorithm::HeightMarch => (
            format!("{of_map} from a walk over the samples of a height field"),
            facets * azimuths * costs.march_ns * 1e-6 / costs.threads,
        ),
        VisibilityAlgorithm::HorizonScan => (
            format!("{of_map} from slices through {} triangles", features.triangles),
            facets * azimuths * costs.scan_ns * 1e-6 / costs.threads,
        ),
        VisibilityAlgorithm::OcclusionIntervals => (
            format!(
                "{cause}: occlusion intervals along {} azimuths (shadow maps: {:.0} ms)",
                settings.slice_azimuths,
                maps_ms(features, settings, costs)
            ),
            scan_ms(features, settings, costs),
        ),
        VisibilityAlgorithm::CpuMaps if settings.preset == Preset::Wu2011 => {
            let (maps, texels) = (Wu2011Settings::VISIBILITY_DIRECTIONS, settings.map_resolution);
            let part = maps as f64 / settings.map_grid.len() as f64;
            let reason = format!("as in the paper: {maps} shadow maps of {texels} texels per side");
            (reason, part * maps_ms(features, settings, costs))
        }
        VisibilityAlgorithm::CpuMaps => (
            format!(
                "{cause}: {} toroidal shadow maps of {} texels per side (occlusion intervals: {:.0} ms)",
                settings.map_grid.len(),
                settings.map_resolution,
                scan_ms(features, settings, costs)
            ),
            maps_ms(features, settings, costs),
        ),
        VisibilityAlgorithm::GpuMaps => (
            format!("{cause}: {} toroidal shadow maps on the GPU", settings.map_grid.len()),
            settings.map_grid.len() as f64 * GPU_MAP_MS,
        ),
    };
    let bound = if features.flat { ROUNDING } else { settings.tolerance };
    Decision::new(algorithm != VisibilityAlgorithm::None, reason).costs(predicted_ms).changes_at_most(bound)
}

/// The reason why visibility is not computed.
fn no_visibility(context: &Context<'_>, switch: Switch) -> String {
    let features = context.features;
    if switch == Switch::Off {
        "left out as asked: every facet sees every direction that it faces".to_owned()
    } else if features.flat {
        "the tile is flat: every facet sees every direction".to_owned()
    } else {
        format!(
            "shallow: no slope exceeds {:.1}°, so that at most {:.2} % of uniform light is blocked (limit: {:.2} %)",
            features.steepest.to_degrees(),
            max_blocked_part(features) * 100.0,
            SHALLOW_PART * context.settings.tolerance * 100.0
        )
    }
}

fn overhangs(context: &Context<'_>, _: Switch) -> Decision {
    if context.settings.preset == Preset::Wu2011 {
        Decision::new(true, "as in the paper: shadow maps see surfaces that overhang")
    } else if context.features.height_field || context.features.flat {
        Decision::new(false, "no overhangs: one horizon per azimuth describes what a facet sees")
    } else {
        Decision::new(true, "surfaces overhang: more than one horizon per azimuth")
    }
}

fn self_shadow(features: LargeScaleFeatures, switch: Switch) -> Decision {
    let reason = if !features.object_self_shadows {
        "the object is convex: it cannot shadow itself".to_owned()
    } else if features.lights == 0 {
        "no light".to_owned()
    } else {
        format!("the object can shadow itself: rays to {} lights", features.lights)
    };
    let on = is_on(switch, features.object_self_shadows && features.lights > 0);
    Decision::new(on, reason).changes_at_most(UNCHANGED)
}

fn anisotropy(context: &Context<'_>, switch: Switch) -> Decision {
    let on = is_on(switch, !context.features.flat);
    let reason = match (on, context.features.flat) {
        (false, true) => "flat, and all BRDFs are isotropic: tables have three angles (.bsdf; .binary loses nothing)",
        (false, false) => "treated as isotropic, as asked: tables have three angles (.bsdf)",
        (true, _) => "the result may depend on the azimuth of the tile: four angles",
    };
    Decision::new(on, reason).changes_at_most(ROUNDING)
}

fn slab(_: &Context<'_>, _: Switch) -> Decision {
    Decision::new(false, "the scene has no slab (Dai et al. 2009): light is reflected only")
}

/// Moments of one sample of a driver on all levels, and its rank [ns].
const SAMPLE_NS: f64 = 300.0;

/// The colour of the drivers' means stands in for the filter if it is as good.
fn color_map_filtering(context: &Context<'_>, _: Switch) -> Decision {
    let Some(map) = context.features.color_map else {
        return Decision::new(false, "filtered colour maps (Heitz et al. 2013): not asked for");
    };
    if map.naive_is_enough {
        let reason = "every driver varies by less than a step of the prefiltered table: the colour of its mean is kept";
        return Decision::new(false, reason);
    }
    let reason = match map.layers {
        1 => "the scene has a colour map: its mean over what is seen and lit".to_owned(),
        count => format!("the scene has a colour map of {count} layers: their means over what is seen and lit"),
    };
    Decision::new(true, reason).costs(map.samples as f64 * SAMPLE_NS * 1e-6 / context.costs.threads)
}

fn material_groups(context: &Context<'_>, switch: Switch) -> Decision {
    let features = context.features;
    let reason = match (features.materials, features.black_materials) {
        (n, 0) if n > 1 => format!("{n} materials, each summed over its own facets"),
        (n, black) if n > 1 => format!("{n} materials, each summed over its own facets; {black} black and skipped"),
        (_, 0) => "one material".to_owned(),
        (_, black) => format!("one material that reflects; {black} black and skipped"),
    };
    Decision::new(is_on(switch, features.materials > 1), reason).changes_at_most(ROUNDING)
}

fn color_weights(context: &Context<'_>, switch: Switch) -> Decision {
    let vary = context.features.colors_vary;
    let reason = if vary {
        "colour weights differ between facets of one material: three sums, one per channel"
    } else {
        "each material has one colour: one sum and a multiplication"
    };
    Decision::new(is_on(switch, vary), reason).changes_at_most(ROUNDING)
}

fn color_channels(context: &Context<'_>, _: Switch) -> Decision {
    if context.features.grey {
        Decision::new(false, "all materials are grey: interreflection is gathered in one channel")
    } else {
        Decision::new(true, "materials have colours: interreflection is gathered in three channels")
    }
}

fn black_materials(context: &Context<'_>, switch: Switch) -> Decision {
    let on = is_on(switch, false);
    let reason = match (context.features.black_materials, on) {
        (0, _) => "no material is black".to_owned(),
        (n, true) => format!("{n} black materials are summed as asked"),
        (n, false) => format!("{n} black materials reflect nothing: skipped"),
    };
    Decision::new(on, reason).changes_at_most(ROUNDING)
}

fn measured_brdf(context: &Context<'_>, _: Switch) -> Decision {
    let on = context.features.lookups > 0;
    Decision::new(on, if on { "a measured BRDF is looked up" } else { "all BRDFs are analytic" })
}

fn projected_area(context: &Context<'_>, _: Switch) -> Decision {
    if context.features.closes_plane {
        Decision::new(
            false,
            "the tile closes the plane: the projected area is A cos θ, and the sum estimates it as well",
        )
    } else {
        Decision::new(true, "the tile leaves holes: the measured projected area normalises")
    }
}

fn lights(features: LargeScaleFeatures) -> Decision {
    let reason = match features.lights {
        0 => "no light".to_owned(),
        count => format!(
            "{count} directional lights, {} of those listed below the horizon of the world",
            features.lights_below
        ),
    };
    Decision::new(features.lights > 0, reason)
}

fn faint_lights(_: &Context<'_>, switch: Switch) -> Decision {
    let on = is_on(switch, false);
    let reason = if on {
        "lights that no part of the object faces, and the faintest lights, are shaded as asked".to_owned()
    } else {
        format!(
            "lights that no part of the object faces, and the faintest with {:.1} ‰ of the power, are left out",
            FAINT_FRACTION * 1e3
        )
    };
    Decision::new(on, reason).changes_at_most(UNCHANGED)
}
