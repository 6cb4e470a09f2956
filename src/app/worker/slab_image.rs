//! Images of scenes with a slab, which the CPU renders.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Result};
use crate::effective::{ViewPaths, Viewer};
use crate::plan::{Preset, Settings};
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::render::{RenderScene, Rendered};
use crate::slab::{Method, Slab, SlabView};
use glam::{DVec3, Vec3};

use super::gpu_drafts::as_preset;
use super::image_worker::{ImageWorker, camera, ms};
use super::rendered_preview::{DisplayImage, Grade, ImageJob, RenderedPreview};
use super::tone::color_image;

/// Polar angle of the light of the plot [degrees].
const THETA: f64 = 45.0;
/// Steps of a curve, from horizon to horizon.
const STEPS: usize = 180;
/// Facets of the sum over facets, and paths that measure the parts of the light.
const FACETS: usize = 64;
const PATHS: usize = 4096;

/// The lobe of a slab in the plane of incidence, and the parts of the light.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabPlot {
    pub theta_deg: f32,
    /// BTDF [1/sr] by the angle of the viewer in the plane of incidence, from -90 to 90°, by method.
    pub curves: Vec<(&'static str, Vec<f32>)>,
    /// Parts of the incident light: through, straight, reflected and absorbed.
    pub parts: [(&'static str, f32); 4],
}

impl SlabPlot {
    /// Curves of a slab, and the parts of its light. Only final plots have the sum over facets.
    fn new(slab: &Slab, view: &SlabView, is_final: bool) -> Self {
        let (sin, cos) = THETA.to_radians().sin_cos();
        let i = DVec3::new(-sin, 0.0, cos);
        let direction = |k: usize| {
            let (sin, cos) = ((k as f64 / STEPS as f64 - 0.5) * std::f64::consts::PI).sin_cos();
            DVec3::new(sin, 0.0, -cos.max(0.0))
        };
        let curve = |slab: &Slab| -> Vec<f32> {
            (0..=STEPS).map(|k| (slab.single_pass(i, direction(k)).element_sum() / 3.0) as f32).collect()
        };
        let mut curves = vec![("Eq. 11", curve(&Slab { method: Method::Dual, ..slab.clone() }))];
        if is_final {
            curves.push(("64 facets", curve(&slab.clone().by_faces(FACETS))));
        }
        let (mut through, mut reflected) = (0.0, 0.0);
        let grey = |value: Vec3| value.element_sum() / 3.0;
        // By reciprocity, what reaches a viewer is what leaves for a light from there.
        let viewer = Viewer { o: i.as_vec3(), paths: PATHS, seed: 1 };
        let even = view.follow(&viewer, |end| {
            *(if end.direction.z < 0.0 { &mut through } else { &mut reflected }) += grey(end.weight);
        });
        let [straight, mirrored] = view.straight(viewer.o).map(grey);
        through += grey(even[0]);
        reflected += grey(even[1]) + mirrored;
        let absorbed = (1.0 - through - reflected - straight).max(0.0);
        let parts =
            [("through", through), ("straight", straight), ("reflected", reflected), ("absorbed or lost", absorbed)];
        Self { theta_deg: THETA as f32, curves, parts }
    }
}

impl ImageWorker {
    /// Renders the slab of a job: a draft, or the image of the scene's own quality.
    pub(super) fn render_slab(
        &mut self,
        job: &ImageJob,
        grade: Grade,
        size: [usize; 2],
        cancel: &Cancel,
    ) -> Result<RenderedPreview> {
        let is_draft = grade == Grade::Draft;
        let loaded = if is_draft { as_preset(&job.loaded, Preset::Draft) } else { (*job.loaded).clone() };
        let outcome = self.pipeline.slab(&loaded)?;
        let render_scene = RenderScene::with(&self.pipeline, &loaded)?;
        let scene = SlabScene::with(&self.pipeline, &loaded, &outcome, &render_scene)?;
        let samples = if is_draft { 1 } else { 2 };
        let Rendered { image, times, .. } = scene.render(&render_scene, size, samples, cancel)?;
        let plot = SlabPlot::new(&outcome.slab, scene.view(), !is_draft);
        let camera = camera(&loaded);
        let start = Instant::now();
        let shown = DisplayImage::Pixels(Arc::new(color_image(&image, &ToneMap::new(&camera)?)));
        let mut stages = outcome.times.clone();
        stages.extend([("g-buffer", times.gbuffer_ms), ("shading", times.shading_ms), ("tone", ms(start))]);
        Ok(RenderedPreview {
            version: job.version,
            grade,
            radiance: Some(Arc::new(image)),
            image: shown,
            brdf: None,
            slab: Some(Arc::new(plot)),
            stages,
            latency_ms: ms(job.submitted),
            rendered_on: "CPU".to_owned(),
            gpu_error: None,
            distance: self.renderer.distance(&camera, size),
            notes: [self.renderer.warnings(), scene.warnings(&render_scene)?].concat(),
            lit_object: Some(render_scene),
            camera,
            warnings: if is_draft { Vec::new() } else { outcome.health.warnings.clone() },
            effects: outcome.effects.clone(),
            preset: Settings::of(&loaded.scene).preset.name(),
        })
    }
}
