//! Decisions of the plan that a scene's shape and materials settle, and what a person forces.

use super::IMAGE_CHECK_PAIRS;
use super::effects::IMAGE_QUERIES;
use super::{Costs, Effect, Preset, SceneFeatures, Settings};
use crate::interreflection::predicted_share;
use crate::scene::Switch;

/// Notes `(name, on, reason, predicted milliseconds)`.
pub(super) trait Note: FnMut(&'static str, bool, String, f64) {}
impl<F: FnMut(&'static str, bool, String, f64)> Note for F {}

/// As forced, else as decided.
pub(super) fn is_on(switch: Switch, decided: bool) -> bool {
    match switch {
        Switch::Auto => decided,
        Switch::On => true,
        Switch::Off => false,
    }
}

/// Of the light on a level plane, the part that comes from lower than the steepest slope: nothing above it is ever blocked.
fn hidden_light(found: &SceneFeatures) -> f64 {
    f64::from(found.steepest).sin().powi(2)
}

/// Can occlusion be left out within the tolerance? Only where nothing overhangs and no slope is steep: a direction that is
/// higher than the steepest slope sees all of a height-field. A quarter of the tolerance is granted to it.
pub(super) fn is_shallow(found: &SceneFeatures, settings: &Settings) -> bool {
    found.height_field && found.closes_plane && hidden_light(found) <= 0.25 * settings.tolerance
}

/// Why visibility is not computed.
pub(super) fn no_visibility(found: &SceneFeatures, settings: &Settings) -> String {
    if settings.effects.visibility == Switch::Off {
        "left out as asked: every facet sees every direction that it faces".to_owned()
    } else if found.flat {
        "the tile is flat: every facet sees every direction".to_owned()
    } else {
        format!(
            "shallow: no slope is steeper than {:.1}°, nothing above that is hidden, and {:.2} % of the light on a plane comes from below (allowed: {:.2} %)",
            found.steepest.to_degrees(),
            hidden_light(found) * 100.0,
            25.0 * settings.tolerance
        )
    }
}

/// Whether pictures read something quicker than the BRDF itself. `query_ms`: one direct sum, all threads at work.
pub(super) fn picture_table(
    found: &SceneFeatures,
    settings: &Settings,
    costs: &Costs,
    horizons: bool,
    query_ms: f64,
    note: &mut impl Note,
) -> bool {
    let direct_ms = IMAGE_QUERIES * query_ms;
    let table_ms = IMAGE_QUERIES * costs.table_query_ns * 1e-6 / costs.threads;
    let spared = settings.effects.mirror_symmetry != Switch::Off;
    let mirrors = found.mirrors.filter(|_| spared).unwrap_or_default();
    let making_ms = settings.image_grids.first().map(|grid| grid.originals(mirrors) as f64 * query_ms);
    let pays = !found.flat && making_ms.is_some_and(|ms| ms + table_ms < direct_ms);
    let on = is_on(settings.effects.picture_table, pays);
    let strided_subset = horizons && found.distinct_normals.is_some();
    let reason = match making_ms {
        _ if found.flat => "a flat tile is its own BRDF".to_owned(),
        None => "pictures evaluate the BRDF itself at this quality".to_owned(),
        Some(ms) => {
            let (percent, db) = (settings.image_tolerance.0 * 100.0, settings.image_tolerance.1);
            let kept = format!("if within {percent:.0} % and {db:.0} dB of the sum");
            let direct = format!("a 384x384 picture with 32 lights is predicted at {direct_ms:.0} ms summed directly");
            if strided_subset {
                format!("{direct}; few normals: part of the facets are summed, {kept}")
            } else {
                format!("{direct}, {table_ms:.0} ms from a table that takes {ms:.0} ms, once; kept {kept}")
            }
        }
    };
    // Thinning takes no more than its check.
    let predicted = if strided_subset { IMAGE_CHECK_PAIRS as f64 * query_ms } else { making_ms.unwrap_or(0.0) };
    note("picture_table", on, reason, if on { predicted } else { 0.0 });
    on
}

/// The part of all directions in which facets see each other: `1 - A/S` of a surface that closes the plane (every ray of uniform
/// light ends on it once), and a guess for others.
fn hidden_directions(found: &SceneFeatures) -> f64 {
    if found.flat { 0.0 } else { (1.0 - 1.0 / found.area_ratio.max(1.0)).clamp(0.0, 1.0) }
}

/// Light between facets: only when asked for. `f̄` is the paper's Eq. 7 by default, which leaves it out, so that what other
/// programs compute from the same definition stays comparable; the estimate says what is missed.
pub(super) fn interreflection(found: &SceneFeatures, settings: &Settings, costs: &Costs, note: &mut impl Note) -> bool {
    let share = predicted_share(found.albedo, hidden_directions(found));
    let can = !found.flat && found.materials > 0 && settings.preset != Preset::Wu2011;
    let on = can && settings.effects.interreflection == Switch::On;
    let knobs = settings.interreflection();
    let rays = (knobs.elements * knobs.rays) as f64;
    let lobes = rays * hidden_directions(found) * 2.0 * knobs.grid.len() as f64;
    let ms = (rays * RAY_NS + lobes * LOBE_NS) * 1e-6 / costs.threads;
    let estimate = format!("estimated to add up to {:.0} % to what is reflected directly", share * 100.0);
    let reason = if found.flat {
        "the tile is flat: no facet sees another".to_owned()
    } else if found.materials == 0 {
        "nothing reflects".to_owned()
    } else if settings.preset == Preset::Wu2011 {
        "the paper leaves it out".to_owned()
    } else if on {
        format!("{estimate}; {} bounces from {} rays of {} facets", knobs.bounces, knobs.rays, knobs.elements)
    } else if settings.effects.interreflection == Switch::Off || share <= settings.tolerance {
        format!("{estimate}; left out, as in the paper")
    } else {
        format!(
            "{estimate}, more than the tolerance of {:.1} %; left out, as in the paper's definition of f̄: ask with --effect interreflection=on ({ms:.0} ms)",
            settings.tolerance * 100.0
        )
    };
    note("interreflection", on, reason, if on { ms } else { 0.0 });
    on
}

/// A ray from facet to facet, and one lobe of it towards one node of the table.
const RAY_NS: f64 = 1500.0;
const LOBE_NS: f64 = 60.0;

/// Effects that are read off the scene.
pub(super) fn of_the_scene(found: &SceneFeatures, settings: &Settings, note: &mut impl Note) {
    let forced = &settings.effects;
    let keep_black = is_on(forced.black_materials, false);
    note(
        "black_materials",
        keep_black,
        match (found.black_materials, keep_black) {
            (0, _) => "no material is black".to_owned(),
            (n, true) => format!("{n} black materials are summed as asked"),
            (n, false) => format!("{n} black materials reflect nothing: skipped"),
        },
        0.0,
    );
    note(
        "color_channels",
        !found.grey,
        if found.grey {
            "all materials are grey: light between facets is gathered in one channel".to_owned()
        } else {
            "materials have colours: light between facets is gathered in three channels".to_owned()
        },
        0.0,
    );
    let anisotropic = is_on(forced.anisotropy, !found.flat);
    note(
        "anisotropy",
        anisotropic,
        match (anisotropic, found.flat) {
            (false, true) => {
                "flat, and all BRDFs are isotropic: tables have three angles (.bsdf; .binary loses nothing)"
            }
            (false, false) => "taken not to turn with the tile, as asked: tables have three angles (.bsdf)",
            (true, _) => "the result may turn with the tile: four angles",
        }
        .to_owned(),
        0.0,
    );
    note(
        "overhangs",
        !found.height_field && !found.flat,
        if found.height_field || found.flat {
            "a height-field: one horizon an azimuth says what a facet sees".to_owned()
        } else {
            "surfaces overhang: more than one horizon an azimuth".to_owned()
        },
        0.0,
    );
    note(
        "lights",
        found.lights > 0,
        if found.lights == 0 {
            "no light".to_owned()
        } else {
            format!(
                "{} directional lights, {} of those listed under the horizon of the world",
                found.lights, found.lights_below
            )
        },
        0.0,
    );
    note(
        "faint_lights",
        is_on(forced.faint_lights, false),
        if is_on(forced.faint_lights, false) {
            "lights that no part of the object faces, and those too faint to be seen, are shaded as asked".to_owned()
        } else {
            format!(
                "lights that no part of the object faces, and the faintest with {:.1} ‰ of the power, are left out",
                crate::render::FAINT_PART * 1e3
            )
        },
        0.0,
    );
}

/// The mirror planes that are used.
pub(super) fn mirrors(found: &SceneFeatures, settings: &Settings) -> [bool; 2] {
    match settings.effects.mirror_symmetry {
        Switch::Auto => found.mirrors.unwrap_or_default(),
        Switch::On => [true; 2],
        Switch::Off => [false; 2],
    }
}

/// Planes are looked for when something is tabulated: who edits the geometry need not wait for it.
pub(super) fn mirror_symmetry(
    found: &SceneFeatures,
    settings: &Settings,
    interreflection: bool,
    picture_table: bool,
    note: &mut impl Note,
) {
    let planes = mirrors(found, settings);
    let asked = settings.effects.mirror_symmetry;
    let known = asked == Switch::On || found.mirrors.is_some();
    let on = match (interreflection || picture_table, asked) {
        (false, _) | (_, Switch::Off) => false,
        (true, _) => !known || planes != [false; 2],
    };
    let reason = match planes {
        _ if !interreflection && !picture_table => "nothing is tabulated that it could spare",
        _ if asked == Switch::Off => "taken to have none, as asked",
        _ if !known => {
            "where planes x = const or y = const mirror the tile, the pictures' table takes half or a quarter"
        }
        [true, true] => "mirrored in planes x = const and y = const: a quarter of the viewers tells all",
        [false, false] => "no plane x = const or y = const mirrors the tile",
        _ => "mirrored in one plane: half of the viewers tells all",
    };
    note("mirror_symmetry", on, reason.to_owned(), 0.0);
}

/// Marks what was forced, and how much turning on what is off by itself can change.
pub(super) fn mark(effects: &mut [Effect], found: &SceneFeatures, settings: &Settings) {
    let forced = &settings.effects;
    let on_interreflection = effects.iter().any(|effect| effect.name == "interreflection" && effect.on);
    for effect in effects {
        let (switch, bound) = match effect.name {
            "visibility" => (forced.visibility, Some(if found.flat { ROUNDING } else { settings.tolerance })),
            "picture_table" => (forced.picture_table, None),
            "exact_lobes" => (forced.exact_lobes, Some(SAME_NORMALS)),
            "color_weights" => (forced.color_weights, Some(ROUNDING)),
            "material_groups" => (forced.material_groups, Some(ROUNDING)),
            "black_materials" => (forced.black_materials, Some(ROUNDING)),
            "mirror_symmetry" => (forced.mirror_symmetry, (!on_interreflection).then_some(ROUNDING)),
            "anisotropy" => (forced.anisotropy, Some(ROUNDING)),
            "self_shadow" => (forced.self_shadow, Some(0.0)),
            "faint_lights" => (forced.faint_lights, Some(0.0)),
            // What it would change is an estimate, no bound, unless there is nothing.
            "interreflection" => (forced.interreflection, found.flat.then_some(ROUNDING)),
            _ => continue,
        };
        effect.forced = switch != Switch::Auto;
        effect.bound = bound.filter(|_| !effect.on && switch == Switch::Auto);
    }
}

/// The same sum in another order.
const ROUNDING: f64 = 1e-4;
/// Normals closer than rounding are taken as one.
const SAME_NORMALS: f64 = 1e-3;
