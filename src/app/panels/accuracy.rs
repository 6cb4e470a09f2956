//! Accuracy against time: a slider from faster to finer, a chart of the scene at hand, and the comparison with the reference.

use std::sync::Arc;

use crate::plan::{Effect, Settings};
use crate::report::EffectCost;
use crate::scene::{LoadedScene, Quality, Scene};
use crate::tuning::quality_scale;
use eframe::egui::{
    self, Align2, Color32, Context, FontId, Sense, Slider, Stroke, TextureHandle, TextureOptions, Ui, pos2, vec2,
};

use super::fields;
use crate::app::worker::{AccuracyAnswer, AccuracyJob, Point};

/// What the panel holds between frames.
#[derive(Default)]
pub struct AccuracyState {
    /// The panel is unfolded: only then anything is measured.
    pub open: bool,
    /// The reference goes on refining.
    pub comparing: bool,
    /// Each effect is to be forced on and off.
    pub measuring: bool,
    /// What that gave, for a version of the document.
    pub costs: Option<(u64, Vec<EffectCost>)>,
    asked: Option<(u64, bool, bool)>,
    rungs: Vec<Point>,
    present: Option<(u64, Point)>,
    /// Its picture, mean ΔE, and the noise of that.
    difference: Option<(u64, TextureHandle, f32, Option<f32>)>,
    doing: Option<&'static str>,
    trouble: Option<String>,
}

impl AccuracyState {
    /// The job for a version of the document whose picture is finished, where it is not what was asked for last.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>) -> Option<AccuracyJob> {
        let wanted = (version, self.comparing, self.measuring);
        if !(self.open || self.measuring) || self.asked == Some(wanted) {
            return None;
        }
        self.asked = Some(wanted);
        self.trouble = None;
        let (chart, compare, effects) = (self.open, self.comparing, self.measuring);
        Some(AccuracyJob { version, loaded: loaded.clone(), chart, compare, effects })
    }

    /// Whether work that was asked for is under way for another state than this one.
    pub fn is_late(&mut self, version: u64) -> bool {
        let late = self.doing.is_some()
            && (!(self.open || self.measuring) || self.asked.is_some_and(|(asked, ..)| asked != version));
        if late {
            self.doing = None;
            self.asked = None;
        }
        late
    }

    pub fn take(&mut self, ctx: &Context, answer: AccuracyAnswer) {
        match answer {
            AccuracyAnswer::Doing(what) => self.doing = Some(what),
            AccuracyAnswer::Rungs(rungs) => self.rungs = rungs,
            AccuracyAnswer::Present(version, point) => self.present = Some((version, point)),
            AccuracyAnswer::Difference(version, shown) => {
                let texture = ctx.load_texture("difference", shown.image, TextureOptions::NEAREST);
                self.difference = Some((version, texture, shown.mean, shown.noise));
            }
            AccuracyAnswer::Effects(version, costs) => {
                self.measuring = false;
                // What was asked for is done: the rest of it goes on.
                self.asked = self.asked.map(|(version, comparing, _)| (version, comparing, false));
                self.costs = Some((version, costs));
            }
            AccuracyAnswer::Done(version) => {
                if self.asked.is_some_and(|(asked, ..)| asked == version) {
                    self.doing = None;
                }
            }
            AccuracyAnswer::Failed(text) => {
                (self.doing, self.trouble, self.measuring) = (None, Some(text), false);
            }
        }
    }

    /// Whether the chart has the present settings and all it compares them with.
    #[cfg(test)]
    pub fn is_measured(&self, version: u64) -> bool {
        self.doing.is_none() && self.rungs.len() >= 5 && self.present.is_some_and(|(measured, _)| measured == version)
    }
}

/// The panel; the slider turns the scene's knobs.
pub fn ui(ui: &mut Ui, scene: &mut Scene, state: &mut AccuracyState, effects: &[Effect], version: u64) {
    state.open = true;
    let overhangs = effects.iter().any(|effect| effect.name == "overhangs" && effect.on);
    let settings = Settings::of(scene);
    let mut rung = quality_scale::position(settings.facets);
    let tip = "Walks along settings that balance facets and directions: time against error.";
    let changed = fields::row(ui, "Faster - finer", tip, |ui| {
        ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(60.0);
        ui.add(Slider::new(&mut rung, 0.0..=quality_scale::FINEST).show_value(false)).changed()
    });
    if changed {
        let candidate = quality_scale::rung(rung, overhangs);
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
    let now = state.present.filter(|(measured, _)| *measured == version).map(|(_, point)| point);
    let words = match now {
        Some(point) => format!(
            "{} facets: {:.1} ± {:.1} dB, {:.2} ± {:.2} %, {}",
            point.facets,
            point.compared.psnr_db,
            point.compared.psnr_db_error,
            point.compared.rel_l2 * 100.0,
            point.compared.rel_l2_error * 100.0,
            milliseconds(point.ms)
        ),
        None => format!("{} facets", settings.facets),
    };
    ui.label(words);
    chart(ui, &state.rungs, now.as_ref());
    ui.horizontal(|ui| {
        ui.toggle_value(&mut state.comparing, "Compare with reference").on_hover_text(
            "Refines the reference in the background: error bars narrow, and a picture shows the difference",
        );
        if let Some(doing) = state.doing {
            ui.spinner();
            ui.weak(doing);
        }
    });
    if let Some(point) = now.filter(|_| state.comparing) {
        ui.weak(format!(
            "The reference's own error: {:.2} % after {} passes",
            point.compared.own * 100.0,
            4 * point.compared.batches
        ));
    }
    if let Some((measured, texture, mean, noise)) = &state.difference
        && *measured == version
        && state.comparing
    {
        let side = ui.available_width().min(220.0);
        ui.add(egui::Image::new(texture).fit_to_exact_size(vec2(side, side)).alt_text("Difference picture"));
        let words = match noise {
            Some(noise) => {
                format!("Difference to the reference: ΔE {mean:.2} on average, of which its noise {noise:.2}")
            }
            None => format!("Difference to 65,536 facets: ΔE {mean:.2} on average"),
        };
        ui.weak(format!("{words}; white is 10, 2 is just seen"));
    }
    if let Some(trouble) = &state.trouble {
        ui.colored_label(ui.visuals().error_fg_color, trouble);
    }
}

fn milliseconds(ms: f64) -> String {
    if ms < 1000.0 { format!("{ms:.1} ms") } else { format!("{:.2} s", ms * 1e-3) }
}

/// Decibels over milliseconds, time on a logarithmic scale.
fn chart(ui: &mut Ui, rungs: &[Point], now: Option<&Point>) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), 150.0), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Accuracy chart"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 4.0, ui.visuals().extreme_bg_color);
    let weak = ui.visuals().weak_text_color();
    let small = FontId::proportional(9.5);
    let all: Vec<&Point> = rungs.iter().chain(now).filter(|point| point.compared.psnr_db.is_finite()).collect();
    if all.is_empty() {
        painter.text(area.center(), Align2::CENTER_CENTER, "measured once the picture is finished", small, weak);
        return;
    }
    let range = |pick: fn(&Point) -> f64, margin: f64| {
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
            (low.min(pick(point)), high.max(pick(point)))
        });
        (low - margin, high + margin)
    };
    let log = |point: &Point| point.ms.max(1e-3).log10();
    let (x0, x1) = range(log, 0.2);
    let (y0, y1) = range(|point| point.compared.psnr_db, 3.0);
    let inner = area.shrink2(vec2(10.0, 14.0));
    let px = |x: f64| inner.left() + ((x - x0) / (x1 - x0)) as f32 * inner.width();
    let py = |y: f64| inner.bottom() - ((y - y0) / (y1 - y0)) as f32 * inner.height();
    let at = |point: &Point| pos2(px(log(point)), py(point.compared.psnr_db));
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
    // What nothing beats in both.
    let mut front: Vec<&Point> = all.clone();
    front.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let mut best = f64::NEG_INFINITY;
    front.retain(|point| {
        let better = point.compared.psnr_db > best;
        best = best.max(point.compared.psnr_db);
        better
    });
    let blue = Color32::from_rgb(86, 160, 233);
    painter.add(egui::Shape::line(front.iter().map(|point| at(point)).collect(), Stroke::new(1.5, blue)));
    for point in rungs.iter().filter(|point| point.compared.psnr_db.is_finite()) {
        bars(&painter, at(point), point, (y0, y1), inner.height(), blue);
        painter.circle_filled(at(point), 3.0, blue);
    }
    if let Some(point) = now.filter(|point| point.compared.psnr_db.is_finite()) {
        let orange = Color32::from_rgb(230, 140, 30);
        bars(&painter, at(point), point, (y0, y1), inner.height(), orange);
        painter.circle_filled(at(point), 5.0, orange);
    }
    response.on_hover_text(
        "Decibels over the time from a geometry edit to the effective BRDF. Blue: from faster to finer. Orange: now.",
    );
}

/// One standard error up and down.
fn bars(painter: &egui::Painter, at: egui::Pos2, point: &Point, (y0, y1): (f64, f64), height: f32, color: Color32) {
    let half = ((point.compared.psnr_db_error / (y1 - y0)) as f32 * height).min(height);
    painter.line_segment([at - vec2(0.0, half), at + vec2(0.0, half)], Stroke::new(1.0, color));
}
