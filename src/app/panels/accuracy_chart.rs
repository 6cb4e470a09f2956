//! The chart of accuracy against time: PSNR of quality levels and of the scene's own settings.

use eframe::egui::{
    self, Align2, Color32, FontId, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, epaint::TextShape, pos2, vec2,
};

use crate::app::worker::AccuracyPoint;

/// Height of the chart, and the margins for the labels of the axes [points].
const HEIGHT: f32 = 190.0;
const LEFT: f32 = 42.0;
const BOTTOM: f32 = 32.0;
const TEXT: f32 = 9.5;
/// Distance at which the pointer selects a point [points].
const NEAR: f32 = 12.0;
const LEVEL: Color32 = Color32::from_rgb(86, 160, 233);
const CURRENT: Color32 = Color32::from_rgb(230, 140, 30);

/// The largest number of ticks of an axis.
const MAX_TICKS: i32 = 7;

/// Positions of points.
struct Axes {
    plot: Rect,
    /// Decimal logarithms of milliseconds.
    x: (f64, f64),
    /// PSNR [dB].
    y: (f64, f64),
}

impl Axes {
    fn new(plot: Rect, points: &[&AccuracyPoint]) -> Self {
        let range = |value: fn(&AccuracyPoint) -> f64, margin: f64| {
            let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
                (low.min(value(point)), high.max(value(point)))
            });
            (low - margin, high + margin)
        };
        Self { plot, x: range(log_ms, 0.2), y: range(|point| point.compared.psnr_db, 3.0) }
    }

    fn x(&self, log_ms: f64) -> f32 {
        self.plot.left() + ((log_ms - self.x.0) / (self.x.1 - self.x.0)) as f32 * self.plot.width()
    }

    fn y(&self, db: f64) -> f32 {
        self.plot.bottom() - ((db - self.y.0) / (self.y.1 - self.y.0)) as f32 * self.plot.height()
    }

    fn at(&self, point: &AccuracyPoint) -> Pos2 {
        pos2(self.x(log_ms(point)), self.y(point.compared.psnr_db))
    }
}

fn log_ms(point: &AccuracyPoint) -> f64 {
    point.ms.max(1e-3).log10()
}

/// Draws PSNR [dB] against time [ms, logarithmic]; a stale curve is grey. Returns the level that the user clicked.
pub fn ui(
    ui: &mut Ui,
    levels: &[AccuracyPoint],
    current: Option<&AccuracyPoint>,
    is_stale: bool,
) -> Option<AccuracyPoint> {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::click());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Accuracy chart"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 4.0, ui.visuals().extreme_bg_color);
    let weak = ui.visuals().weak_text_color();
    let all: Vec<&AccuracyPoint> =
        levels.iter().chain(current).filter(|point| point.compared.psnr_db.is_finite()).collect();
    if all.is_empty() {
        let font = FontId::proportional(TEXT + 1.0);
        painter.text(area.center(), Align2::CENTER_CENTER, "Measuring the first settings", font, weak);
        return None;
    }
    let plot = Rect::from_min_max(area.min + vec2(LEFT, 8.0), area.max - vec2(10.0, BOTTOM));
    let axes = Axes::new(plot, &all);
    let color = if is_stale { weak } else { LEVEL };
    grid(ui, &painter, &axes, area);
    painter.add(Shape::line(front(&all).into_iter().map(|point| axes.at(point)).collect(), Stroke::new(1.5, color)));
    for point in levels.iter().filter(|point| point.compared.psnr_db.is_finite()) {
        mark(&painter, &axes, point, 3.0, color);
    }
    if let Some(point) = current.filter(|point| point.compared.psnr_db.is_finite()) {
        mark(&painter, &axes, point, 5.0, CURRENT);
    }
    let clicked = response.interact_pointer_pos().filter(|_| response.clicked() && !is_stale);
    let distance = |at: Pos2, point: &AccuracyPoint| axes.at(point).distance(at);
    let taken = clicked.and_then(|at| {
        let nearest = levels.iter().min_by(|a, b| distance(at, a).total_cmp(&distance(at, b)));
        nearest.filter(|point| distance(at, point) < NEAR).copied()
    });
    tooltip(response, &axes, levels, current);
    taken
}

/// Draws ticks with their numbers, and the names of the axes.
fn grid(ui: &Ui, painter: &egui::Painter, axes: &Axes, area: Rect) {
    let line = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
    let (weak, text) = (ui.visuals().weak_text_color(), ui.visuals().text_color());
    let font = FontId::proportional(TEXT);
    let plot = axes.plot;
    // Within one decade, 2 and 5 are ticks as well.
    let factors: &[f64] = if axes.x.1 - axes.x.0 > 1.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    for decade in axes.x.0.floor() as i32..=axes.x.1.floor() as i32 {
        for factor in factors {
            let value = factor * 10.0_f64.powi(decade);
            if (axes.x.0..=axes.x.1).contains(&value.log10()) {
                let x = axes.x(value.log10());
                painter.line_segment([pos2(x, plot.top()), pos2(x, plot.bottom())], line);
                let at = pos2(x, plot.bottom() + 3.0);
                painter.text(at, Align2::CENTER_TOP, format!("{value}"), font.clone(), weak);
            }
        }
    }
    let span = axes.y.1 - axes.y.0;
    let step = [5, 10, 20, 50].into_iter().find(|step| span / f64::from(*step) <= f64::from(MAX_TICKS)).unwrap_or(100);
    for tick in (axes.y.0 / f64::from(step)).ceil() as i32..=(axes.y.1 / f64::from(step)).floor() as i32 {
        let y = axes.y(f64::from(tick * step));
        painter.line_segment([pos2(plot.left(), y), pos2(plot.right(), y)], line);
        let at = pos2(plot.left() - 4.0, y);
        painter.text(at, Align2::RIGHT_CENTER, format!("{}", tick * step), font.clone(), weak);
    }
    let below = pos2(plot.center().x, area.bottom() - 3.0);
    painter.text(below, Align2::CENTER_BOTTOM, "time from a geometry edit [ms]", font.clone(), text);
    let name = painter.layout_no_wrap("PSNR against the reference [dB]".to_owned(), font, text);
    let at = pos2(area.left() + 4.0, plot.center().y + 0.5 * name.size().x);
    painter.add(TextShape { angle: -std::f32::consts::FRAC_PI_2, ..TextShape::new(at, name, text) });
}

/// The Pareto front: points that no other point beats in both time and accuracy, the fastest first.
pub fn front<'a>(points: &[&'a AccuracyPoint]) -> Vec<&'a AccuracyPoint> {
    let mut front: Vec<&AccuracyPoint> = points.to_vec();
    front.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let mut best = f64::NEG_INFINITY;
    front.retain(|point| {
        let better = point.compared.psnr_db > best;
        best = best.max(point.compared.psnr_db);
        better
    });
    front
}

/// Draws a point. An error bar is drawn once a reference was compared.
fn mark(painter: &egui::Painter, axes: &Axes, point: &AccuracyPoint, radius: f32, color: Color32) {
    let at = axes.at(point);
    if point.compared.is_stated() {
        painter.circle(at, radius, painter.ctx().global_style().visuals.extreme_bg_color, Stroke::new(1.5, color));
        return;
    }
    let half = (point.compared.psnr_std_error_db / (axes.y.1 - axes.y.0)) as f32 * axes.plot.height();
    let half = half.min(axes.plot.height());
    painter.line_segment([at - vec2(0.0, half), at + vec2(0.0, half)], Stroke::new(1.0, color));
    painter.circle_filled(at, radius, color);
}

const LEVEL_NAME: &str = "Quality level";

/// Describes the point under the pointer, or the chart.
fn tooltip(response: Response, axes: &Axes, levels: &[AccuracyPoint], current: Option<&AccuracyPoint>) {
    let distance = |point: &AccuracyPoint| response.hover_pos().map_or(f32::INFINITY, |at| axes.at(point).distance(at));
    let all = current.map(|point| (point, "This scene's settings")).into_iter();
    let all = all.chain(levels.iter().map(|point| (point, LEVEL_NAME)));
    let nearest =
        all.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0))).filter(|(point, _)| distance(point) < NEAR);
    let text = match nearest {
        Some((point, name)) if name == LEVEL_NAME => format!("{name}: {}. Click to use it.", describe(point)),
        Some((point, name)) => format!("{name}: {}", describe(point)),
        None => "PSNR against the time from a geometry edit to the effective BRDF. Blue: quality levels. Orange: this scene. \
                 Hollow points state their errors themselves; filled points are compared with a reference, and their bars \
                 are one standard error."
            .to_owned(),
    };
    response.on_hover_text(text);
}

/// Errors and time of a point in words.
pub fn describe(point: &AccuracyPoint) -> String {
    let compared = &point.compared;
    let errors = if compared.is_stated() {
        format!("PSNR about {:.0} dB, relative L2 about {:.1} % (stated)", compared.psnr_db, compared.rel_l2 * 100.0)
    } else {
        format!(
            "PSNR {:.1} ± {:.1} dB, relative L2 {:.2} ± {:.2} %",
            compared.psnr_db,
            compared.psnr_std_error_db,
            compared.rel_l2 * 100.0,
            compared.rel_l2_std_error * 100.0
        )
    };
    format!("{} facets: {errors}, {}", point.facets, milliseconds(point.ms))
}

pub fn milliseconds(ms: f64) -> String {
    if ms < 1000.0 { format!("{ms:.1} ms") } else { format!("{:.2} s", ms * 1e-3) }
}
