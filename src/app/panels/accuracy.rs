//! Accuracy against time: a slider over quality levels, a chart of the open scene, and a comparison with a reference.

use std::sync::Arc;

use crate::plan::{Effect, Settings};
use crate::report::EffectCost;
use crate::scene::{LoadedScene, Quality, Scene};
use crate::tuning::quality_scale;
use eframe::egui::{
    self, Align2, Color32, Context, FontId, Sense, Slider, Stroke, TextureHandle, TextureOptions, Ui, pos2, vec2,
};

use super::fields;
use crate::app::worker::{AccuracyJob, AccuracyPoint, AccuracyResult};

/// State of the panel between frames.
#[derive(Default)]
pub struct AccuracyState {
    /// True while the panel is unfolded. The chart is measured only then.
    pub open: bool,
    /// True if the worker keeps refining the reference.
    pub comparing: bool,
    /// True while a measurement of each effect, on and off, is requested or running.
    pub measuring: bool,
    /// Costs of the effects, and the document version that they belong to.
    pub costs: Option<(u64, Vec<EffectCost>)>,
    /// Version, `comparing` and `measuring` of the last request.
    requested: Option<(u64, bool, bool)>,
    levels: Vec<AccuracyPoint>,
    current: Option<(u64, AccuracyPoint)>,
    /// Document version, difference image, mean ΔE, and the noise in that mean.
    difference: Option<(u64, TextureHandle, f32, Option<f32>)>,
    activity: Option<&'static str>,
    error: Option<String>,
}

impl AccuracyState {
    /// Returns the job for a document version whose image is final, unless that job is the last request.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>) -> Option<AccuracyJob> {
        let wanted = (version, self.comparing, self.measuring);
        if !(self.open || self.measuring) || self.requested == Some(wanted) {
            return None;
        }
        self.requested = Some(wanted);
        self.error = None;
        let (chart, compare, effects) = (self.open, self.comparing, self.measuring);
        Some(AccuracyJob { version, loaded: loaded.clone(), chart, compare, effects })
    }

    /// Returns true if the running job belongs to another document version, or if nothing needs it any longer.
    pub fn is_late(&mut self, version: u64) -> bool {
        let late = self.activity.is_some()
            && (!(self.open || self.measuring) || self.requested.is_some_and(|(requested, ..)| requested != version));
        if late {
            self.activity = None;
            self.requested = None;
        }
        late
    }

    pub fn receive(&mut self, ctx: &Context, result: AccuracyResult) {
        match result {
            AccuracyResult::Doing(what) => self.activity = Some(what),
            AccuracyResult::Levels(levels) => self.levels = levels,
            AccuracyResult::Current(version, point) => self.current = Some((version, point)),
            AccuracyResult::Difference(version, shown) => {
                let texture = ctx.load_texture("difference", shown.image, TextureOptions::NEAREST);
                self.difference = Some((version, texture, shown.mean, shown.noise));
            }
            AccuracyResult::Effects(version, costs) => {
                self.measuring = false;
                // Only the effects are measured. The rest of the job continues.
                self.requested = self.requested.map(|(version, comparing, _)| (version, comparing, false));
                self.costs = Some((version, costs));
            }
            AccuracyResult::Done(version) => {
                if self.requested.is_some_and(|(requested, ..)| requested == version) {
                    self.activity = None;
                }
            }
            AccuracyResult::Failed(text) => {
                (self.activity, self.error, self.measuring) = (None, Some(text), false);
            }
        }
    }

    /// Returns true if the chart shows the current settings and at least five quality levels.
    #[cfg(test)]
    pub fn is_measured(&self, version: u64) -> bool {
        self.activity.is_none()
            && self.levels.iter().filter(|point| !point.compared.is_stated()).count() >= 5
            && self.current.is_some_and(|(measured, _)| measured == version)
    }
}

/// Draws the panel. The slider changes the scene's settings.
pub fn ui(ui: &mut Ui, scene: &mut Scene, state: &mut AccuracyState, effects: &[Effect], version: u64) {
    state.open = true;
    let overhangs = effects.iter().any(|effect| effect.name == "overhangs" && effect.on);
    let settings = Settings::of(scene);
    let mut level = quality_scale::level_of_facets(settings.facets);
    let tip = "Quality levels: each balances the numbers of facets and of directions. Finer takes longer.";
    let changed = fields::row(ui, "Faster - finer", tip, |ui| {
        ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(60.0);
        ui.add(Slider::new(&mut level, 0.0..=quality_scale::FINEST).show_value(false)).changed()
    });
    if changed {
        let candidate = quality_scale::candidate_at(level, overhangs);
        let plain = Quality {
            preset: candidate.preset.to_owned(),
            seed: scene.quality.seed,
            backend: scene.quality.backend.clone(),
            ..Quality::default()
        };
        let bare = Scene { quality: plain, ..scene.clone() };
        if let Ok(walked) = bare.with_quality(&candidate.set) {
            *scene = walked;
        }
    }
    let current = state.current.filter(|(measured, _)| *measured == version).map(|(_, point)| point);
    let text = match current {
        Some(point) if point.compared.is_stated() => format!(
            "{} facets: PSNR about {:.0} dB, relative L2 about {:.1} % (estimated), {}",
            point.facets,
            point.compared.psnr_db,
            point.compared.rel_l2 * 100.0,
            milliseconds(point.ms)
        ),
        Some(point) => format!(
            "{} facets: PSNR {:.1} ± {:.1} dB, relative L2 {:.2} ± {:.2} %, {}",
            point.facets,
            point.compared.psnr_db,
            point.compared.psnr_std_error_db,
            point.compared.rel_l2 * 100.0,
            point.compared.rel_l2_std_error * 100.0,
            milliseconds(point.ms)
        ),
        None => format!("{} facets", settings.facets),
    };
    ui.label(text);
    chart(ui, &state.levels, current.as_ref());
    ui.horizontal(|ui| {
        ui.toggle_value(&mut state.comparing, "Compare with reference").on_hover_text(
            "Refines a reference in the background. The error bars narrow, and an image shows the difference",
        );
        if let Some(activity) = state.activity {
            ui.spinner();
            ui.weak(activity);
        }
    });
    if let Some(point) = current.filter(|_| state.comparing) {
        ui.weak(format!(
            "Standard error of the reference: {:.2} % after {} passes",
            point.compared.std_error * 100.0,
            4 * point.compared.batches
        ));
    }
    if let Some((measured, texture, mean, noise)) = &state.difference
        && *measured == version
        && state.comparing
    {
        let side = ui.available_width().min(220.0);
        ui.add(egui::Image::new(texture).fit_to_exact_size(vec2(side, side)).alt_text("Difference image"));
        let text = match noise {
            Some(noise) => {
                format!("Difference from the reference: mean ΔE {mean:.2}, of which noise {noise:.2}")
            }
            None => format!("Difference from 65,536 facets: mean ΔE {mean:.2}"),
        };
        ui.weak(format!("{text}. White is ΔE 10. ΔE 2 is just visible"));
    }
    if let Some(error) = &state.error {
        ui.colored_label(ui.visuals().error_fg_color, error);
    }
}

fn milliseconds(ms: f64) -> String {
    if ms < 1000.0 { format!("{ms:.1} ms") } else { format!("{:.2} s", ms * 1e-3) }
}

/// Draws PSNR [dB] against time [ms, logarithmic].
fn chart(ui: &mut Ui, levels: &[AccuracyPoint], current: Option<&AccuracyPoint>) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), 150.0), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Accuracy chart"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 4.0, ui.visuals().extreme_bg_color);
    let weak = ui.visuals().weak_text_color();
    let small = FontId::proportional(9.5);
    let all: Vec<&AccuracyPoint> =
        levels.iter().chain(current).filter(|point| point.compared.psnr_db.is_finite()).collect();
    if all.is_empty() {
        painter.text(area.center(), Align2::CENTER_CENTER, "Measured once the image is final", small, weak);
        return;
    }
    let range = |value: fn(&AccuracyPoint) -> f64, margin: f64| {
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
            (low.min(value(point)), high.max(value(point)))
        });
        (low - margin, high + margin)
    };
    let log = |point: &AccuracyPoint| point.ms.max(1e-3).log10();
    let (x0, x1) = range(log, 0.2);
    let (y0, y1) = range(|point| point.compared.psnr_db, 3.0);
    let inner = area.shrink2(vec2(10.0, 14.0));
    let px = |x: f64| inner.left() + ((x - x0) / (x1 - x0)) as f32 * inner.width();
    let py = |y: f64| inner.bottom() - ((y - y0) / (y1 - y0)) as f32 * inner.height();
    let at = |point: &AccuracyPoint| pos2(px(log(point)), py(point.compared.psnr_db));
    let grid = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
    for decade in x0.ceil() as i32..=x1.floor() as i32 {
        let x = px(f64::from(decade));
        painter.line_segment([pos2(x, area.top()), pos2(x, area.bottom())], grid);
        let text = milliseconds(10_f64.powi(decade)).replace(".0 ", " ").replace(".00 ", " ");
        painter.text(pos2(x + 3.0, area.bottom() - 2.0), Align2::LEFT_BOTTOM, text, small.clone(), weak);
    }
    for ten in (y0 / 10.0).ceil() as i32..=(y1 / 10.0).floor() as i32 {
        let y = py(f64::from(ten * 10));
        painter.line_segment([pos2(area.left(), y), pos2(area.right(), y)], grid);
        let text = format!("{} dB", ten * 10);
        painter.text(pos2(area.left() + 3.0, y - 1.0), Align2::LEFT_BOTTOM, text, small.clone(), weak);
    }
    // The Pareto front: no other point is both faster and more accurate.
    let mut front: Vec<&AccuracyPoint> = all.clone();
    front.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let mut best = f64::NEG_INFINITY;
    front.retain(|point| {
        let better = point.compared.psnr_db > best;
        best = best.max(point.compared.psnr_db);
        better
    });
    let blue = Color32::from_rgb(86, 160, 233);
    painter.add(egui::Shape::line(front.iter().map(|point| at(point)).collect(), Stroke::new(1.5, blue)));
    for point in levels.iter().filter(|point| point.compared.psnr_db.is_finite()) {
        bars(&painter, at(point), point, (y0, y1), inner.height(), blue);
        painter.circle_filled(at(point), 3.0, blue);
    }
    if let Some(point) = current.filter(|point| point.compared.psnr_db.is_finite()) {
        let orange = Color32::from_rgb(230, 140, 30);
        bars(&painter, at(point), point, (y0, y1), inner.height(), orange);
        painter.circle_filled(at(point), 5.0, orange);
    }
    response.on_hover_text(
        "PSNR against the time from a geometry edit to the effective BRDF. Blue: quality levels. Orange: this scene. The errors \
         are estimated until the reference is ready.",
    );
}

/// Draws an error bar of one standard error up and down.
fn bars(
    painter: &egui::Painter,
    at: egui::Pos2,
    point: &AccuracyPoint,
    (y0, y1): (f64, f64),
    height: f32,
    color: Color32,
) {
    let half = ((point.compared.psnr_std_error_db / (y1 - y0)) as f32 * height).min(height);
    painter.line_segment([at - vec2(0.0, half), at + vec2(0.0, half)], Stroke::new(1.0, color));
}
