//! The object's picture: a draft at once, then the scene's own quality while the hand rests.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::base::{Cancel, Error, Result};
use crate::cache::Cache;
use crate::pipeline::Pipeline;
use crate::plan::Preset;
use crate::render::image::tone_map::ToneMap;
use crate::render::tile_view::CloseUp;
use crate::scene::{Camera, LoadedScene};

use super::made::{DisplayImage, Grade, ImageAnswer, ImageJob, Made};
use super::on_device::{DeviceDrafts, as_preset};
use super::runner::Desk;
use super::shared::{Shared, SmallScale, lock, small_scale};
use super::studio::{Close, ImageStudio, Shot, Worn};
use super::tone::color_image;

/// A first picture should be there after this many milliseconds.
const DRAFT_MS: f64 = 60.0;
/// Pictures on the way to the full one.
const STEPS_MS: [f64; 2] = [300.0, 2000.0];
/// The last one; where the view's own size would take longer, it is smaller (an exported picture never is).
const FINAL_MS: f64 = 8000.0;
/// Most pixels of a picture, on the processor and on a graphics processor; a larger view shows it enlarged.
const MAX_PIXELS: [f64; 2] = [768.0 * 768.0, 3840.0 * 2160.0];
/// A draft that takes longer than this is given up for a newer edit; quicker ones are all shown, so that the picture follows.
const PATIENCE: Duration = Duration::from_millis(700);
/// How often refinement looks whether the draft is there.
const POLL: Duration = Duration::from_millis(5);
/// How long the hand must rest before refinement begins.
const REST: Duration = Duration::from_millis(120);

const PRODUCT: &str = "visibility and product";

/// The longest side: twice as many samples are what any graphics processor draws.
const LONGEST: f64 = 4096.0;

/// Keeps stages and what stays between pictures. One drafts, on a thread that is never kept long; another refines.
pub struct Photographer {
    shared: Arc<Shared>,
    pipeline: Pipeline,
    studio: ImageStudio,
    /// The tile, while pictures are so close that it shows.
    close: Option<(SmallScale, Close)>,
    /// Milliseconds a pixel, of the draft's and of the refined BRDF.
    cost: [f64; 2],
    on_device: DeviceDrafts,
    /// Where the next picture is made: the scene's own choice, or `cpu` before anybody knows what devices there are.
    backend: String,
}

/// What a pixel is taken to cost before any was measured [ms].
const FIRST_COST: f64 = 2e-2;

impl Photographer {
    pub fn new(shared: Arc<Shared>, cache: &Cache) -> Self {
        let (mut pipeline, studio) = (Pipeline::new(), ImageStudio::default());
        pipeline.set_cache(cache.clone());
        Self {
            shared,
            pipeline,
            studio,
            close: None,
            cost: [FIRST_COST; 2],
            on_device: DeviceDrafts::default(),
            backend: String::new(),
        }
    }

    /// A picture at once: with the refined BRDF where it is known, else with a draft.
    pub fn draft(&mut self, job: &ImageJob, desk: &Desk<ImageJob>, answer: &dyn Fn(ImageAnswer)) {
        let shared = self.shared.clone();
        let _drafting = shared.drafting(job.version);
        let done = self.toned(job).and_then(|toned| match toned {
            Some(made) => Ok(made),
            None => self.drafted(job, &desk.cancel.after(PATIENCE)),
        });
        tell(job, done.map(|made| answer(ImageAnswer::Made(Box::new(made)))), answer);
    }

    fn drafted(&mut self, job: &ImageJob, cancel: &Cancel) -> Result<Made> {
        self.pipeline.cancel_with(cancel.clone());
        self.choose_device(job, false);
        self.studio.prepare(&job.loaded)?;
        let (outcome, which) = match self.shared.known(&job.loaded) {
            Some(outcome) => (outcome.without_times(), 1),
            None => match self.drafted_on_device(job, cancel)? {
                Some(made) => return Ok(made),
                None => (self.pipeline.effective(&as_preset(&job.loaded, Preset::Draft))?, 0),
            },
        };
        let size = self.affordable(job.size, which, DRAFT_MS);
        self.shoot(job, Worn::Known(&outcome), which, size, 1, cancel)
    }

    /// A draft whose visibility and product a graphics processor makes with the picture, as fine as it is fast.
    fn drafted_on_device(&mut self, job: &ImageJob, cancel: &Cancel) -> Result<Option<Made>> {
        if !self.studio.is_fast() || self.studio.is_close(&camera(&job.loaded), job.size) {
            return Ok(None);
        }
        let Some(tile) = self.on_device.tile(&job.loaded, &mut self.pipeline)? else { return Ok(None) };
        let size = self.affordable(job.size, 0, DRAFT_MS);
        let made = match self.shoot(job, Worn::GpuTile(&tile), 0, size, 1, cancel) {
            Ok(made) => made,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // The device does not do it, or failed at it.
            Err(_) => return Ok(None),
        };
        // Without a table it is the shading that takes the finer sum.
        let counted: &[&str] = if tile.sum.nodes.is_some() { &[PRODUCT] } else { &[PRODUCT, "shading"] };
        let counted: Vec<f64> =
            made.stages.iter().filter(|(name, _)| counted.contains(name)).map(|(_, ms)| *ms).collect();
        if made.stages.iter().any(|(name, _)| *name == PRODUCT) {
            self.on_device.took(counted.iter().sum());
        }
        Ok(Some(made))
    }

    /// Sees to it that no device is opened that is of no use, and, unless there is time, none before the window told.
    fn choose_device(&mut self, job: &ImageJob, has_time: bool) {
        let devices = self.shared.devices.get();
        if let Some(devices) = devices {
            if let Some(name) = &devices.only_software {
                self.studio.leave_out(name);
            }
            self.studio.show_on(devices.screen.as_ref());
            if let Some(screen) = devices.screen.as_ref().filter(|screen| screen.is_fast) {
                self.pipeline.use_device(screen.gpu.clone());
            }
        }
        let asked = &*job.loaded.scene.quality.backend;
        let known = devices.is_some() || has_time;
        self.backend = if !known && asked == "auto" { "cpu" } else { asked }.to_owned();
        let perhaps = devices.map_or(has_time, |devices| devices.only_software.is_none());
        self.pipeline.allow_device(asked == "gpu" || perhaps);
    }

    /// The scene's own quality, once the hand rests; given up when newer work is there.
    pub fn refine(&mut self, job: &ImageJob, desk: &Desk<ImageJob>, answer: &dyn Fn(ImageAnswer)) {
        let mut is_newest = desk.is_newest_after(REST);
        // Both want all cores, and the draft is what the hand waits for.
        while is_newest && !self.shared.is_drafted(job.version) {
            is_newest = desk.is_newest_after(POLL);
        }
        if is_newest {
            tell(job, self.refined(job, desk, answer), answer);
        }
    }

    fn refined(&mut self, job: &ImageJob, desk: &Desk<ImageJob>, answer: &dyn Fn(ImageAnswer)) -> Result<()> {
        if self.is_toned(job) {
            return Ok(());
        }
        self.pipeline.cancel_with(desk.cancel.clone());
        self.choose_device(job, true);
        let mut outcome = match self.shared.known(&job.loaded) {
            Some(outcome) => outcome.without_times(),
            None => {
                answer(ImageAnswer::Doing(job.version, "Refining the material"));
                self.pipeline.effective(&job.loaded)?
            }
        };
        *lock(&self.shared.best) = Some((small_scale(&job.loaded), outcome.clone()));
        answer(ImageAnswer::Doing(job.version, "Refining the picture"));
        self.studio.prepare(&job.loaded)?;
        let mut shown = 0;
        for budget in STEPS_MS {
            let step = self.affordable(job.size, 1, budget);
            let pixels = step[0] * step[1];
            let full = self.affordable(job.size, 1, FINAL_MS);
            // Steps that gain little are left out.
            if pixels >= 2 * shown && pixels * 3 < full[0] * full[1] * 2 {
                let mut made = self.shoot(job, Worn::Known(&outcome), 1, step, 1, desk.cancel)?;
                made.grade = Grade::Refining;
                outcome.times = Vec::new();
                shown = pixels;
                answer(ImageAnswer::Made(Box::new(made)));
            }
        }
        let full = self.affordable(job.size, 1, FINAL_MS);
        let mut made = self.shoot(job, Worn::Known(&outcome), 1, full, 2, desk.cancel)?;
        made.grade = Grade::Final;
        made.warnings.clone_from(&outcome.health().warnings);
        // What stays on the device is made anew in other tones.
        let last = made.radiance.is_some().then(|| (Box::new((*job.loaded).clone()), job.size, made.clone()));
        *lock(&self.shared.last) = last;
        answer(ImageAnswer::Made(Box::new(made)));
        Ok(())
    }

    /// Whether the last full picture shows this but for its tones.
    fn is_toned(&self, job: &ImageJob) -> bool {
        lock(&self.shared.last).as_ref().is_some_and(|(last, size, _)| {
            let (mut like_last, before) = ((*job.loaded).clone(), camera(last));
            let now = camera(&job.loaded);
            like_last.scene.camera.clone_from(&last.scene.camera);
            like_last.name.clone_from(&last.name);
            let tones = Camera { exposure_ev: before.exposure_ev, tone_map: before.tone_map.clone(), ..now };
            tones == before && like_last == **last && *size == job.size
        })
    }

    /// The last full picture in other tones, where nothing else changed.
    fn toned(&mut self, job: &ImageJob) -> Result<Option<Made>> {
        if !self.is_toned(job) {
            return Ok(None);
        }
        let start = Instant::now();
        let Some((last, _, made)) = &mut *lock(&self.shared.last) else { return Ok(None) };
        let Some(radiance) = &made.radiance else { return Ok(None) };
        made.image = DisplayImage::Pixels(Arc::new(color_image(radiance, &ToneMap::new(&camera(&job.loaded))?)));
        made.version = job.version;
        made.stages = vec![("tone", ms(start))];
        made.latency_ms = ms(job.asked);
        last.scene.camera.clone_from(&job.loaded.scene.camera);
        Ok(Some(made.clone()))
    }

    fn shoot(
        &mut self,
        job: &ImageJob,
        worn: Worn,
        which: usize,
        size: [usize; 2],
        samples_per_side: usize,
        cancel: &Cancel,
    ) -> Result<Made> {
        let camera = camera(&job.loaded);
        let tone_map = ToneMap::new(&camera)?;
        let settle = samples_per_side > 1;
        if self.studio.is_close(&camera, size) {
            self.come_close(&job.loaded)?;
        } else {
            self.close = None;
        }
        let shot = Shot { camera: &camera, material: worn, size, samples_per_side, settle, backend: &self.backend };
        let close = self.close.as_ref().map(|(_, close)| close);
        let shown = if close.is_none() { self.studio.show(&shot, &tone_map, cancel)? } else { None };
        let (radiance, image, times, table_ms, tone) = match shown {
            Some(shown) => (None, DisplayImage::OnDevice(shown.image), shown.times, shown.table_ms, None),
            None => {
                let (rendered, table_ms) = self.studio.shoot(&shot, close, cancel)?;
                let start = Instant::now();
                let image = DisplayImage::Pixels(Arc::new(color_image(&rendered.image, &tone_map)));
                (Some(Arc::new(rendered.image)), image, rendered.times, table_ms, Some(ms(start)))
            }
        };
        let spent = times.gbuffer_ms + times.shadows_ms + times.shading_ms;
        if samples_per_side == 1 {
            self.cost[which] = spent / (size[0] * size[1]) as f64;
        }
        let large = [
            (PRODUCT, times.product_ms),
            ("picture table", table_ms),
            ("g-buffer", times.gbuffer_ms),
            ("shadows", times.shadows_ms),
            ("shading", times.shading_ms),
        ];
        let (plan, preset, times, notes, brdf) = match worn {
            Worn::Known(of) => (&of.plan, of.settings.preset, &of.times, &of.notes, Some(of.brdf.clone())),
            Worn::GpuTile(of) => (&of.plan, of.settings.preset, &of.times, &of.notes, None),
        };
        let mut stages = times.clone();
        stages.extend(large.into_iter().filter(|(_, ms)| *ms > 0.005));
        stages.extend(tone.map(|ms| ("tone", ms)));
        let mut notes = notes.clone();
        notes.extend(self.studio.warnings());
        Ok(Made {
            version: job.version,
            grade: Grade::Draft,
            radiance,
            image,
            brdf,
            stages,
            latency_ms: ms(job.asked),
            device: self.studio.device(),
            trouble: self.studio.trouble(),
            set: self.studio.set(),
            camera: camera.clone(),
            distance: self.studio.distance(&camera, size),
            notes,
            warnings: Vec::new(),
            effects: plan.effects.clone(),
            preset: preset.name(),
        })
    }

    /// Makes the tile ready to be seen itself.
    fn come_close(&mut self, loaded: &LoadedScene) -> Result<()> {
        let key = small_scale(loaded);
        if self.close.as_ref().is_none_or(|(last, _)| *last != key) {
            let tile = CloseUp::new(Arc::new(self.pipeline.mesh(loaded)?));
            self.close = Some((key, (tile, self.pipeline.sum_materials(loaded)?)));
        }
        Ok(())
    }

    /// The largest size, the view's shape kept, that `budget_ms` is likely to pay for.
    fn affordable(&self, size: [usize; 2], which: usize, budget_ms: f64) -> [usize; 2] {
        let full = fitting(size, MAX_PIXELS[usize::from(self.studio.is_fast())]);
        let pixels = (full[0] * full[1]) as f64;
        let scale = (budget_ms / self.cost[which] / pixels).sqrt();
        // Few sizes, so that the picture does not breathe while the hand moves.
        let parts = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0];
        let part = parts.into_iter().find(|part| 1.0 / part <= scale).unwrap_or(8.0);
        full.map(|side| ((side as f64 / part).round() as usize).max(24))
    }
}

/// The view's size, cut to what is ever rendered.
fn fitting(size: [usize; 2], most: f64) -> [usize; 2] {
    let size = size.map(|side| side.clamp(24, 8192));
    let longest = size[0].max(size[1]) as f64;
    let scale = (most / (size[0] * size[1]) as f64).sqrt().min(LONGEST / longest).min(1.0);
    size.map(|side| ((side as f64 * scale) as usize).max(24))
}

/// Says why there is no picture; work that was given up is none to speak of.
fn tell(job: &ImageJob, done: Result<()>, answer: &dyn Fn(ImageAnswer)) {
    match done {
        Ok(()) | Err(Error::Cancelled) => {}
        Err(error) => answer(ImageAnswer::Failed(job.version, error.to_string())),
    }
}

fn camera(loaded: &LoadedScene) -> Camera {
    loaded.scene.camera.clone().unwrap_or_default()
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
