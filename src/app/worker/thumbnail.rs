//! Small pictures of the shipped scenes, one at a time, while nothing else is computed.

use std::sync::Arc;

use crate::base::Result;
use crate::pipeline::Pipeline;
use crate::render::image::tone_map::ToneMap;
use crate::scene;
use crate::scene::Quality;
use eframe::egui::ColorImage;

use super::runner::Desk;
use super::studio::{ImageStudio, Shot, Worn};
use super::tone::color_image;

/// Pixels of a side.
pub const SIDE: usize = 112;
/// Lights that stand for an environment here.
const LIGHTS: usize = 12;

#[derive(Debug, Clone)]
pub struct ThumbnailJob {
    pub name: &'static str,
}

/// `image` is absent where the scene cannot be shown.
pub struct Thumbnail {
    pub name: &'static str,
    pub image: Option<Arc<ColorImage>>,
}

pub fn work(kept: &mut ImageStudio, job: &ThumbnailJob, desk: &Desk<ThumbnailJob>, answer: &dyn Fn(Thumbnail)) {
    let image = render(kept, job.name, desk);
    // What was given up is asked for again.
    if !desk.cancel.is_set() {
        answer(Thumbnail { name: job.name, image: image.ok().map(Arc::new) });
    }
}

fn render(studio: &mut ImageStudio, name: &str, desk: &Desk<ThumbnailJob>) -> Result<ColorImage> {
    let mut loaded = scene::open(name, &[])?;
    loaded.scene.quality =
        Quality { preset: "draft".to_owned(), backend: "cpu".to_owned(), facets: Some(1024), ..Quality::default() };
    loaded.scene.light.count = loaded.scene.light.count.min(LIGHTS);
    let mut pipeline = Pipeline::new();
    pipeline.cancel_with(desk.cancel.clone());
    let outcome = pipeline.effective(&loaded)?;
    studio.prepare(&loaded)?;
    let camera = loaded.scene.camera.clone().unwrap_or_default();
    let shot = Shot {
        camera: &camera,
        material: Worn::Known(&outcome),
        size: [SIDE, SIDE],
        samples_per_side: 2,
        settle: false,
        backend: "cpu",
    };
    let (rendered, _) = studio.shoot(&shot, None, desk.cancel)?;
    Ok(color_image(&rendered.image, &ToneMap::new(&camera)?))
}
