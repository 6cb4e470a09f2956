//! `biscale render` writes an image of the scene's object.

use anyhow::Result;
use serde::Serialize;

use super::render_path::RenderPath;
use super::render_zoom::MappedTile;
use super::watch::Watch;
use super::{RenderArgs, cache, check_outputs, print_json, render_zoom};
use crate::base::print_on_stderr;
use crate::diagnostics::Health;
use crate::effective::{ErrorEstimate, ErrorEstimator};
use crate::pipeline::Pipeline;
use crate::render::RenderScene;
use crate::render::image::pixels::ImageFormat;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::scene::LoadedScene;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(rename = "picture")]
    image: String,
    width: usize,
    height: usize,
    lights: usize,
    points: usize,
    /// Processor that shaded: `cpu`, or the name of the adapter.
    device: String,
    /// Representation of the effective BRDF that was read.
    reads: String,
    stages: serde_json::Map<String, serde_json::Value>,
    /// Estimated error of the effective BRDF, without that of the representation that was read.
    error: Option<ErrorEstimate>,
    health: &'a Health,
}

pub fn run(args: &RenderArgs) -> Result<()> {
    if let Some(zoom) = &args.zoom {
        return render_zoom::run(args, zoom);
    }
    ImageFormat::of(&args.output)?;
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let (loaded, render_scene) = args.scene.open(|loaded| {
        check_outputs(&args.scene.scene, loaded, &[], [&args.output])?;
        let render_scene = RenderScene::with(&pipeline, loaded)?;
        if loaded.scene.slab.is_some() {
            // A background that cannot be used is reported before the slab is computed.
            SlabScene::backdrop(&pipeline, loaded, &render_scene)?;
        }
        Ok(render_scene)
    })?;
    if loaded.scene.slab.is_some() {
        return of_slab(args, &mut pipeline, &loaded, &render_scene);
    }
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let tone_map = ToneMap::new(&render_scene.camera)?;
    let outcome = pipeline.effective(&loaded)?;
    drop(watch);
    if !args.scene.quiet {
        for warning in render_scene.warnings() {
            print_on_stderr(format_args!("note: {warning}"));
        }
    }
    args.scene.notes(&outcome);
    let mut path = RenderPath::of(&render_scene, &outcome)?;
    if let (RenderPath::Cpu { refused: Some(error) }, false) = (&path, args.scene.quiet) {
        print_on_stderr(format_args!("note: shaded on the CPU: {error}"));
    }
    let watch = Watch::new(args.scene.quiet);
    let shading_brdf = path.shading_brdf(&outcome, &watch.cancel())?;
    drop(watch);
    let mut rendered = path.render(&render_scene, &shading_brdf.brdf, args.size, usize::from(args.samples))?;
    if let Some(tile) = MappedTile::of(&pipeline, &loaded)? {
        let start = std::time::Instant::now();
        let watch = Watch::new(args.scene.quiet);
        let background = ImageBackground::default();
        let input = render_scene.input(&*shading_brdf.brdf, args.size, usize::from(args.samples), &background);
        tile.shade_into(&mut rendered.image, &input, &watch.cancel())?;
        rendered.times.shading_ms += start.elapsed().as_secs_f64() * 1e3;
    }
    rendered.image.write(&args.output, &tone_map)?;
    cache::finish(&cache, args.scene.quiet);
    if args.scene.json {
        let times = rendered.times;
        let large = [
            (if shading_brdf.was_cached { "cached_picture_table" } else { "picture_table" }, shading_brdf.ms),
            ("g_buffer", times.gbuffer_ms),
            ("shadows", times.shadows_ms),
            ("shading", times.shading_ms),
        ];
        let stages =
            outcome.times.iter().copied().chain(large).map(|(name, ms)| (name.to_owned(), ms.into())).collect();
        return print_json(&Report {
            image: args.output.display().to_string(),
            width: args.size[0],
            height: args.size[1],
            lights: render_scene.lights().directional.len(),
            points: rendered.points,
            device: path.describe(),
            reads: shading_brdf.brdf.representation.describe(),
            stages,
            error: outcome.errors().map(ErrorEstimator::estimate),
            health: outcome.health(),
        });
    }
    Ok(())
}

/// Renders the object of a scene with a slab.
fn of_slab(args: &RenderArgs, pipeline: &mut Pipeline, loaded: &LoadedScene, render_scene: &RenderScene) -> Result<()> {
    let tone_map = ToneMap::new(&render_scene.camera)?;
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let mut outcome = pipeline.slab(loaded)?;
    let scene = SlabScene::with(pipeline, loaded, &outcome, render_scene)?;
    outcome.health.warnings.extend(scene.warnings(render_scene)?);
    let rendered = scene.render(render_scene, args.size, usize::from(args.samples), &watch.cancel())?;
    drop(watch);
    args.scene.warn(&outcome.health);
    rendered.image.write(&args.output, &tone_map)?;
    if args.scene.json {
        let times = rendered.times;
        let large = [("g_buffer", times.gbuffer_ms), ("shading", times.shading_ms)];
        let stages = outcome
            .times
            .iter()
            .chain(&scene.times)
            .copied()
            .chain(large)
            .map(|(name, ms)| (name.to_owned(), ms.into()));
        return print_json(&Report {
            image: args.output.display().to_string(),
            width: args.size[0],
            height: args.size[1],
            lights: render_scene.lights().directional.len(),
            points: rendered.points,
            device: "cpu".to_owned(),
            reads: scene.describe(),
            stages: stages.collect(),
            error: None,
            health: &outcome.health,
        });
    }
    Ok(())
}
