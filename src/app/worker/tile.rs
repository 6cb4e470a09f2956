//! Pictures of the tile, coarse first where fine ones take long.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Error, Result};
use crate::geometry::Facets;
use crate::pipeline::Pipeline;
use crate::render::DirectionalLight;
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::render::lighting::lights;
use crate::render::tile_view::{CloseUp, Look, ShadedMaterials, TileView};
use crate::scene::{Light, LoadedScene, Painted, Tile};
use eframe::egui::ColorImage;
use glam::Vec3;

use super::runner::Desk;
use super::tone::color_image;

/// Facets that the overlay shows.
const FACETS: usize = 1500;
/// Lights that stand for the environment over a tile: each costs a ray a pixel.
const LIGHTS: usize = 8;
/// A first picture should be there after this many milliseconds.
const DRAFT_MS: f64 = 50.0;

/// How the tile is to be shown.
#[derive(Debug, Clone, PartialEq)]
pub enum Show {
    Clay,
    Materials,
    Normals,
    /// What facets add to f̄ of a light and a viewer; the last is bright.
    Contribution(Vec3, Vec3, f32),
    /// Which facets see this direction.
    Visibility(Vec3),
}

/// A picture to make.
#[derive(Debug, Clone)]
pub struct TileJob {
    pub loaded: Arc<LoadedScene>,
    pub view: TileView,
    pub show: Show,
    pub facets: bool,
}

/// A picture of the tile and what the interface asks of the tile itself.
#[derive(Debug, Clone)]
pub struct TileMade {
    pub image: Arc<ColorImage>,
    pub tile: Arc<CloseUp>,
    pub facets: Option<Arc<Facets>>,
}

pub enum TileAnswer {
    Made(Box<TileMade>),
    Failed(String),
}

type Key = (Tile, std::path::PathBuf, Painted);

/// What stays between pictures.
#[derive(Default)]
pub struct Macro {
    pipeline: Pipeline,
    tile: Option<(Key, Arc<CloseUp>)>,
    facets: Option<(Key, Arc<Facets>)>,
    lights: Option<((Light, std::path::PathBuf), Vec<DirectionalLight>)>,
    /// Milliseconds a pixel.
    cost: f64,
}

impl Macro {
    pub fn work(&mut self, job: TileJob, desk: &Desk<TileJob>, answer: &dyn Fn(TileAnswer)) {
        match self.steps(&job, desk, answer) {
            Ok(()) | Err(Error::Cancelled) => {}
            Err(error) => answer(TileAnswer::Failed(error.to_string())),
        }
    }

    fn steps(&mut self, job: &TileJob, desk: &Desk<TileJob>, answer: &dyn Fn(TileAnswer)) -> Result<()> {
        let tile = self.tile(&job.loaded)?;
        let (material_of_slot, materials) = self.pipeline.sum_materials(&job.loaded)?;
        let wearing = ShadedMaterials { material_of_slot: &material_of_slot, materials: &materials };
        let facets = if job.facets { Some(self.facets(job, &tile)) } else { None };
        let (look, tone_map) = self.look(job)?;
        let pixels = (job.view.size[0] * job.view.size[1]) as f64;
        let part = if self.cost * pixels > 6.0 * DRAFT_MS { 4 } else { 2 };
        let coarse = TileView { size: job.view.size.map(|side| side.div_ceil(part).max(16)), ..job.view };
        let passes = if self.cost * pixels > DRAFT_MS { vec![coarse, job.view] } else { vec![job.view] };
        for (at, view) in passes.iter().enumerate() {
            let start = Instant::now();
            // The first pass is never given up: the picture follows the hand.
            let never = crate::base::Cancel::default();
            let cancel = if at == 0 { &never } else { desk.cancel };
            let image = tile.image(view, &look, wearing, Vec3::splat(0.02), cancel)?;
            let ms = start.elapsed().as_secs_f64() * 1e3;
            self.cost = ms / (view.size[0] * view.size[1]) as f64;
            let image = Arc::new(color_image(&image, &tone_map));
            let (tile, facets) = (tile.clone(), facets.clone());
            answer(TileAnswer::Made(Box::new(TileMade { image, tile, facets })));
        }
        Ok(())
    }

    fn tile(&mut self, loaded: &LoadedScene) -> Result<Arc<CloseUp>> {
        let key = (loaded.scene.tile.clone(), loaded.base_dir.clone(), loaded.painted.clone());
        if let Some((last, tile)) = &self.tile
            && *last == key
        {
            return Ok(tile.clone());
        }
        let tile = Arc::new(CloseUp::new(Arc::new(self.pipeline.mesh(loaded)?)));
        self.tile = Some((key, tile.clone()));
        Ok(tile)
    }

    fn facets(&mut self, job: &TileJob, tile: &CloseUp) -> Arc<Facets> {
        let key = (job.loaded.scene.tile.clone(), job.loaded.base_dir.clone(), job.loaded.painted.clone());
        if let Some((last, facets)) = &self.facets
            && *last == key
        {
            return facets.clone();
        }
        let facets = Arc::new(Facets::sample(&tile.mesh, FACETS, job.loaded.scene.quality.seed));
        self.facets = Some((key, facets.clone()));
        facets
    }

    fn look(&mut self, job: &TileJob) -> Result<(Look, ToneMap)> {
        let plain = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };
        Ok(match &job.show {
            Show::Clay => (Look::Clay, plain),
            Show::Contribution(i, o, scale) => (Look::Contribution { i: *i, o: *o, scale: *scale }, plain),
            Show::Normals => (Look::Normals, plain),
            Show::Visibility(to) => (Look::Visibility(*to), plain),
            Show::Materials => {
                let camera = job.loaded.scene.camera.clone().unwrap_or_default();
                (Look::Materials(self.lights(&job.loaded)?), ToneMap::new(&camera)?)
            }
        })
    }

    /// The scene's light on a tile that lies flat: world y is up, the tile's z.
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
