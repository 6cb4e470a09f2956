//! The window on a folder of photographs: its dots, a photograph, a slice of the data, and the distribution of slopes of a pixel.

use std::path::PathBuf;

use eframe::egui::{
    self, Align2, Color32, Context, FontId, Image, Pos2, Rect, Sense, Stroke, TextureHandle, TextureOptions, Ui, pos2,
    vec2,
};
use glam::DVec2;

use super::spinner::spinner;
use crate::app::theme;
use crate::app::worker::{CaptureJob, CaptureResult, ShownCapture};

/// Sides of the photograph and of the monitor, and height of the slice [points].
const SIDE: f32 = 300.0;
const SLICE: f32 = 170.0;
/// Fewest dots of a slice.
const FEWEST: usize = 3;
const MEASURED: Color32 = Color32::from_rgb(255, 170, 60);

/// State of the window between frames.
#[derive(Default)]
pub struct CaptureState {
    /// The content of the window; `None` while it is closed.
    wanted: Option<CaptureJob>,
    requested: Option<CaptureJob>,
    pub shown: Option<Box<ShownCapture>>,
    textures: Option<[TextureHandle; 2]>,
    pub error: Option<String>,
}

impl CaptureState {
    /// Opens the window on a folder.
    pub fn open(&mut self, folder: PathBuf) {
        let wanted = CaptureJob { folder, camera: 0, place: [0.5; 2], dot: None };
        *self = Self { wanted: Some(wanted), ..Self::default() };
    }

    /// Returns the job for what the window shows, unless it is the last request.
    pub fn job(&mut self) -> Option<CaptureJob> {
        let wanted = self.wanted.clone().filter(|wanted| self.requested.as_ref() != Some(wanted))?;
        self.requested = Some(wanted.clone());
        Some(wanted)
    }

    pub fn receive(&mut self, ctx: &Context, result: CaptureResult) {
        let folder = self.wanted.as_ref().map(|wanted| &wanted.folder);
        match result {
            CaptureResult::Shown(shown) if folder == Some(&shown.job.folder) => {
                let lobe = shown.lobe.as_ref().map(|lobe| lobe.image.clone());
                let images = [shown.photograph.clone(), lobe.unwrap_or_default()];
                let name = |at: usize| ["photograph", "slopes"][at];
                let mut at = 0;
                self.textures = Some(images.map(|image| {
                    at += 1;
                    ctx.load_texture(name(at - 1), image, TextureOptions::NEAREST)
                }));
                (self.shown, self.error) = (Some(shown), None);
            }
            CaptureResult::Failed(of, text) if of.is_none() || folder == of.as_ref() => self.error = Some(text),
            // The window shows another folder, or is closed.
            CaptureResult::Shown(_) | CaptureResult::Failed(..) => {}
        }
    }

    /// Draws the window while it is open.
    pub fn ui(&mut self, ctx: &Context) {
        let Some(mut wanted) = self.wanted.clone() else { return };
        let mut open = true;
        let window = egui::Window::new("Captured photographs").open(&mut open).resizable(false).collapsible(false);
        let center = ctx.content_rect().center();
        window.pivot(Align2::CENTER_CENTER).default_pos(center).show(ctx, |ui| {
            ui.set_width(2.0 * SIDE + 12.0);
            ui.add(egui::Label::new(wanted.folder.display().to_string()).truncate());
            if let Some(error) = &self.error {
                ui.colored_label(ui.visuals().error_fg_color, error);
            }
            match (&self.shown, &self.textures) {
                (Some(shown), Some(textures)) => shown_ui(ui, shown, textures, &mut wanted),
                _ if self.error.is_none() => {
                    ui.horizontal(|ui| {
                        spinner(ui, 14.0, ui.visuals().strong_text_color());
                        ui.label("Reading the photographs");
                    });
                }
                _ => {}
            }
        });
        self.wanted = open.then_some(wanted);
        if self.wanted.is_none() {
            *self = Self::default();
        }
    }
}

fn shown_ui(ui: &mut Ui, shown: &ShownCapture, [photograph, slopes]: &[TextureHandle; 2], wanted: &mut CaptureJob) {
    let ([columns, rows], [width, height]) = (shown.size, shown.photographed);
    let thinned =
        if shown.size == shown.photographed { String::new() } else { format!(", {columns} x {rows} of them read") };
    ui.horizontal(|ui| {
        ui.weak(format!("{} dots, {width} x {height} pixels{thinned}", shown.dots.len()));
        for camera in 0..shown.cameras {
            if shown.cameras > 1 {
                ui.selectable_value(&mut wanted.camera, camera, format!("Camera {}", camera + 1));
            }
        }
    });
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| {
            ui.set_width(SIDE);
            ui.strong(match shown.job.dot {
                Some(dot) => format!("Photograph of dot {dot}"),
                None => "Mean of all photographs".to_owned(),
            });
            photograph_ui(ui, shown, photograph, wanted);
        });
        ui.vertical(|ui| {
            ui.set_width(SIDE);
            ui.strong("Monitor: light of each dot at this pixel");
            monitor_ui(ui, shown, wanted);
        });
    });
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| {
            ui.set_width(SIDE);
            ui.strong("Slice through the brightest dot");
            slice_ui(ui, shown);
        });
        ui.vertical(|ui| {
            ui.set_width(SIDE);
            ui.strong("Slopes of this pixel");
            slopes_ui(ui, shown, slopes);
        });
    });
}

/// Draws a photograph. The user picks a pixel.
fn photograph_ui(ui: &mut Ui, shown: &ShownCapture, texture: &TextureHandle, wanted: &mut CaptureJob) {
    let (area, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Photograph"));
    let size = vec2(shown.size[0] as f32, shown.size[1] as f32);
    let image = Rect::from_center_size(area.center(), size * (SIDE / size.max_elem()));
    ui.painter().rect_filled(area, 0.0, Color32::from_gray(12));
    let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().image(texture.id(), image, uv, Color32::WHITE);
    if let Some(at) = response.interact_pointer_pos() {
        let part = ((at - image.min) / image.size()).clamp(egui::Vec2::ZERO, egui::Vec2::splat(1.0));
        wanted.place = [part.x, 1.0 - part.y];
    }
    let at = image.min + vec2(wanted.place[0], 1.0 - wanted.place[1]) * image.size();
    let line = Stroke::new(1.0, theme::ACCENT);
    ui.painter().circle_stroke(at, 5.0, line);
    ui.painter().circle_stroke(at, 6.0, Stroke::new(1.0, Color32::BLACK));
    response.on_hover_text("Click or drag to pick a pixel. Magenta: saturated or broken values");
}

/// Draws the dots at their places, as bright as the pixel sees them. A click shows the photograph of a dot, or all again.
fn monitor_ui(ui: &mut Ui, shown: &ShownCapture, wanted: &mut CaptureJob) {
    let (area, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::click());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Dots on the monitor"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 0.0, Color32::from_gray(12));
    let extent = |value: fn(&DVec2) -> f64| {
        shown
            .dots
            .iter()
            .map(value)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let (x, y) = (extent(|dot| dot.x), extent(|dot| dot.y));
    let scale = f64::from(SIDE - 24.0) / (x.1 - x.0).max(y.1 - y.0).max(1e-12);
    let middle = DVec2::new(0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1));
    let at = |dot: &DVec2| -> Pos2 {
        let from_middle = (*dot - middle) * scale;
        area.center() + vec2(from_middle.x as f32, -from_middle.y as f32)
    };
    let most =
        shown.radiances.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max).max(f32::MIN_POSITIVE);
    let radius = (0.42 * (SIDE - 24.0) / (shown.dots.len() as f32).sqrt()).clamp(1.0, 6.0);
    for (dot, radiance) in shown.dots.iter().zip(&shown.radiances) {
        // A square root makes faint dots visible.
        let grey = (255.0 * (radiance / most).max(0.0).sqrt()) as u8;
        let color =
            if radiance.is_finite() { Color32::from_gray(grey.max(24)) } else { Color32::from_rgb(255, 0, 255) };
        painter.circle_filled(at(dot), radius, color);
    }
    if let Some(dot) = wanted.dot.and_then(|dot| shown.dots.get(dot)) {
        painter.circle_stroke(at(dot), radius + 2.0, Stroke::new(1.5, theme::ACCENT));
    }
    if let Some(pressed) = response.interact_pointer_pos().filter(|_| response.clicked()) {
        let distance = |dot: &DVec2| at(dot).distance(pressed);
        let nearest =
            (0..shown.dots.len()).min_by(|a, b| distance(&shown.dots[*a]).total_cmp(&distance(&shown.dots[*b])));
        wanted.dot = nearest.filter(|dot| wanted.dot != Some(*dot));
    }
    response
        .on_hover_text("Each dot as bright as the pixel sees it (square root). A click shows the photograph of a dot");
}

/// The dots in a row with the brightest one, along x.
fn slice(shown: &ShownCapture) -> Vec<usize> {
    let value = |dot: &usize| if shown.measured[*dot].is_finite() { shown.measured[*dot] } else { f64::NEG_INFINITY };
    let Some(brightest) = (0..shown.dots.len()).max_by(|a, b| value(a).total_cmp(&value(b))) else { return Vec::new() };
    let y = shown.dots[brightest].y;
    let reach = shown.dots.iter().map(|dot| (dot.y - y).abs()).fold(0.0, f64::max);
    let mut row: Vec<usize> =
        (0..shown.dots.len()).filter(|dot| (shown.dots[*dot].y - y).abs() <= 1e-6 * reach).collect();
    row.sort_by(|a, b| shown.dots[*a].x.total_cmp(&shown.dots[*b].x));
    row
}

/// Draws the measured BTDF along x, and that of the model.
fn slice_ui(ui: &mut Ui, shown: &ShownCapture) {
    let (area, response) = ui.allocate_exact_size(vec2(SIDE, SLICE), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Slice of the data"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 2.0, ui.visuals().extreme_bg_color);
    let (font, weak) = (FontId::proportional(9.5), ui.visuals().weak_text_color());
    let row = slice(shown);
    if row.len() < FEWEST {
        painter.text(area.center(), Align2::CENTER_CENTER, "No row of dots", font, weak);
        return;
    }
    let model = |dot: usize| shown.model.as_ref().map(|model| model[dot]);
    let values = row.iter().flat_map(|dot| [Some(shown.measured[*dot]), model(*dot)]).flatten();
    let most = values.filter(|value| value.is_finite()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let plot = Rect::from_min_max(area.min + vec2(8.0, 16.0), area.max - vec2(8.0, 18.0));
    let (from, to) = (shown.dots[row[0]].x, shown.dots[row[row.len() - 1]].x);
    let at = |dot: usize, value: f64| {
        let x = plot.left() + ((shown.dots[dot].x - from) / (to - from).max(1e-12)) as f32 * plot.width();
        pos2(x, plot.bottom() - (value / most) as f32 * plot.height())
    };
    let line: Vec<Pos2> = row.iter().filter_map(|dot| Some(at(*dot, model(*dot)?))).collect();
    painter.add(egui::Shape::line(line, Stroke::new(1.5, theme::ACCENT)));
    for dot in row.iter().filter(|dot| shown.measured[**dot].is_finite()) {
        painter.circle_filled(at(*dot, shown.measured[*dot]), 2.2, MEASURED);
    }
    painter.text(area.left_top() + vec2(6.0, 3.0), Align2::LEFT_TOP, format!("{most:.3} /sr"), font.clone(), weak);
    let legend = "dots: measured, line: model";
    painter.text(area.right_top() + vec2(-6.0, 3.0), Align2::RIGHT_TOP, legend, font.clone(), weak);
    let text = format!("x = {:.1} to {:.1} mm on the monitor", 1e3 * from, 1e3 * to);
    painter.text(area.center_bottom() - vec2(0.0, 3.0), Align2::CENTER_BOTTOM, text, font, weak);
    response.on_hover_text(
        "BTDF without its diffuse part, a mean of the channels, for the dots in a row with the brightest one",
    );
}

fn slopes_ui(ui: &mut Ui, shown: &ShownCapture, texture: &TextureHandle) {
    let Some(lobe) = &shown.lobe else {
        ui.weak("This pixel shows no lobe.");
        return;
    };
    ui.horizontal_top(|ui| {
        ui.add(Image::new(texture).fit_to_exact_size(vec2(SLICE, SLICE)).alt_text("Distribution of slopes"));
        ui.vertical(|ui| {
            ui.label(format!("Roughness {:.3}", lobe.roughness));
            ui.label(format!("Alpha {:.2}", lobe.alpha)).on_hover_text("Share of the roughness on the top face");
            ui.label(format!("Residual {:.1} %", 100.0 * lobe.residual));
            ui.label(format!("Diffuse {:.4} /sr", shown.diffuse));
            ui.weak(format!("Slopes up to ±{:.2}", lobe.span));
        });
    });
}
