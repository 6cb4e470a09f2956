//! From an edit to its picture, as the editor goes: on the device in one submission, or on the CPU through a table.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Error};
use crate::effective::Black;
use crate::gpu::{Gpu, GpuError, GpuRenderer, Tier};
use crate::pipeline::{Outcome, Pipeline};
use crate::render::RenderScene;
use crate::render::image::shading::Background;
use crate::render::image::tone_map::ToneMap;
use crate::render::render;
use crate::scene::LoadedScene;
use anyhow::Result;

use super::render::RenderPath;

/// All that lies between an edit and its picture.
pub struct ToImage {
    stage: RenderScene,
    /// With the device, absent where the CPU makes pictures.
    renderer: Option<(Arc<Gpu>, GpuRenderer, wgpu::TextureView)>,
    size: [usize; 2],
    /// What the last picture was made with.
    pub form: String,
}

impl ToImage {
    pub fn new(loaded: &LoadedScene, outcome: &Outcome, size: [usize; 2]) -> Result<Self> {
        let mut stage = RenderScene::new(loaded)?;
        let gpu = RenderPath::device(outcome)?;
        let renderer = match gpu {
            Some(gpu) => {
                let renderer = GpuRenderer::new(&gpu, &stage.mesh, stage.occluder.as_ref()).map_err(Error::from)?;
                let image = crate::gpu::render::image::image(&gpu, size).map_err(Error::from)?;
                let view = image.create_view(&wgpu::TextureViewDescriptor::default());
                Some((Arc::new(gpu), renderer, view))
            }
            None => {
                // What the camera's first picture would make.
                stage.settle();
                None
            }
        };
        Ok(Self { stage, renderer, size, form: String::new() })
    }

    pub fn make(&mut self, pipeline: &mut Pipeline, loaded: &LoadedScene) -> Result<Vec<(&'static str, f64)>> {
        let (cancel, background) = (Cancel::default(), Background::default());
        let Self { stage, renderer, size, form } = self;
        let on_device = match renderer {
            Some((gpu, ..)) if gpu.tier == Tier::Hardware || loaded.scene.quality.backend == "gpu" => {
                pipeline.use_device(gpu.clone());
                pipeline.unseen(loaded)?
            }
            _ => None,
        };
        let (mut times, large) = match (on_device, renderer) {
            (Some(tile), Some((gpu, renderer, view))) => {
                let start = Instant::now();
                renderer.set_tile(gpu, &tile.sum).map_err(Error::from)?;
                let upload = ("upload", start.elapsed().as_secs_f64() * 1e3);
                let input = stage.input(&Black, *size, 1, &background);
                let tone_map = ToneMap::new(&stage.camera)?;
                let large = renderer.show(gpu, &input, &tone_map, view, &cancel)?;
                *form = format!("{} facets, on {}", tile.sum.sum.facet_count(), gpu.description());
                let mut times = tile.times;
                times.extend([upload, ("visibility_and_product", large.product_ms)]);
                (times, large)
            }
            (None, renderer) => {
                let outcome = pipeline.effective(loaded)?;
                let reads = outcome.shading_brdf(&cancel)?;
                *form = reads.brdf.form.describe();
                let input = stage.input(&*reads.brdf, *size, 1, &background);
                let mut times = outcome.times;
                times.push(("picture_table", reads.ms));
                let worn = renderer.as_mut().map(|(gpu, renderer, view)| {
                    let start = Instant::now();
                    renderer.set_brdf(gpu, &reads.brdf).map(|()| (gpu, renderer, view, start.elapsed()))
                });
                let large = match worn {
                    Some(Ok((gpu, renderer, view, upload))) => {
                        times.push(("upload", upload.as_secs_f64() * 1e3));
                        renderer.show(gpu, &input, &ToneMap::new(&stage.camera)?, view, &cancel)?
                    }
                    None | Some(Err(GpuError::Unsupported(_))) => render(&input)?.times,
                    Some(Err(error)) => return Err(Error::from(error).into()),
                };
                (times, large)
            }
            (Some(_), None) => return Err(Error::failed("a tile for a device that is not there").into()),
        };
        times.extend([("g_buffer", large.gbuffer_ms), ("shadows", large.shadows_ms), ("shading", large.shading_ms)]);
        Ok(times)
    }
}
