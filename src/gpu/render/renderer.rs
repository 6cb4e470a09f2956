//! Rendering on the GPU: the twin of [`render`](crate::render::render).
//!
//! G-buffer, points, light rays, shading and tone mapping are one submission. An image for a screen stays on the GPU.
//! Large work is split into several submissions, so that it stays below the timeout of drivers and can be cancelled.

use super::band::{Band, BufferSizes, RenderBuffers, RendererParts};
use super::gbuffer::{GpuCamera, GpuGBuffer, GpuObject};
use super::image;
use super::image::{GpuImages, Output};
use super::light_rays::{GpuLightRays, GpuOccluder};
use super::stages::{Clock, GpuPassKind, Recorder};
use crate::base::{Cancel, Result};
use crate::effective::{EffectiveBrdf, GpuTileInput, GpuVisibilityInput, HeightMarchInput, ShadowMapInput, SliceInput};
use crate::gpu::shading::visibility::GpuVisibility;
use crate::gpu::shading::{GpuLight, GpuMaterial, GpuShading};
use crate::gpu::{Gpu, GpuError, GpuHeightMarch, GpuShadowMaps, GpuSlicer, Tier, shading};
use crate::interreflection::InterreflectionTable;
use crate::render::image::render::{RenderTimes, check_size};
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::render::shadow::Occluder;
use crate::render::{CameraView, Image, ObjectMesh, RenderInput, Rendered};

/// Largest work of one submission on a real GPU, in lobes or table rows. It keeps submissions below the timeout of
/// drivers and bounds the delay of a cancellation.
const MAX_WORK: u64 = 1 << 32;
/// Largest work of one submission on a software adapter, in lobes or table rows.
const SOFTWARE_MAX_WORK: u64 = 1 << 29;

/// Pipelines and buffers that render one object. Camera, lights and BRDF may change.
#[derive(Debug)]
pub struct GpuRenderer {
    object: GpuObject,
    gbuffer: GpuGBuffer,
    /// `None` if the object cannot shadow itself; passes are then compiled without shadows.
    rays: Option<(GpuLightRays, GpuOccluder)>,
    shading: GpuShading,
    /// `None` renders black.
    material: Option<GpuMaterial>,
    /// True if the GPU has computed the inputs of the material.
    is_prepared: bool,
    march: Option<GpuHeightMarch>,
    slicer: Option<GpuSlicer>,
    maps: Option<GpuShadowMaps>,
    images: GpuImages,
    /// Buffers for images like the last one.
    pub(super) buffers: Option<RenderBuffers>,
    /// Largest work of one submission in lobes or table rows.
    pub(super) max_work: u64,
    clock: Option<Clock>,
    /// See [`Recorder::new`].
    pub(super) by_stage: bool,
}

impl GpuRenderer {
    /// Creates a renderer of an object without a material, which is black.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn new(gpu: &Gpu, mesh: &ObjectMesh, occluder: Option<&Occluder>) -> std::result::Result<Self, GpuError> {
        let rays = match occluder {
            Some(occluder) => Some((GpuLightRays::new(gpu)?, GpuOccluder::new(gpu, occluder)?)),
            None => None,
        };
        Ok(Self {
            object: GpuObject::new(gpu, mesh)?,
            gbuffer: GpuGBuffer::new(gpu, rays.is_some())?,
            rays,
            shading: GpuShading::new(gpu)?,
            material: None,
            is_prepared: false,
            march: None,
            slicer: None,
            maps: None,
            images: GpuImages::new(gpu)?,
            buffers: None,
            max_work: if gpu.tier == Tier::Hardware { MAX_WORK } else { SOFTWARE_MAX_WORK },
            clock: Clock::new(gpu)?,
            by_stage: gpu.tier != Tier::Hardware,
        })
    }

    /// Creates a renderer of an object with a material.
    ///
    /// # Errors
    /// Those of [`GpuRenderer::new`] and [`GpuRenderer::set_brdf`].
    pub fn with_material(
        gpu: &Gpu,
        mesh: &ObjectMesh,
        occluder: Option<&Occluder>,
        brdf: &EffectiveBrdf,
    ) -> std::result::Result<Self, GpuError> {
        let mut renderer = Self::new(gpu, mesh, occluder)?;
        renderer.set_brdf(gpu, brdf)?;
        Ok(renderer)
    }

    /// Replaces the BRDF. Compiled pipelines are reused.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for a BRDF that only the CPU evaluates, and errors of the GPU. The material is then
    /// unchanged.
    pub fn set_brdf(&mut self, gpu: &Gpu, brdf: &EffectiveBrdf) -> std::result::Result<(), GpuError> {
        self.material = Some(self.shading.material(gpu, brdf, self.rays.is_some())?);
        self.is_prepared = false;
        Ok(())
    }

    /// Replaces the BRDF by a tile. The GPU computes its visibility and its facet sum with the next image.
    ///
    /// # Errors
    /// Those of [`GpuRenderer::set_brdf`].
    pub fn set_tile(&mut self, gpu: &Gpu, tile: &GpuTileInput) -> std::result::Result<(), GpuError> {
        let visibility = match &tile.visibility_input {
            GpuVisibilityInput::Computed(visibility) => GpuVisibility::Computed(visibility),
            GpuVisibilityInput::Heights(heights) => {
                let march = match &mut self.march {
                    Some(march) => march,
                    none => none.insert(GpuHeightMarch::new(gpu)?),
                };
                let HeightMarchInput { samples, tile_size, facets, azimuths, transition_width } = heights;
                GpuVisibility::HorizonMap(
                    march.horizon_map(gpu, samples, *tile_size, facets, *azimuths)?,
                    *transition_width,
                )
            }
            GpuVisibilityInput::OcclusionIntervals(of) => {
                let slicer = match &mut self.slicer {
                    Some(slicer) => slicer,
                    none => none.insert(GpuSlicer::new(gpu)?),
                };
                let SliceInput { grid, facets, azimuths, transition_width, overhangs } = &**of;
                let computed = slicer.prepare(gpu, grid, facets, *azimuths, *overhangs)?;
                if *overhangs {
                    GpuVisibility::OcclusionIntervals(computed, *transition_width)
                } else {
                    GpuVisibility::HorizonMap(computed, *transition_width)
                }
            }
            GpuVisibilityInput::Maps(of) => {
                let maps = match &mut self.maps {
                    Some(maps) => maps,
                    none => none.insert(GpuShadowMaps::new(gpu)?),
                };
                let ShadowMapInput { mesh, facets, grid, resolution } = &**of;
                GpuVisibility::Maps(maps.maps(gpu, mesh, facets, &grid.directions(), *resolution)?, *grid)
            }
        };
        self.material = Some(self.shading.tile(gpu, tile, visibility, self.rays.is_some())?);
        self.is_prepared = false;
        Ok(())
    }

    /// Adds interreflection to the material, which has none: that of a similar tile whose base area is `base_area`.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn add_bounced(
        &mut self,
        gpu: &Gpu,
        table: &InterreflectionTable,
        base_area: f64,
    ) -> std::result::Result<(), GpuError> {
        if let Some(material) = &mut self.material {
            self.shading.add_bounced(gpu, material, table, base_area, self.rays.is_some())?;
        }
        Ok(())
    }

    /// Renders the object of the renderer and reads the image back. Of `input.mesh` only the bounds are used;
    /// `input.reflectance` and `input.shadow_cache` are not used.
    ///
    /// # Errors
    /// An invalid size or camera, errors of the GPU, or [`crate::base::Error::Cancelled`].
    pub fn render(&mut self, gpu: &Gpu, input: &RenderInput, cancel: &Cancel) -> Result<Rendered> {
        check_size(input.size, input.samples_per_side)?;
        let [width, height] = input.size;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let pixels = gpu.buffer("pixels", (16 * width * height) as u64, usage)?;
        // Linear radiance is not tone mapped.
        let tone_map = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };
        let times = self.draw(gpu, input, &tone_map, Output::Radiance(&pixels), cancel)?;
        let rows: Vec<[f32; 4]> = gpu.read(&pixels)?;
        let rows = &rows[..width * height];
        let points = rows.iter().map(|row| row[3] as usize).sum();
        let pixels = rows.iter().map(|&[r, g, b, _]| glam::Vec3::new(r, g, b)).collect();
        Ok(Rendered { image: Image { width, height, pixels }, times, points })
    }

    /// Renders like [`GpuRenderer::render`], into a texture for a screen, and waits until it has finished.
    ///
    /// # Errors
    /// Those of [`GpuRenderer::render`].
    pub fn show(
        &mut self,
        gpu: &Gpu,
        input: &RenderInput,
        tone_map: &ToneMap,
        image: &wgpu::TextureView,
        cancel: &Cancel,
    ) -> Result<RenderTimes> {
        check_size(input.size, input.samples_per_side)?;
        self.draw(gpu, input, tone_map, Output::Image(image), cancel)
    }

    fn draw(
        &mut self,
        gpu: &Gpu,
        input: &RenderInput,
        tone_map: &ToneMap,
        output: Output,
        cancel: &Cancel,
    ) -> Result<RenderTimes> {
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let work = self.material.as_ref().map_or(1, |material| material.work(input.lights.len()).max(1));
        let all = input.size[0] * input.size[1] * input.samples_per_side * input.samples_per_side;
        // Materials whose work fits into one submission share the buffers.
        let points = usize::try_from(self.max_work / work).unwrap_or(usize::MAX).min(all);
        let sizes = BufferSizes {
            size: input.size,
            samples_per_side: input.samples_per_side,
            lights: input.lights.len(),
            points,
        };
        let mut buffers = self.buffers(gpu, sizes)?;
        let finds_points = !buffers.holds(&view, input.lights);
        let lights: Vec<GpuLight> = input.lights.iter().map(GpuLight::from).collect();
        gpu.write(&buffers.lights, &lights)?;
        for band in &buffers.bands {
            let camera = GpuCamera::new(&view, &self.object, sizes.samples_per_side, band.rows.clone());
            let params = shading::ShadingParams {
                eye: view.eye,
                point_count: buffers.point_slots(band),
                light_count: sizes.lights as u32,
                words_per_point: buffers.words,
                slice: buffers.slice,
                min_area: self.material.as_ref().map_or(0.0, GpuMaterial::min_area),
            };
            let counts = [buffers.slots(), buffers.slices];
            let image = image::ImageParams::new(sizes.size, band.rows.clone(), counts, input.background, tone_map);
            band.write(gpu, camera, params, image)?;
        }
        let group = self.images.output(gpu, output)?;
        let work_per_band = buffers.bands.first().map_or(1, |band| u64::from(buffers.point_slots(band)) * work);
        let bands_per_submission = (self.max_work / work_per_band.max(1)).max(1) as usize;
        let mut recorder = Recorder::new(gpu, self.clock.as_ref(), self.by_stage);
        for (first, bands) in buffers.bands.chunks(bands_per_submission).enumerate() {
            cancel.check()?;
            if first == 0 {
                self.record_preparation(&mut recorder, cancel)?;
                if let (true, Some(band)) = (finds_points, buffers.bands.first()) {
                    let (encoder, writes) = recorder.render_pass(GpuPassKind::GBuffer);
                    self.gbuffer.draw(encoder, &buffers.samples, &band.scene, &self.object, writes);
                }
            }
            for band in bands {
                if finds_points {
                    self.record_points(&mut recorder, &buffers, band)?;
                }
                self.record_band(&mut recorder, &buffers, band, (output, &group), work_per_band > self.max_work)?;
            }
            recorder.submit()?;
        }
        let times = recorder.times();
        buffers.set_found(view, input.lights);
        (self.buffers, self.is_prepared) = (Some(buffers), true);
        Ok(times)
    }

    /// Returns the buffers of the last image if they have the same sizes, else new ones.
    fn buffers(&mut self, gpu: &Gpu, sizes: BufferSizes) -> std::result::Result<RenderBuffers, GpuError> {
        match self.buffers.take().filter(|buffers| buffers.sizes == sizes) {
            Some(buffers) => Ok(buffers),
            None => {
                let Self { gbuffer, object, rays, shading, images, .. } = self;
                RenderBuffers::new(gpu, sizes, &RendererParts { gbuffer, object, rays: rays.as_ref(), shading, images })
            }
        }
    }

    /// Records the inputs of the material if they are not yet computed.
    fn record_preparation(&self, recorder: &mut Recorder, cancel: &Cancel) -> Result<()> {
        let unprepared = self.material.as_ref().filter(|_| !self.is_prepared);
        if let Some(maps) = unprepared.and_then(GpuMaterial::maps) {
            for (submission, batches) in maps.batches().enumerate() {
                if submission > 0 {
                    recorder.submit()?;
                    cancel.check()?;
                }
                for batch in batches {
                    maps.draw(batch, &mut recorder.compute_pass(GpuPassKind::Product, &maps.cleared_buffers()));
                    recorder.end_stage(GpuPassKind::Product)?;
                }
            }
        }
        if let Some(horizons) = unprepared.and_then(GpuMaterial::horizons) {
            let mut recorded_work = 0;
            for run in 0..horizons.runs() {
                if recorded_work > 0 && recorded_work + horizons.work(run) > self.max_work {
                    recorder.submit()?;
                    cancel.check()?;
                    recorded_work = 0;
                }
                horizons.dispatch(&mut recorder.compute_pass(GpuPassKind::Product, &[]), run);
                recorder.end_stage(GpuPassKind::Product)?;
                recorded_work += horizons.work(run);
            }
        }
        if let Some(material) = unprepared.filter(|material| material.needs_preparation()) {
            let parts = material.parts(self.max_work);
            for (k, part) in parts.iter().enumerate() {
                let cleared = if k == 0 { material.sums() } else { Vec::new() };
                material.prepare(&mut recorder.compute_pass(GpuPassKind::Product, &cleared), part.clone());
                recorder.end_stage(GpuPassKind::Product)?;
                if parts.len() > 1 {
                    recorder.submit()?;
                    cancel.check()?;
                }
            }
        }
        Ok(())
    }

    /// Records the points of a band, from its samples, and their light visibility.
    fn record_points(
        &self,
        recorder: &mut Recorder,
        buffers: &RenderBuffers,
        band: &Band,
    ) -> std::result::Result<(), GpuError> {
        let pixels = [buffers.sizes.size[0], band.rows.len()].map(|n| n as u32);
        let mut pass = recorder.compute_pass(GpuPassKind::GBuffer, &[]);
        self.gbuffer.find_points(&mut pass, &band.scene, &band.to_points, pixels);
        drop(pass);
        recorder.end_stage(GpuPassKind::GBuffer)?;
        let rays = self.rays.as_ref().filter(|_| buffers.sizes.lights > 0);
        if let (Some((rays, _)), Some(group), Some(to_bits)) = (rays, &band.rays, &band.to_bits) {
            let mut pass = recorder.compute_pass(GpuPassKind::Shadows, &[]);
            rays.trace(&mut pass, group, to_bits, [buffers.point_slots(band), buffers.words]);
            drop(pass);
            recorder.end_stage(GpuPassKind::Shadows)?;
        }
        Ok(())
    }

    /// Records the work of a band from points to pixels.
    fn record_band(
        &self,
        recorder: &mut Recorder,
        buffers: &RenderBuffers,
        band: &Band,
        output: (Output, &wgpu::BindGroup),
        is_heavy: bool,
    ) -> std::result::Result<(), GpuError> {
        let (points, pixels) = (buffers.point_slots(band), [buffers.sizes.size[0], band.rows.len()].map(|n| n as u32));
        let lit = buffers.sizes.lights > 0;
        let passes = self.material.as_ref().filter(|_| lit).map_or(0, GpuMaterial::passes);
        // The work of a single row of pixels may exceed that of a submission.
        let passes_at_once = if is_heavy { 1 } else { passes.max(1) };
        let mut pass = recorder.compute_pass(GpuPassKind::Shading, &[&buffers.radiance]);
        for first in (0..passes).step_by(passes_at_once) {
            if let Some(material) = &self.material {
                let some = first..(first + passes_at_once).min(passes);
                material.shade(&mut pass, some, &band.shading, [points, buffers.slices]);
            }
            if is_heavy {
                drop(pass);
                recorder.end_stage(GpuPassKind::Shading)?;
                recorder.submit()?;
                pass = recorder.compute_pass(GpuPassKind::Shading, &[]);
            }
        }
        self.images.write(&mut pass, &band.pixels, output, pixels);
        drop(pass);
        recorder.end_stage(GpuPassKind::Shading)
    }
}

/// Renders one image on the GPU. For more than one image, use a [`GpuRenderer`].
///
/// # Errors
/// Those of [`GpuRenderer::with_material`] and [`GpuRenderer::render`].
pub fn render_gpu(gpu: &Gpu, input: &RenderInput, brdf: &EffectiveBrdf) -> Result<Rendered> {
    GpuRenderer::with_material(gpu, input.mesh, input.occluder, brdf)?.render(gpu, input, &Cancel::default())
}
