//! The processor that renders an image: the CPU, or a GPU.

use anyhow::Result;

use crate::base::{Cancel, GpuError};
use crate::effective::EffectiveBrdf;
use crate::pipeline::{Outcome, ShadingBrdf};
use crate::render::image::render::RenderTimes;
use crate::render::image::shading::ImageBackground;
use crate::render::{RenderScene, Rendered, render};

#[cfg(feature = "gpu")]
use self::on_gpu::OnGpu;

/// The processor that renders an image.
pub enum RenderPath {
    /// `refused`: the reason why the GPU of the machine does not render this scene.
    Cpu { refused: Option<GpuError> },
    #[cfg(feature = "gpu")]
    Gpu(Box<OnGpu>),
}

impl RenderPath {
    /// The processor that the scene's backend asks for. `gpu` is any adapter, or an error that gives the reason; `cpu`
    /// is the CPU; `auto` is a hardware GPU if it can shade this BRDF, else the CPU.
    ///
    /// # Errors
    /// The backend is `gpu` and no adapter can be used.
    pub fn of(scene: &RenderScene, outcome: &Outcome) -> Result<Self> {
        #[cfg(feature = "gpu")]
        return OnGpu::render_path(scene, outcome);
        #[cfg(not(feature = "gpu"))]
        {
            let _ = scene;
            refuse_gpu(outcome)?;
            Ok(Self::Cpu { refused: None })
        }
    }

    /// Renders the object of a scene in one material.
    ///
    /// # Errors
    /// The camera cannot frame the object, or a GPU that was asked for fails.
    pub fn render(
        &mut self,
        scene: &RenderScene,
        brdf: &EffectiveBrdf,
        size: [usize; 2],
        samples_per_side: usize,
    ) -> Result<Rendered> {
        let background = ImageBackground::default();
        let input = scene.input(brdf, size, samples_per_side, &background);
        match self {
            Self::Cpu { .. } => Ok(render(&input)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(on_gpu) => on_gpu.render(&input),
        }
    }

    /// Renders an image for a screen. An image that the GPU renders stays on the GPU.
    ///
    /// # Errors
    /// As [`RenderPath::render`].
    pub fn show(&mut self, scene: &RenderScene, brdf: &EffectiveBrdf, size: [usize; 2]) -> Result<RenderTimes> {
        match self {
            Self::Cpu { .. } => Ok(self.render(scene, brdf, size, 1)?.times),
            #[cfg(feature = "gpu")]
            Self::Gpu(on_gpu) => on_gpu.show(scene, brdf, size),
        }
    }

    /// The representation of a material that this processor reads: a table if it is close enough, else the sums.
    /// `cancel` counts the steps of the table.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn shading_brdf(&self, outcome: &Outcome, cancel: &Cancel) -> Result<ShadingBrdf> {
        match self {
            Self::Cpu { .. } => Ok(outcome.shading_brdf(cancel)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(on_gpu) => Ok(on_gpu.shading_brdf()),
        }
    }

    /// `cpu`, or the name of the adapter.
    pub fn describe(&self) -> String {
        match self {
            Self::Cpu { .. } => "cpu".to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(on_gpu) => on_gpu.gpu.description(),
        }
    }
}

/// Returns an error if the scene asks for the backend `gpu`, which this build does not have.
#[cfg(not(feature = "gpu"))]
pub fn refuse_gpu(outcome: &Outcome) -> Result<()> {
    use crate::base::InputError;
    use crate::plan::Backend;

    if outcome.settings.backend == Backend::Gpu {
        let found = "`gpu`, which this program was built without (feature `gpu`)";
        return Err(crate::base::Error::from(InputError::new("quality.backend", found, "`auto` or `cpu`")).into());
    }
    Ok(())
}

#[cfg(feature = "gpu")]
pub mod on_gpu {
    //! Images of the command line on a GPU.

    use anyhow::Result;

    use super::RenderPath;
    use crate::base::{Cancel, Error, GpuError};
    use crate::effective::EffectiveBrdf;
    use crate::gpu::seen_through::GpuSeenThrough;
    use crate::gpu::{Gpu, GpuRenderer, Tier};
    use crate::pipeline::{Outcome, ShadingBrdf};
    use crate::plan::Backend;
    use crate::render::image::render::RenderTimes;
    use crate::render::image::shading::ImageBackground;
    use crate::render::image::tone_map::ToneMap;
    use crate::render::seen_through::SlabScene;
    use crate::render::{RenderInput, RenderScene, Rendered, render};

    /// A GPU with the object and the shading BRDF of a scene.
    pub struct OnGpu {
        pub gpu: Gpu,
        renderer: GpuRenderer,
        shading_brdf: ShadingBrdf,
        /// Size and texture of the image for a screen.
        image: Option<([usize; 2], wgpu::TextureView)>,
        /// True if the user asked for the GPU.
        required: bool,
    }

    impl OnGpu {
        pub fn render_path(scene: &RenderScene, outcome: &Outcome) -> Result<RenderPath> {
            let required = outcome.settings.backend == Backend::Gpu;
            let backend = outcome.settings.backend;
            let Some(gpu) = open(backend)? else { return Ok(RenderPath::Cpu { refused: None }) };
            let renderer =
                |brdf: &EffectiveBrdf| GpuRenderer::with_material(&gpu, scene.mesh(), scene.occluder(), brdf);
            let table = outcome.shading_brdf(&Cancel::default())?;
            let built = match renderer(&table.brdf) {
                Err(GpuError::Unsupported(_)) => {
                    let sums = ShadingBrdf { brdf: outcome.brdf.clone(), errors: None, ..table };
                    renderer(&sums.brdf).map(|renderer| (renderer, sums))
                }
                built => built.map(|renderer| (renderer, table)),
            };
            match built {
                Ok((renderer, shading_brdf)) => {
                    Ok(RenderPath::Gpu(Box::new(Self { gpu, renderer, shading_brdf, image: None, required })))
                }
                Err(error) if required => Err(Error::from(error).into()),
                Err(error) => Ok(RenderPath::Cpu { refused: Some(error) }),
            }
        }

        pub fn render(&mut self, input: &RenderInput<'_>) -> Result<Rendered> {
            Ok(match self.renderer.render(&self.gpu, input, &Cancel::default()) {
                // If the GPU fails, the CPU renders, unless the GPU was asked for.
                Err(Error::Failed(_) | Error::Gpu(_)) if !self.required => render(input)?,
                rendered => rendered?,
            })
        }

        pub fn show(&mut self, scene: &RenderScene, brdf: &EffectiveBrdf, size: [usize; 2]) -> Result<RenderTimes> {
            let Self { gpu, renderer, image, .. } = self;
            let image = match image {
                Some((of, view)) if *of == size => view,
                none => {
                    let texture = crate::gpu::render::image::image(gpu, size).map_err(Error::from)?;
                    &none.insert((size, texture.create_view(&Default::default()))).1
                }
            };
            let background = ImageBackground::default();
            let input = scene.input(brdf, size, 1, &background);
            Ok(renderer.show(gpu, &input, &ToneMap::new(&scene.camera)?, image, &Cancel::default())?)
        }

        pub fn shading_brdf(&self) -> ShadingBrdf {
            self.shading_brdf.clone()
        }
    }

    /// Draws a draft of what is seen through a slab; `None` if the CPU is to draw it. Also returns the name of the adapter.
    ///
    /// # Errors
    /// The backend is `gpu` and no adapter can be used, or the GPU fails.
    pub fn seen_through(
        backend: Backend,
        scene: &SlabScene,
        render_scene: &RenderScene,
        (size, samples_per_side): ([usize; 2], usize),
    ) -> Result<Option<(Rendered, String)>> {
        // Refined images and captured sheets are drawn by the CPU.
        if scene.draft_lobes().is_none() {
            return Ok(None);
        }
        let Some(gpu) = open(backend)? else { return Ok(None) };
        let drawn = GpuSeenThrough::new(&gpu, scene)
            .map_err(Error::from)
            .and_then(|drawing| drawing.render(&gpu, render_scene, size, samples_per_side));
        match drawn {
            Err(Error::Failed(_) | Error::Gpu(_)) if backend != Backend::Gpu => Ok(None),
            drawn => Ok(Some((drawn?, gpu.description()))),
        }
    }

    /// Opens the GPU that a backend asks for; `None` if the CPU is to be used.
    pub fn open(backend: Backend) -> Result<Option<Gpu>> {
        if backend == Backend::Cpu {
            return Ok(None);
        }
        match Gpu::open() {
            Ok(gpu) if backend == Backend::Gpu || gpu.tier == Tier::Hardware => Ok(Some(gpu)),
            Err(error) if backend == Backend::Gpu => Err(Error::from(error).into()),
            _ => Ok(None),
        }
    }
}
