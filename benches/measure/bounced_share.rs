//! The share of bounced light that decides on interreflection, beside that of the full result, and what both take.

use std::time::Instant;

use biscale::effective::EffectiveBrdf;
use biscale::math::directions::PolarGrid;
use biscale::pipeline::{Outcome, Pipeline};
use biscale::scene::{self, LoadedScene, Switch};
use rayon::prelude::*;

/// The stage that decides whether interreflection is computed, and those that compute it; the decision needs the first three too.
const DECISION: &str = "bounced_share";
const LIGHT: [&str; 6] = ["lobe_samplers", "cells", "hierarchy", "mirrors", "transport", "interreflection"];
/// Those that the facets of a surface that overhangs need, too.
const SHARED: [&str; 2] = ["cells", "hierarchy"];
/// Edits per scene, whose median counts.
const EDITS: u64 = 5;

/// What one scene takes: the medians of edits of the geometry [ms].
struct Times {
    without: f64,
    decision: f64,
    light: f64,
}

/// Prints a row for each shipped scene that reflects, or for those whose name contains `part`.
///
/// # Errors
/// A scene cannot be used.
pub fn bounced_share(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    print("| scene | share | full result | `standard` | edit without | decision | interreflection |".to_owned());
    print("|---|---|---|---|---|---|---|".to_owned());
    let (mut ratios, mut costs) = (Vec::new(), Vec::new());
    for name in scene::shipped::names().filter(|name| part.is_none_or(|part| name.contains(part))) {
        let loaded = scene::open(name, &[]).map_err(|error| error.to_string())?;
        if loaded.scene.slab.is_some() {
            continue;
        }
        let [off, on] = [Switch::Off, Switch::On].map(|switch| at(&loaded, switch));
        let (off, on) = (outcome(&off)?, outcome(&on)?);
        let Some(told) = off.plan.effects.iter().find_map(|effect| effect.light) else {
            print(format!("| `{name}` | not measured | {:.1} % | off | | | |", 100.0 * share(&off, &on)));
            continue;
        };
        let full = share(&off, &on);
        let auto = outcome(&at(&loaded, Switch::Auto))?;
        let times = times(&[Switch::Off, Switch::On, Switch::Auto].map(|switch| at(&loaded, switch)))?;
        let is_on = auto.plan.interreflection.is_some();
        ratios.push((told.share / full).max(full / told.share));
        if is_on {
            costs.push((times.decision + times.light) / times.without);
        }
        print(format!(
            "| `{name}` | {:.1} ± {:.1} % | {:.1} % | {} | {:.1} ms | {:.2} ms | {:.1} ms |",
            100.0 * told.share,
            100.0 * told.std_error,
            100.0 * full,
            if is_on { "on" } else { "off" },
            times.without,
            times.decision,
            times.light
        ));
    }
    ratios.sort_by(f64::total_cmp);
    costs.sort_by(f64::total_cmp);
    if let (Some(worst), [.., most]) = (ratios.last(), &costs[..]) {
        let median = costs[costs.len() / 2];
        print(String::new());
        print(format!(
            "The share and that of the full result differ by a factor of at most {worst:.2}. Where it is on,"
        ));
        print(format!(
            "interreflection takes {median:.2} times the rest of an edit in the median, and {most:.2} times at most."
        ));
    }
    Ok(())
}

fn at(loaded: &LoadedScene, switch: Switch) -> LoadedScene {
    let mut scene = loaded.clone();
    scene.scene.quality.preset = "standard".to_owned();
    scene.scene.quality.backend = "cpu".to_owned();
    scene.scene.effects.interreflection = switch;
    scene
}

fn outcome(loaded: &LoadedScene) -> Result<Outcome, String> {
    Pipeline::new().effective(loaded).map_err(|error| format!("{}: {error}", loaded.name))
}

/// The part of the light that a tile under a uniform sky reflects only with interreflection.
fn share(off: &Outcome, on: &Outcome) -> f64 {
    1.0 - albedo(&off.brdf) / albedo(&on.brdf)
}

fn albedo(brdf: &EffectiveBrdf) -> f64 {
    let grid = PolarGrid::new(12, 36);
    let reflected = |o: usize| {
        let to = grid.direction(o);
        let from = |i: usize| brdf.eval(grid.direction(i), to).element_sum() * grid.solid_angle(i);
        f64::from((0..grid.len()).map(from).sum::<f32>() * to.z * grid.solid_angle(o))
    };
    (0..grid.len()).into_par_iter().map(reflected).sum()
}

/// Times of edits of the geometry: with interreflection off, on and decided by the plan. An edit changes the size of the tile.
fn times(switched: &[LoadedScene; 3]) -> Result<Times, String> {
    let mut all: [Vec<f64>; 3] = Default::default();
    for edit in 0..EDITS {
        let edited = |loaded: &LoadedScene| {
            let mut scene = loaded.clone();
            scene.scene.tile.size *= 1.0 + 1e-3 * (edit + 1) as f32;
            let start = Instant::now();
            Ok::<_, String>((outcome(&scene)?, start.elapsed().as_secs_f64() * 1e3))
        };
        let [(off, off_ms), (on, _), (decided, _)] =
            [edited(&switched[0])?, edited(&switched[1])?, edited(&switched[2])?];
        // Facets of a surface that overhangs need the grid of cells and the hierarchy anyway.
        let is_shared = off.plan.overhangs();
        let is_of_light = |name: &str| LIGHT.contains(&name) && !(is_shared && SHARED.contains(&name));
        let without = off_ms - sum(&off, |name| name == DECISION || is_of_light(name));
        // Light that is computed needs the other stages anyway.
        let is_off = decided.plan.interreflection.is_none();
        let decision = sum(&decided, |name| name == DECISION || is_off && is_of_light(name));
        let samples = [without, decision, sum(&on, is_of_light)];
        all.iter_mut().zip(samples).for_each(|(all, ms)| all.push(ms));
    }
    let [without, decision, light] = all.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    Ok(Times { without, decision, light })
}

/// Milliseconds of the stages that count.
fn sum(outcome: &Outcome, counts: impl Fn(&str) -> bool) -> f64 {
    outcome.times.iter().filter(|(name, _)| counts(name)).map(|(_, ms)| ms).sum()
}
