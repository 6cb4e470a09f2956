//! `biscale render`: the object of a scene, shaded.

use anyhow::Result;
use biscale::filtering::Reflectance;
use biscale::large_scale::lights::{self, Lights};
use biscale::large_scale::shading::Background;
use biscale::large_scale::shadow::Occluder;
use biscale::large_scale::tone_map::ToneMap;
use biscale::large_scale::{ObjectMesh, RenderInput, Rendered, objects, render};
use biscale::pipeline::Pipeline;
use biscale::scene::{Camera, LoadedScene};
use serde::Serialize;

use super::print_json;
use crate::RenderArgs;

/// What stays while the camera turns.
pub struct Stage {
    pub mesh: ObjectMesh,
    pub occluder: Option<Occluder>,
    pub lights: Lights,
    pub camera: Camera,
}

impl Stage {
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        let mesh = objects::build(&loaded.scene.object, &loaded.base_dir)?;
        let lights = lights::build(&loaded.scene.light, &loaded.base_dir)?;
        let occluder = if lights.directional.is_empty() { None } else { Occluder::of(&mesh) };
        Ok(Self { mesh, occluder, lights, camera: loaded.scene.camera.clone().unwrap_or_default() })
    }

    pub fn render(&self, reflectance: &dyn Reflectance, size: [usize; 2], samples_per_side: usize) -> Result<Rendered> {
        Ok(render(&RenderInput {
            mesh: &self.mesh,
            occluder: self.occluder.as_ref(),
            shadow_cache: None,
            lights: &self.lights.directional,
            camera: &self.camera,
            reflectance,
            size,
            samples_per_side,
            background: &Background::default(),
        })?)
    }
}

#[derive(Serialize)]
struct Report {
    picture: String,
    width: usize,
    height: usize,
    lights: usize,
    points: usize,
    stages: serde_json::Map<String, serde_json::Value>,
}

pub fn run(args: &RenderArgs) -> Result<()> {
    let loaded = args.scene.open()?;
    let stage = Stage::new(&loaded)?;
    let tone_map = ToneMap::new(&stage.camera)?;
    let outcome = Pipeline::new().effective(&loaded)?;
    if !args.scene.quiet {
        for warning in stage.mesh.warnings.iter().chain(&stage.lights.warnings) {
            eprintln!("note: {warning}");
        }
    }
    args.scene.notes(&outcome);
    let rendered = stage.render(outcome.brdf.as_ref(), args.size, usize::from(args.samples))?;
    rendered.picture.write(&args.output, &tone_map)?;
    if args.scene.json {
        let times = rendered.times;
        let large = [("g_buffer", times.gbuffer_ms), ("shadows", times.shadows_ms), ("shading", times.shading_ms)];
        let stages = outcome.times.iter().copied().chain(large).map(|(name, ms)| (name.to_owned(), ms.into())).collect();
        return print_json(&Report {
            picture: args.output.display().to_string(),
            width: args.size[0],
            height: args.size[1],
            lights: stage.lights.directional.len(),
            points: rendered.points,
            stages,
        });
    }
    Ok(())
}
