//! All stages from an edit to its image, as the editor computes it: on the GPU in one submission, or on the CPU with a
//! shading table.

use anyhow::Result;

use crate::base::Cancel;
#[cfg(feature = "gpu")]
use crate::base::Error;
use crate::pipeline::{Outcome, Pipeline, StageTimes};
use crate::render::image::render::RenderTimes;
use crate::render::image::shading::ImageBackground;
use crate::render::{RenderScene, render};
use crate::scene::LoadedScene;

/// Computes the image of an edited scene.
pub struct ToImage {
    scene: RenderScene,
    #[cfg(feature = "gpu")]
    on_gpu: Option<on_gpu::Renderer>,
    size: [usize; 2],
    /// Representation that the last image was rendered with.
    pub representation: String,
}

impl ToImage {
    /// # Errors
    /// The object, its lights, or a GPU that was asked for cannot be used.
    pub fn new(loaded: &LoadedScene, outcome: &Outcome, size: [usize; 2]) -> Result<Self> {
        let mut scene = RenderScene::new(loaded)?;
        #[cfg(feature = "gpu")]
        let on_gpu = on_gpu::Renderer::open(&scene, outcome, size)?;
        #[cfg(feature = "gpu")]
        let on_cpu = on_gpu.is_none();
        #[cfg(not(feature = "gpu"))]
        let on_cpu = {
            super::render_path::refuse_gpu(outcome)?;
            true
        };
        if on_cpu {
            // The object does not change, so its shadows are computed once.
            scene.cache_shadows(&Pipeline::new())?;
        }
        Ok(Self {
            scene,
            #[cfg(feature = "gpu")]
            on_gpu,
            size,
            representation: String::new(),
        })
    }

    /// Computes the image of a scene and returns the milliseconds of the stages that ran.
    ///
    /// # Errors
    /// As [`Pipeline::effective`], or a GPU that fails.
    pub fn run(&mut self, pipeline: &mut Pipeline, loaded: &LoadedScene) -> Result<StageTimes> {
        #[cfg(feature = "gpu")]
        if let Some(renderer) = &mut self.on_gpu {
            let (times, representation) = renderer.run(pipeline, loaded, &self.scene, self.size)?;
            self.representation = representation;
            return Ok(times);
        }
        let outcome = pipeline.effective(loaded)?;
        let shading = outcome.shading_brdf(&Cancel::default())?;
        self.representation = shading.brdf.representation.describe();
        let background = ImageBackground::default();
        let input = self.scene.input(&*shading.brdf, self.size, 1, &background);
        let mut times = outcome.times;
        times.push(("picture_table", shading.ms));
        push_image_times(&mut times, &render(&input)?.times);
        Ok(times)
    }
}

fn push_image_times(times: &mut StageTimes, image: &RenderTimes) {
    times.extend([("g_buffer", image.gbuffer_ms), ("shadows", image.shadows_ms), ("shading", image.shading_ms)]);
}

#[cfg(feature = "gpu")]
mod on_gpu {
    //! Images of edited scenes on a GPU.

    use std::sync::Arc;
    use std::time::Instant;

    use anyhow::Result;

    use super::{Cancel, Error, push_image_times};
    use crate::base::GpuError;
    use crate::cli::render_path;
    use crate::effective::Black;
    use crate::gpu::{Gpu, GpuRenderer, Tier};
    use crate::pipeline::{Outcome, Pipeline, StageTimes};
    use crate::render::image::shading::ImageBackground;
    use crate::render::image::tone_map::ToneMap;
    use crate::render::{RenderScene, render};
    use crate::scene::LoadedScene;

    /// A GPU with the object, and the image that it writes.
    pub struct Renderer {
        gpu: Arc<Gpu>,
        renderer: GpuRenderer,
        view: wgpu::TextureView,
    }

    impl Renderer {
        /// Opens the GPU that the scene's backend asks for; `None` if the CPU is to be used.
        pub fn open(scene: &RenderScene, outcome: &Outcome, size: [usize; 2]) -> Result<Option<Self>> {
            let Some(gpu) = render_path::on_gpu::open(outcome.settings.backend)? else { return Ok(None) };
            let renderer = GpuRenderer::new(&gpu, scene.mesh(), scene.occluder()).map_err(Error::from)?;
            let image = crate::gpu::render::image::image(&gpu, size).map_err(Error::from)?;
            let view = image.create_view(&wgpu::TextureViewDescriptor::default());
            Ok(Some(Self { gpu: Arc::new(gpu), renderer, view }))
        }

        /// Computes the image; returns the milliseconds of the stages and the representation that was rendered.
        pub fn run(
            &mut self,
            pipeline: &mut Pipeline,
            loaded: &LoadedScene,
            scene: &RenderScene,
            size: [usize; 2],
        ) -> Result<(StageTimes, String)> {
            let (cancel, background) = (Cancel::default(), ImageBackground::default());
            let tone_map = ToneMap::new(&scene.camera)?;
            let Self { gpu, renderer, view } = self;
            let computes_tile = gpu.tier == Tier::Hardware || loaded.scene.quality.backend == "gpu";
            let tile = if computes_tile {
                pipeline.set_gpu(gpu.clone());
                pipeline.gpu_tile(loaded)?
            } else {
                None
            };
            if let Some(tile) = tile {
                let start = Instant::now();
                renderer.set_tile(gpu, &tile.input).map_err(Error::from)?;
                let upload = ("upload", start.elapsed().as_secs_f64() * 1e3);
                let input = scene.input(&Black, size, 1, &background);
                let image = renderer.show(gpu, &input, &tone_map, view, &cancel)?;
                let mut times = tile.times;
                times.extend([upload, ("visibility_and_product", image.product_ms)]);
                push_image_times(&mut times, &image);
                return Ok((times, format!("{} facets, on {}", tile.input.sum.facet_count(), gpu.description())));
            }
            let outcome = pipeline.effective(loaded)?;
            let shading = outcome.shading_brdf(&cancel)?;
            let input = scene.input(&*shading.brdf, size, 1, &background);
            let mut times = outcome.times;
            times.push(("picture_table", shading.ms));
            let start = Instant::now();
            let image = match renderer.set_brdf(gpu, &shading.brdf) {
                Ok(()) => {
                    times.push(("upload", start.elapsed().as_secs_f64() * 1e3));
                    renderer.show(gpu, &input, &tone_map, view, &cancel)?
                }
                Err(GpuError::Unsupported(_)) => render(&input)?.times,
                Err(error) => return Err(Error::from(error).into()),
            };
            push_image_times(&mut times, &image);
            Ok((times, shading.brdf.representation.describe()))
        }
    }
}
