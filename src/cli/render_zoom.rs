//! `biscale render --zoom` writes the frames of a zoom towards the object, from far away to the tile itself.

use std::fmt::Write as _;
use std::sync::Arc;

use anyhow::Result;
use glam::DVec3;

use super::render_path::RenderPath;
use super::watch::Watch;
use super::{RenderArgs, cache, check_outputs};
use crate::base::{Cancel, Error, InputError, print_on_stderr, replace_file};
use crate::brdf::MaterialAssignment;
use crate::pipeline::Pipeline;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::tile_view::filtered::{Corrections, FilteredTile, ZoomTarget};
use crate::render::tile_view::{ShadedMaterials, TileScene};
use crate::render::{Image, RenderInput, RenderScene};
use crate::scene::LoadedScene;

/// Largest number of frames.
const MOST_FRAMES: usize = 10_000;

/// A zoom: pixels per tile of the first and the last frame, and the number of frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zoom {
    from: f64,
    to: f64,
    frames: usize,
}

/// Parses `FROM:TO:FRAMES`.
pub fn parse(text: &str) -> std::result::Result<Zoom, String> {
    let invalid = || {
        format!(
            "found `{text}`, expected FROM:TO:FRAMES like 0.5:64:57, with pixels per tile above 0 and 1 to {MOST_FRAMES} frames"
        )
    };
    let parts: Vec<&str> = text.split(':').collect();
    let [from, to, frames] = parts[..] else { return Err(invalid()) };
    let pixels = |text: &str| text.trim().parse::<f64>().ok().filter(|n| n.is_finite() && *n > 0.0).ok_or_else(invalid);
    let count = frames.trim().parse::<usize>().ok().filter(|n| (1..=MOST_FRAMES).contains(n));
    Ok(Zoom { from: pixels(from)?, to: pixels(to)?, frames: count.ok_or_else(invalid)? })
}

impl Zoom {
    /// Pixels per tile of a frame: a geometric sequence.
    fn pixels_per_tile(&self, frame: usize) -> f64 {
        let part = frame as f64 / (self.frames - 1).max(1) as f64;
        self.from * (self.to / self.from).powf(part)
    }
}

/// The tile of a scene with a colour map.
pub struct MappedTile {
    tile: TileScene,
    materials: MaterialAssignment,
}

impl MappedTile {
    /// `None` if the scene has no colour map: pixels then have `f̄` at every distance.
    ///
    /// # Errors
    /// The errors of the pipeline.
    pub fn of(pipeline: &Pipeline, loaded: &LoadedScene) -> Result<Option<Self>> {
        if loaded.scene.color_map.is_none() {
            return Ok(None);
        }
        let tile = TileScene::new(Arc::new(pipeline.mesh(loaded)?));
        let materials = pipeline.materials(loaded)?;
        Ok(tile.filtered().is_some().then_some(Self { tile, materials }))
    }

    fn filtered(&self) -> Option<&FilteredTile> {
        self.tile.filtered()
    }

    fn materials(&self) -> ShadedMaterials<'_> {
        ShadedMaterials { material_of_slot: &self.materials.material_of_slot, materials: &self.materials.materials }
    }

    /// Replaces `f̄` in an image by what each pixel holds.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn shade_into(&self, image: &mut Image, input: &RenderInput<'_>, cancel: &Cancel) -> Result<()> {
        if let Some(filtered) = self.filtered() {
            filtered.shade_into(image, input, self.materials(), Corrections::Measured, cancel)?;
        }
        Ok(())
    }
}

/// The error of a scene that cannot be zoomed.
fn no_map() -> Error {
    InputError::new("color_map", "nothing", "a colour map, which `--zoom` shows from far to near").into()
}

pub fn run(args: &RenderArgs, zoom: &Zoom) -> Result<()> {
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let folder = &args.output;
    let (loaded, (mut scene, target)) = args.scene.open(|loaded| {
        if loaded.scene.color_map.is_none() {
            return Err(no_map().into());
        }
        if folder.is_dir() {
            check_outputs(&args.scene.scene, loaded, &[], [folder.join("zoom.csv")])?;
        }
        let scene = RenderScene::with(&pipeline, loaded)?;
        let target = ZoomTarget::new(&scene, args.size)?;
        for frame in [0, zoom.frames - 1] {
            target.camera(zoom.pixels_per_tile(frame))?;
        }
        Ok((scene, target))
    })?;
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let tone_map = ToneMap::new(&scene.camera)?;
    let outcome = pipeline.effective(&loaded)?;
    args.scene.notes(&outcome);
    let Some(mapped) = MappedTile::of(&pipeline, &loaded)? else { return Err(no_map().into()) };
    let Some(tile) = mapped.filtered() else { return Err(no_map().into()) };
    let mut path = RenderPath::of(&scene, &outcome)?;
    let brdf = path.shading_brdf(&outcome, &watch.cancel())?.brdf;
    std::fs::create_dir_all(folder).map_err(|error| {
        InputError::new("output", folder.display(), format!("a folder that can be created ({error})"))
    })?;
    let mut table = "pixels_per_tile,r,g,b,change\n".to_owned();
    let mut before: Option<DVec3> = None;
    for frame in 0..zoom.frames {
        let pixels_per_tile = zoom.pixels_per_tile(frame);
        scene.camera = target.camera(pixels_per_tile)?;
        let mut image = path.render(&scene, &brdf, args.size, usize::from(args.samples))?.image;
        let background = ImageBackground::default();
        let input = scene.input(&*brdf, args.size, usize::from(args.samples), &background);
        mapped.shade_into(&mut image, &input, &watch.cancel())?;
        image.write(&folder.join(format!("{frame:04}.png")), &tone_map)?;
        let mean = target.mean(tile, mapped.materials(), &*brdf, pixels_per_tile, &watch.cancel())?;
        let change = before
            .map_or(0.0, |before| (mean - before).abs().max_element() / before.max_element().max(f64::MIN_POSITIVE));
        before = Some(mean);
        let [r, g, b] = mean.to_array().map(|value| value as f32);
        let _ = writeln!(table, "{},{r},{g},{b},{}", pixels_per_tile as f32, change as f32);
    }
    drop(watch);
    replace_file(&folder.join("zoom.csv"), table.as_bytes())?;
    cache::finish(&cache, args.scene.quiet);
    if !args.scene.quiet {
        print_on_stderr(format_args!("wrote {} frames and zoom.csv to {}", zoom.frames, folder.display()));
    }
    Ok(())
}
