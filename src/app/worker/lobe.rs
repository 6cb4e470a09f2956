//! Plots of f̄ for one light: the hemisphere of viewers as an image, and a cut through it.

use std::sync::Arc;

use crate::effective::{EffectiveBrdf, Reflectance};
use crate::math::directions::from_angles;
use eframe::egui::{Color32, ColorImage};
use glam::Vec3;
use rayon::prelude::*;

use super::runner::JobContext;

/// A light over the tile and the BRDF to plot.
#[derive(Debug, Clone)]
pub struct LobeJob {
    pub brdf: Arc<EffectiveBrdf>,
    pub light: Vec3,
    /// Picked view direction whose value is reported.
    pub viewer: Option<Vec3>,
    pub log: bool,
}

/// Samples of the cut: -90° to 90° in steps of one degree.
pub const CUT: usize = 181;

/// The plots of one light.
#[derive(Debug, Clone)]
pub struct LobePlot {
    /// Values by view direction, projected onto the plane: x to the right, y up.
    pub image: Arc<ColorImage>,
    /// f̄ [1/sr] in the plane of the light and the normal, at negative angles on the light's side.
    pub cut: Arc<Vec<Vec3>>,
    /// Largest channel of the image and the cut.
    pub max: f32,
    /// f̄ towards the picked viewer.
    pub value: Option<Vec3>,
    pub light: Vec3,
    /// False if a finer image follows.
    pub is_complete: bool,
}

/// Sides of the image in pixels, coarse then fine.
const SIDES: [usize; 2] = [40, 144];

pub fn work(job: &LobeJob, context: &JobContext<LobeJob>, report: &dyn Fn(LobePlot)) {
    let azimuth = job.light.y.atan2(job.light.x);
    let cut: Vec<Vec3> = (0..CUT)
        .into_par_iter()
        .map(|k| {
            let angle = (k as f32 - 90.0).to_radians();
            let phi = if angle < 0.0 { azimuth } else { azimuth + std::f32::consts::PI };
            eval(&job.brdf, job.light, from_angles(angle.abs(), phi))
        })
        .collect();
    let cut = Arc::new(cut);
    let value = job.viewer.map(|viewer| eval(&job.brdf, job.light, viewer));
    for side in SIDES {
        if context.cancel.is_set() && side != SIDES[0] {
            return;
        }
        let values: Vec<Option<Vec3>> = (0..side * side)
            .into_par_iter()
            .map(|k| {
                if context.cancel.is_set() && side != SIDES[0] {
                    return None;
                }
                let at = |k: usize| (k as f32 + 0.5) / side as f32 * 2.0 - 1.0;
                let (x, y) = (at(k % side), -at(k / side));
                let inside = 1.0 - x * x - y * y;
                (inside > 0.0).then(|| eval(&job.brdf, job.light, Vec3::new(x, y, inside.sqrt())))
            })
            .collect();
        if context.cancel.is_set() && side != SIDES[0] {
            return;
        }
        let max = values.iter().flatten().chain(cut.iter()).map(|v| v.max_element()).fold(1e-9, f32::max);
        let color = |value: &Option<Vec3>| match value {
            None => Color32::TRANSPARENT,
            Some(value) => {
                let shown = if job.log { logarithmic(*value / max) } else { *value / max };
                let [r, g, b] = shown.to_array().map(crate::render::image::tone_map::srgb_byte);
                Color32::from_rgb(r, g, b)
            }
        };
        let is_complete = side == SIDES[1];
        let image = ColorImage::new([side, side], values.iter().map(color).collect());
        report(LobePlot { image: Arc::new(image), cut: cut.clone(), max, value, light: job.light, is_complete });
    }
}

fn eval(brdf: &EffectiveBrdf, i: Vec3, o: Vec3) -> Vec3 {
    let mut out = [Vec3::ZERO];
    brdf.eval_lights(&[i], o, &mut out);
    out[0]
}

/// Maps three decades of the largest channel to 0..1 and preserves the hue.
pub fn logarithmic(value: Vec3) -> Vec3 {
    let max = value.max_element();
    if max <= 1e-3 {
        return Vec3::ZERO;
    }
    let scaled = (max.log10() + 3.0) / 3.0;
    value / max * scaled * scaled
}
