//! `biscale render`: the object of a scene, shaded.

use crate::base::{Cancel, Error};
use crate::diagnostics::Health;
use crate::effective::EffectiveBrdf;
use crate::gpu::{Gpu, GpuError, GpuRenderer, Tier};
use crate::pipeline::{Outcome, Pipeline, ShadingBrdf};
use crate::plan::Backend;
use crate::render::image::render::RenderTimes;
use crate::render::image::shading::Background;
use crate::render::image::tone_map::ToneMap;
use crate::render::render;
use crate::render::{RenderScene, Rendered};
use anyhow::Result;
use serde::Serialize;

use super::RenderArgs;
use super::{cache, print_json};

/// Where pictures are made.
pub enum RenderPath {
    /// `refused`: why the graphics processor, which is there, does not.
    Cpu {
        refused: Option<GpuError>,
    },
    Gpu(Box<OnDevice>),
}

/// A device and what it holds of the scene.
pub struct OnDevice {
    gpu: Gpu,
    renderer: GpuRenderer,
    reads: ShadingBrdf,
    /// What a screen would show, and its size.
    image: Option<([usize; 2], wgpu::TextureView)>,
    /// Whether the person asked for it.
    required: bool,
}

impl RenderPath {
    /// The route that the scene's back end asks for: `gpu` any adapter or an error that says why not, `cpu` none, `auto` a
    /// graphics processor that is more than the CPU in disguise, where it can shade this BRDF.
    pub fn of(stage: &RenderScene, outcome: &Outcome) -> Result<Self> {
        let required = outcome.settings.backend == Backend::Gpu;
        let Some(gpu) = Self::device(outcome)? else { return Ok(RenderPath::Cpu { refused: None }) };
        let renderer = |brdf: &EffectiveBrdf| GpuRenderer::wearing(&gpu, &stage.mesh, stage.occluder.as_ref(), brdf);
        let table = outcome.shading_brdf(&Cancel::default())?;
        let made = match renderer(&table.brdf) {
            Err(GpuError::Unsupported(_)) => {
                let sums = ShadingBrdf { brdf: outcome.brdf.clone(), errors: None, ..table };
                renderer(&sums.brdf).map(|renderer| (renderer, sums))
            }
            made => made.map(|renderer| (renderer, table)),
        };
        match made {
            Ok((renderer, reads)) => {
                Ok(RenderPath::Gpu(Box::new(OnDevice { gpu, renderer, reads, image: None, required })))
            }
            Err(error) if required => Err(Error::from(error).into()),
            Err(error) => Ok(RenderPath::Cpu { refused: Some(error) }),
        }
    }

    /// The device that the scene's back end asks for, if it is there.
    pub fn device(outcome: &Outcome) -> Result<Option<Gpu>> {
        let backend = outcome.settings.backend;
        if backend == Backend::Cpu {
            return Ok(None);
        }
        match Gpu::open() {
            Ok(gpu) if backend == Backend::Gpu || gpu.tier == Tier::Hardware => Ok(Some(gpu)),
            Err(error) if backend == Backend::Gpu => Err(Error::from(error).into()),
            _ => Ok(None),
        }
    }

    /// The stage's object in a material.
    pub fn render(
        &mut self,
        stage: &RenderScene,
        brdf: &EffectiveBrdf,
        size: [usize; 2],
        samples_per_side: usize,
    ) -> Result<Rendered> {
        let background = Background::default();
        let input = stage.input(brdf, size, samples_per_side, &background);
        Ok(match self {
            Self::Cpu { .. } => render(&input)?,
            Self::Gpu(device) => match device.renderer.render(&device.gpu, &input, &Cancel::default()) {
                // What the device fails at the CPU still does, unless the device was asked for.
                Err(Error::Failed(_) | Error::Device(_)) if !device.required => render(&input)?,
                rendered => rendered?,
            },
        })
    }

    /// As [`RenderPath::render`], as far as a screen needs it: a picture on the device stays there.
    pub fn show(&mut self, stage: &RenderScene, brdf: &EffectiveBrdf, size: [usize; 2]) -> Result<RenderTimes> {
        let Self::Gpu(device) = self else { return Ok(self.render(stage, brdf, size, 1)?.times) };
        let OnDevice { gpu, renderer, image, .. } = &mut **device;
        let image = match image {
            Some((of, view)) if *of == size => view,
            none => {
                let view =
                    crate::gpu::render::image::image(gpu, size).map_err(Error::from)?.create_view(&Default::default());
                &none.insert((size, view)).1
            }
        };
        let background = Background::default();
        let input = stage.input(brdf, size, 1, &background);
        Ok(renderer.show(gpu, &input, &ToneMap::new(&stage.camera)?, image, &Cancel::default())?)
    }

    /// The form of a material that this route reads: a table where it is close enough, else the sums.
    pub fn reads(&self, outcome: &Outcome) -> Result<ShadingBrdf> {
        Ok(match self {
            Self::Cpu { .. } => outcome.shading_brdf(&Cancel::default())?,
            Self::Gpu(device) => device.reads.clone(),
        })
    }

    /// `cpu`, or the adapter.
    pub fn describe(&self) -> String {
        match self {
            Self::Cpu { .. } => "cpu".to_owned(),
            Self::Gpu(device) => device.gpu.description(),
        }
    }
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(rename = "picture")]
    image: String,
    width: usize,
    height: usize,
    lights: usize,
    points: usize,
    /// Where it was shaded: `cpu`, or the adapter.
    device: String,
    /// The form of the effective BRDF that was read.
    reads: String,
    stages: serde_json::Map<String, serde_json::Value>,
    health: &'a Health,
}

pub fn run(args: &RenderArgs) -> Result<()> {
    let loaded = args.scene.open()?;
    let stage = RenderScene::new(&loaded)?;
    let tone_map = ToneMap::new(&stage.camera)?;
    let cache = args.keeping.open();
    let mut pipeline = Pipeline::new();
    pipeline.set_cache(cache.clone());
    let outcome = pipeline.effective(&loaded)?;
    if !args.scene.quiet {
        for warning in stage.mesh.warnings.iter().chain(&stage.lights.warnings) {
            eprintln!("note: {warning}");
        }
    }
    args.scene.notes(&outcome);
    let mut route = RenderPath::of(&stage, &outcome)?;
    if let (RenderPath::Cpu { refused: Some(error) }, false) = (&route, args.scene.quiet) {
        eprintln!("note: shaded on the CPU: {error}");
    }
    let shading_brdf = route.reads(&outcome)?;
    let rendered = route.render(&stage, &shading_brdf.brdf, args.size, usize::from(args.samples))?;
    rendered.image.write(&args.output, &tone_map)?;
    cache::finish(&cache, args.scene.quiet);
    if args.scene.json {
        let times = rendered.times;
        let large = [
            (if shading_brdf.was_kept { "cached_picture_table" } else { "picture_table" }, shading_brdf.ms),
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
            lights: stage.lights.directional.len(),
            points: rendered.points,
            device: route.describe(),
            reads: shading_brdf.brdf.form.describe(),
            stages,
            health: outcome.health(),
        });
    }
    Ok(())
}
