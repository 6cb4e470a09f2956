//! What each effect of the plan costs and changes, measured on the scene: on, off, and the picture between.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::Studio;
use crate::accuracy::{compare, mirror_biased_pairs};
use crate::cancel::Cancel;
use crate::error::Result;
use crate::large_scale::Picture;
use crate::pipeline::Pipeline;
use crate::scene::{Effects, LoadedScene, Switch};

/// An effect forced on and off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectCost {
    pub name: &'static str,
    /// From a geometry edit to `f̄`, and a small picture [ms].
    pub on_ms: f64,
    pub off_ms: f64,
    /// As the plan has it, between the two runs of the others: the noise of the clock shows.
    pub auto_ms: f64,
    /// Relative L2 of `f̄` that it changes.
    pub rel_l2: f64,
    /// CIE ΔE of the picture that it changes: mean, and the 95th of a hundred pixels.
    pub mean_delta_e: f64,
    pub high_delta_e: f64,
}

/// The switches of a scene, by name.
pub fn switches(effects: &mut Effects) -> [(&'static str, &mut Switch); 10] {
    [
        ("visibility", &mut effects.visibility),
        ("picture_table", &mut effects.picture_table),
        ("exact_lobes", &mut effects.exact_lobes),
        ("color_weights", &mut effects.color_weights),
        ("material_groups", &mut effects.material_groups),
        ("black_materials", &mut effects.black_materials),
        ("interreflection", &mut effects.interreflection),
        ("mirror_symmetry", &mut effects.mirror_symmetry),
        ("self_shadow", &mut effects.self_shadow),
        ("faint_lights", &mut effects.faint_lights),
    ]
}

struct Run {
    ms: f64,
    f_bar: Vec<Vec3>,
    picture: Picture,
    studio: Studio,
}

/// Times are medians of this many.
const RUNS: u64 = 3;
const PAIRS: usize = 128;

/// Measures every switch; `progress` hears its name.
///
/// # Errors
/// As [`Pipeline::effective`], and an object or environment that cannot be used.
pub fn measure_effects(
    loaded: &LoadedScene,
    cancel: &Cancel,
    mut progress: impl FnMut(&str),
) -> Result<Vec<EffectCost>> {
    let mut all = Vec::new();
    for k in 0..switches(&mut Effects::default()).len() {
        let forced = |switch: Switch| {
            let mut scene = loaded.clone();
            let name = {
                let mut list = switches(&mut scene.scene.effects);
                let (name, place) = &mut list[k];
                **place = switch;
                *name
            };
            (name, scene)
        };
        let (name, on) = forced(Switch::On);
        progress(name);
        let on = run(&on, cancel)?;
        let auto = run(&forced(Switch::Auto).1, cancel)?;
        let off = run(&forced(Switch::Off).1, cancel)?;
        let mut delta_e = on.studio.difference(&on.picture, &off.picture);
        delta_e.sort_by(f32::total_cmp);
        all.push(EffectCost {
            name,
            on_ms: on.ms,
            off_ms: off.ms,
            auto_ms: auto.ms,
            rel_l2: compare(&off.f_bar, &on.f_bar).rel_l2,
            mean_delta_e: f64::from(delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32),
            high_delta_e: f64::from(delta_e.get(delta_e.len() * 95 / 100).copied().unwrap_or(0.0)),
        });
    }
    Ok(all)
}

fn run(loaded: &LoadedScene, cancel: &Cancel) -> Result<Run> {
    let studio = Studio::new(loaded)?;
    let pairs = mirror_biased_pairs(PAIRS, 20_110_801);
    let (mut pipeline, mut scene) = (Pipeline::new(), loaded.clone());
    pipeline.cancel_with(cancel.clone());
    let mut outcome = pipeline.effective(&scene)?;
    let mut picture = studio.picture(&outcome.for_pictures(cancel)?.brdf)?;
    let mut times = Vec::new();
    for run in (0..RUNS).rev() {
        // Other facets each time: all that an edit of the geometry asks for. The last are the scene's own.
        scene.scene.quality.seed = loaded.scene.quality.seed ^ run;
        let start = Instant::now();
        outcome = pipeline.effective(&scene)?;
        picture = studio.picture(&outcome.for_pictures(cancel)?.brdf)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let f_bar = pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    Ok(Run { ms: times[times.len() / 2], f_bar, picture, studio })
}
