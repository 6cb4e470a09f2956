//! The picture on wgpu: the twin of [`render`](crate::render::render).
//!
//! G-buffer, points, light rays, shading and tones run on the device in one submission; what goes to a screen never leaves
//! it. Only where the work is so much that a driver's watchdog or an impatient hand would mind is it cut into several.

use super::band::{Band, Need, Parts, Room};
use super::gbuffer::{Camera, GpuGBuffer, GpuObject};
use super::image;
use super::image::{GpuImages, Output};
use super::light_rays::{GpuLightRays, GpuOccluder};
use super::stages::{Clock, GpuPassKind, Recorder};
use crate::base::{Cancel, Result};
use crate::effective::{EffectiveBrdf, GpuTileInput, GpuVisibilityInput, Heights, Maps, Sliced};
use crate::gpu::shading::visibility::GpuVisibility;
use crate::gpu::shading::{GpuMaterial, GpuShading, Light};
use crate::gpu::{Gpu, GpuError, GpuHeightMarch, GpuShadowMaps, GpuSlicer, Tier, shading};
use crate::render::image::render::{RenderTimes, check_size};
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::render::shadow::Occluder;
use crate::render::{CameraView, Image, ObjectMesh, RenderInput, Rendered};

/// Lobes or table rows of one submission: some tenths of a second for graphics processors that are not slow, about one for
/// software.
const WORK: u64 = 1 << 32;
const SOFTWARE_WORK: u64 = 1 << 29;

/// All that stays on the device while the camera turns. Made for one object; the BRDF may be exchanged.
#[derive(Debug)]
pub struct GpuRenderer {
    object: GpuObject,
    gbuffer: GpuGBuffer,
    /// Absent where the object cannot shadow itself: then no pass knows of shadows.
    rays: Option<(GpuLightRays, GpuOccluder)>,
    shading: GpuShading,
    /// Nothing is black.
    material: Option<GpuMaterial>,
    /// Whether the device has made what the material reads.
    is_made: bool,
    march: Option<GpuHeightMarch>,
    slicer: Option<GpuSlicer>,
    maps: Option<GpuShadowMaps>,
    images: GpuImages,
    /// For pictures like the last one.
    pub(super) room: Option<Room>,
    /// Lobes or table rows of one submission.
    pub(super) at_once: u64,
    clock: Option<Clock>,
    /// See [`Recorder::new`].
    pub(super) by_stage: bool,
}

impl GpuRenderer {
    /// An object without a material, which is black.
    ///
    /// # Errors
    /// What the device refuses.
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
            is_made: false,
            march: None,
            slicer: None,
            maps: None,
            images: GpuImages::new(gpu)?,
            room: None,
            at_once: if gpu.tier == Tier::Hardware { WORK } else { SOFTWARE_WORK },
            clock: Clock::new(gpu)?,
            by_stage: gpu.tier != Tier::Hardware,
        })
    }

    /// An object in a material.
    ///
    /// # Errors
    /// As [`GpuRenderer::new`] and [`GpuRenderer::set_brdf`].
    pub fn wearing(
        gpu: &Gpu,
        mesh: &ObjectMesh,
        occluder: Option<&Occluder>,
        brdf: &EffectiveBrdf,
    ) -> std::result::Result<Self, GpuError> {
        let mut renderer = Self::new(gpu, mesh, occluder)?;
        renderer.set_brdf(gpu, brdf)?;
        Ok(renderer)
    }

    /// Shades with another BRDF from now on; pipelines that were compiled before are kept.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for a BRDF that only the CPU shades, and what the device refuses; the material before stays.
    pub fn set_brdf(&mut self, gpu: &Gpu, brdf: &EffectiveBrdf) -> std::result::Result<(), GpuError> {
        self.material = Some(self.shading.material(gpu, brdf, self.rays.is_some())?);
        self.is_made = false;
        Ok(())
    }

    /// Shades with a tile from now on, whose visibility and product the device makes in the submission of the next picture.
    ///
    /// # Errors
    /// As [`GpuRenderer::set_brdf`].
    pub fn set_tile(&mut self, gpu: &Gpu, tile: &GpuTileInput) -> std::result::Result<(), GpuError> {
        let seen = match &tile.sight {
            GpuVisibilityInput::Seen(visibility) => GpuVisibility::Held(visibility),
            GpuVisibilityInput::Heights(heights) => {
                let march = match &mut self.march {
                    Some(march) => march,
                    none => none.insert(GpuHeightMarch::new(gpu)?),
                };
                let Heights { samples, tile_size, facets, azimuths, ramp } = heights;
                GpuVisibility::Marched(march.horizons(gpu, samples, *tile_size, facets, *azimuths)?, *ramp)
            }
            GpuVisibilityInput::OcclusionIntervals(of) => {
                let slicer = match &mut self.slicer {
                    Some(slicer) => slicer,
                    none => none.insert(GpuSlicer::new(gpu)?),
                };
                let Sliced { grid, facets, azimuths, ramp, overhangs } = &**of;
                let made = slicer.slices(gpu, grid, facets, *azimuths, *overhangs)?;
                if *overhangs { GpuVisibility::Sliced(made, *ramp) } else { GpuVisibility::Marched(made, *ramp) }
            }
            GpuVisibilityInput::Maps(of) => {
                let maps = match &mut self.maps {
                    Some(maps) => maps,
                    none => none.insert(GpuShadowMaps::new(gpu)?),
                };
                let Maps { mesh, facets, grid, resolution } = &**of;
                GpuVisibility::Drawn(maps.maps(gpu, mesh, facets, &grid.directions(), *resolution)?, *grid)
            }
        };
        self.material = Some(self.shading.tile(gpu, tile, seen, self.rays.is_some())?);
        self.is_made = false;
        Ok(())
    }

    /// Renders the object that the renderer was made for and reads the picture back; `input.mesh` tells its bounds only,
    /// `input.reflectance` and `input.shadow_cache` are not asked.
    ///
    /// # Errors
    /// A size or camera that cannot be, what the device refuses, or [`crate::base::Error::Cancelled`].
    pub fn render(&mut self, gpu: &Gpu, input: &RenderInput, cancel: &Cancel) -> Result<Rendered> {
        check_size(input.size, input.samples_per_side)?;
        let [width, height] = input.size;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let pixels = gpu.buffer("pixels", (16 * width * height) as u64, usage)?;
        // Tones are not asked for.
        let tone_map = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };
        let times = self.draw(gpu, input, &tone_map, Output::Radiance(&pixels), cancel)?;
        let rows: Vec<[f32; 4]> = gpu.read(&pixels)?;
        let rows = &rows[..width * height];
        let points = rows.iter().map(|row| row[3] as usize).sum();
        let pixels = rows.iter().map(|&[r, g, b, _]| glam::Vec3::new(r, g, b)).collect();
        Ok(Rendered { image: Image { width, height, pixels }, times, points })
    }

    /// Renders as [`GpuRenderer::render`] does, into an image on the device that a screen shows; waits until it is there.
    ///
    /// # Errors
    /// As [`GpuRenderer::render`].
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
        let points = usize::try_from(self.at_once / work).unwrap_or(usize::MAX);
        let need =
            Need { size: input.size, samples_per_side: input.samples_per_side, lights: input.lights.len(), points };
        let room = self.room(gpu, need)?;
        let lights: Vec<Light> = input.lights.iter().map(Light::from).collect();
        gpu.write(&room.lights, &lights)?;
        for band in &room.bands {
            let camera = Camera::new(&view, &self.object, need.samples_per_side, band.rows.clone());
            let params = shading::Params {
                eye: view.eye,
                point_count: room.places(band),
                light_count: need.lights as u32,
                words_per_point: room.words,
                slice: room.slice,
                least_area: self.material.as_ref().map_or(0.0, GpuMaterial::least_area),
            };
            let counts = [room.slots(), room.slices];
            let image = image::Params::new(need.size, band.rows.clone(), counts, input.background, tone_map);
            band.write(gpu, camera, params, image)?;
        }
        let group = self.images.output(gpu, output)?;
        let a_band = room.bands.first().map_or(1, |band| u64::from(room.places(band)) * work);
        let together = (self.at_once / a_band.max(1)).max(1) as usize;
        let mut recorder = Recorder::new(gpu, self.clock.as_ref(), self.by_stage);
        for (first, bands) in room.bands.chunks(together).enumerate() {
            cancel.check()?;
            if first == 0 {
                self.record_whole(&mut recorder, &room, cancel)?;
            }
            for band in bands {
                self.record_band(&mut recorder, &room, band, (output, &group), a_band > self.at_once)?;
            }
            recorder.submit()?;
        }
        let times = recorder.times();
        (self.room, self.is_made) = (Some(room), true);
        Ok(times)
    }

    /// The room of the last picture where it serves, else a new one.
    fn room(&mut self, gpu: &Gpu, need: Need) -> std::result::Result<Room, GpuError> {
        match self.room.take().filter(|room| room.need == need) {
            Some(room) => Ok(room),
            None => {
                let Self { gbuffer, object, rays, shading, images, .. } = self;
                Room::new(gpu, need, &Parts { gbuffer, object, rays: rays.as_ref(), shading, images })
            }
        }
    }

    /// What comes before all bands: the material where it is still to be made, and the samples.
    fn record_whole(&self, recorder: &mut Recorder, room: &Room, cancel: &Cancel) -> Result<()> {
        let unmade = self.material.as_ref().filter(|_| !self.is_made);
        if let Some(maps) = unmade.and_then(GpuMaterial::maps) {
            for (submission, batches) in maps.batches().enumerate() {
                if submission > 0 {
                    recorder.submit()?;
                    cancel.check()?;
                }
                for batch in batches {
                    maps.draw(batch, &mut recorder.compute_pass(GpuPassKind::Product, &maps.cleared()));
                    recorder.stage_ends(GpuPassKind::Product)?;
                }
            }
        }
        if let Some(horizons) = unmade.and_then(GpuMaterial::horizons) {
            let mut held = 0;
            for run in 0..horizons.runs() {
                if held > 0 && held + horizons.work(run) > self.at_once {
                    recorder.submit()?;
                    cancel.check()?;
                    held = 0;
                }
                horizons.dispatch(&mut recorder.compute_pass(GpuPassKind::Product, &[]), run);
                recorder.stage_ends(GpuPassKind::Product)?;
                held += horizons.work(run);
            }
        }
        if let Some(material) = unmade.filter(|material| material.is_to_be_made()) {
            let parts = material.parts(self.at_once);
            for (k, part) in parts.iter().enumerate() {
                let cleared = if k == 0 { material.sums() } else { Vec::new() };
                material.make(&mut recorder.compute_pass(GpuPassKind::Product, &cleared), part.clone());
                recorder.stage_ends(GpuPassKind::Product)?;
                if parts.len() > 1 {
                    recorder.submit()?;
                    cancel.check()?;
                }
            }
        }
        if let Some(band) = room.bands.first() {
            let (encoder, writes) = recorder.render_pass(GpuPassKind::GBuffer);
            self.gbuffer.draw(encoder, &room.samples, &band.scene, &self.object, writes);
        }
        Ok(())
    }

    /// All that a band takes, from samples to pixels.
    fn record_band(
        &self,
        recorder: &mut Recorder,
        room: &Room,
        band: &Band,
        output: (Output, &wgpu::BindGroup),
        is_heavy: bool,
    ) -> std::result::Result<(), GpuError> {
        let (points, pixels) = (room.places(band), [room.need.size[0], band.rows.len()].map(|n| n as u32));
        let mut pass = recorder.compute_pass(GpuPassKind::GBuffer, &[]);
        self.gbuffer.find_points(&mut pass, &band.scene, &room.to_points, pixels);
        drop(pass);
        recorder.stage_ends(GpuPassKind::GBuffer)?;
        let lit = room.need.lights > 0;
        if let (true, Some((rays, _)), Some(group), Some(to_bits)) = (lit, &self.rays, &band.rays, &room.to_bits) {
            let mut pass = recorder.compute_pass(GpuPassKind::Shadows, &[]);
            rays.trace(&mut pass, group, to_bits, [points, room.words]);
            drop(pass);
            recorder.stage_ends(GpuPassKind::Shadows)?;
        }
        let passes = self.material.as_ref().filter(|_| lit).map_or(0, GpuMaterial::passes);
        // A row of pixels may be more than one submission holds.
        let together = if is_heavy { 1 } else { passes.max(1) };
        let mut pass = recorder.compute_pass(GpuPassKind::Shading, &[&room.radiance]);
        for first in (0..passes).step_by(together) {
            if let Some(material) = &self.material {
                let some = first..(first + together).min(passes);
                material.shade(&mut pass, some, &band.shading, [points, room.slices]);
            }
            if is_heavy {
                drop(pass);
                recorder.stage_ends(GpuPassKind::Shading)?;
                recorder.submit()?;
                pass = recorder.compute_pass(GpuPassKind::Shading, &[]);
            }
        }
        self.images.write(&mut pass, &band.pixels, output, pixels);
        drop(pass);
        recorder.stage_ends(GpuPassKind::Shading)
    }
}

/// One picture on the device; for more than one, keep a [`GpuRenderer`].
///
/// # Errors
/// As [`GpuRenderer::wearing`] and [`GpuRenderer::render`].
pub fn render_gpu(gpu: &Gpu, input: &RenderInput, brdf: &EffectiveBrdf) -> Result<Rendered> {
    GpuRenderer::wearing(gpu, input.mesh, input.occluder, brdf)?.render(gpu, input, &Cancel::default())
}
