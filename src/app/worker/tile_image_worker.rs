//! Images of the tile. If a fine image takes long, a coarse one comes first.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Error, Result};
use crate::brdf::MaterialAssignment;
use crate::geometry::Facets;
use crate::pipeline::Pipeline;
use crate::render::DirectionalLight;
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::render::lighting::lights;
use crate::render::tile_view::{ShadedMaterials, TileScene, TileShading, TileView};
use crate::scene::{ColorMap, Light, LoadedScene, Painted, Tile};
use eframe::egui::ColorImage;
use glam::Vec3;

use super::runner::JobContext;
use super::section::Section;
use super::tone::color_image;

/// Azimuth and elevation from which a tile is seen at first [degrees]. Nearly along y, the bottoms of deep grooves are
/// visible.
pub const TILE_AZIMUTH_DEG: f32 = -74.0;
pub const TILE_ELEVATION_DEG: f32 = 35.0;
/// Number of facets in the overlay.
const FACETS: usize = 1500;
/// Maximum number of directional lights that replace the environment; each costs one ray per pixel.
const LIGHTS: usize = 8;
/// Time limit for the first image [ms].
const DRAFT_MS: f64 = 50.0;

/// Shading of the tile view.
#[derive(Debug, Clone, PartialEq)]
pub enum TileDisplay {
    Clay,
    Materials,
    Normals,
    /// Contribution of each facet to f̄ for a light and a view direction; the last value is displayed as white.
    Contribution(Vec3, Vec3, f32),
    /// Visibility of each facet along this direction.
    Visibility(Vec3),
}

/// A tile image to render.
#[derive(Debug, Clone)]
pub struct TileJob {
    pub loaded: Arc<LoadedScene>,
    pub view: TileView,
    pub show: TileDisplay,
    pub facets: bool,
}

/// An image of the tile, with the tile and facets that the interface reads.
#[derive(Debug, Clone)]
pub struct RenderedTile {
    pub image: Arc<ColorImage>,
    pub tile: Arc<TileScene>,
    pub section: Arc<Section>,
    pub facets: Option<Arc<Facets>>,
}

pub enum TileResult {
    Rendered(Box<RenderedTile>),
    Failed(String),
}

type Key = (Tile, Option<ColorMap>, std::path::PathBuf, Painted);

/// The inputs of the tile and of its colours.
fn key(loaded: &LoadedScene) -> Key {
    let scene = &loaded.scene;
    (scene.tile.clone(), scene.color_map.clone(), loaded.base_dir.clone(), loaded.painted.clone())
}

/// The worker's state, which caches the inputs of the next image.
#[derive(Default)]
pub struct TileImageWorker {
    pipeline: Pipeline,
    tile: Option<(Key, Arc<TileScene>, Arc<Section>)>,
    facets: Option<(Key, Arc<Facets>)>,
    lights: Option<((Light, std::path::PathBuf), Vec<DirectionalLight>)>,
    /// Milliseconds per pixel.
    cost: f64,
}

impl TileImageWorker {
    pub fn work(&mut self, job: TileJob, context: &JobContext<TileJob>, report: &dyn Fn(TileResult)) {
        match self.steps(&job, context, report) {
            Ok(()) | Err(Error::Cancelled) => {}
            Err(error) => report(TileResult::Failed(error.to_string())),
        }
    }

    fn steps(&mut self, job: &TileJob, context: &JobContext<TileJob>, report: &dyn Fn(TileResult)) -> Result<()> {
        let (tile, section) = self.tile(&job.loaded)?;
        let MaterialAssignment { material_of_slot, materials } = self.pipeline.materials(&job.loaded)?;
        let shaded_materials = ShadedMaterials { material_of_slot: &material_of_slot, materials: &materials };
        let facets = if job.facets { Some(self.facets(job, &tile)) } else { None };
        let (look, tone_map) = self.look(job)?;
        let pixels = (job.view.size[0] * job.view.size[1]) as f64;
        let part = if self.cost * pixels > 6.0 * DRAFT_MS { 4 } else { 2 };
        let coarse = TileView { size: job.view.size.map(|side| side.div_ceil(part).max(16)), ..job.view };
        let passes = if self.cost * pixels > DRAFT_MS { vec![coarse, job.view] } else { vec![job.view] };
        for (at, view) in passes.iter().enumerate() {
            let start = Instant::now();
            // The first pass is never cancelled, so that the image follows the pointer.
            let never = crate::base::Cancel::default();
            let cancel = if at == 0 { &never } else { context.cancel };
            let image = tile.image(view, &look, shaded_materials, Vec3::splat(0.02), cancel)?;
            let ms = start.elapsed().as_secs_f64() * 1e3;
            self.cost = ms / (view.size[0] * view.size[1]) as f64;
            let image = Arc::new(color_image(&image, &tone_map));
            let (tile, section, facets) = (tile.clone(), section.clone(), facets.clone());
            report(TileResult::Rendered(Box::new(RenderedTile { image, tile, section, facets })));
        }
        Ok(())
    }

    fn tile(&mut self, loaded: &LoadedScene) -> Result<(Arc<TileScene>, Arc<Section>)> {
        let key = key(loaded);
        if let Some((last, tile, section)) = &self.tile
            && *last == key
        {
            return Ok((tile.clone(), section.clone()));
        }
        let tile = Arc::new(TileScene::new(Arc::new(self.pipeline.mesh(loaded)?)));
        let section = Arc::new(Section::of(&tile.mesh));
        self.tile = Some((key, tile.clone(), section.clone()));
        Ok((tile, section))
    }

    fn facets(&mut self, job: &TileJob, tile: &TileScene) -> Arc<Facets> {
        let key = key(&job.loaded);
        if let Some((last, facets)) = &self.facets
            && *last == key
        {
            return facets.clone();
        }
        let facets = Arc::new(Facets::sample(&tile.mesh, FACETS, job.loaded.scene.quality.seed));
        self.facets = Some((key, facets.clone()));
        facets
    }

    fn look(&mut self, job: &TileJob) -> Result<(TileShading, ToneMap)> {
        let plain = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };
        Ok(match &job.show {
            TileDisplay::Clay => (TileShading::Clay, plain),
            TileDisplay::Contribution(i, o, scale) => {
                (TileShading::Contribution { i: *i, o: *o, scale: *scale }, plain)
            }
            TileDisplay::Normals => (TileShading::Normals, plain),
            TileDisplay::Visibility(to) => (TileShading::Visibility(*to), plain),
            TileDisplay::Materials => {
                let camera = job.loaded.scene.camera.clone().unwrap_or_default();
                (TileShading::Materials(self.lights(&job.loaded)?), ToneMap::new(&camera)?)
            }
        })
    }

    /// The scene's lights over a tile that lies flat: the world's y axis is the tile's z axis.
    fn lights(&mut self, loaded: &LoadedScene) -> Result<Vec<DirectionalLight>> {
        let key = (loaded.scene.light.clone(), loaded.base_dir.clone());
        if let Some((last, lights)) = &self.lights
            && *last == key
        {
            return Ok(lights.clone());
        }
        let few = Light { count: key.0.count.min(LIGHTS), ..key.0.clone() };
        let world = lights::build(&few, &key.1)?.directional;
        let into_tile = |d: Vec3| Vec3::new(d.x, -d.z, d.y);
        let lights: Vec<_> = world
            .into_iter()
            .map(|light| DirectionalLight { direction: into_tile(light.direction), ..light })
            .filter(|light| light.direction.z > 0.0)
            .collect();
        self.lights = Some((key, lights.clone()));
        Ok(lights)
    }
}
