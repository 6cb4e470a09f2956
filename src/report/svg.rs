//! Small charts as inline SVG: logarithmic axes, dots, lines and bars. They need neither scripts nor other style
//! sheets.

use std::fmt::Write as _;

/// Size and margins of a chart in pixels.
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 52.0;

/// A logarithmic axis.
#[derive(Debug, Clone, Copy)]
pub struct LogAxis {
    low: f64,
    high: f64,
}

impl LogAxis {
    /// An axis that contains all values and ends at half decades.
    pub fn over(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.into_iter().filter(|value| value.is_finite() && *value > 0.0) {
            low = low.min(value.log10());
            high = high.max(value.log10());
        }
        if low > high {
            return Self { low: -1.0, high: 1.0 };
        }
        let half = |x: f64, up: f64| ((x * 2.0 + up * 0.15).floor() + if up > 0.0 { 1.0 } else { 0.0 }) / 2.0;
        let (low, high) = (half(low, -1.0), half(high, 1.0));
        Self { low, high: high.max(low + 0.5) }
    }

    fn at(&self, value: f64) -> f64 {
        ((value.max(1e-300).log10() - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// Powers of ten on the axis, and 2 and 5 times them on short axes.
    fn ticks(&self) -> Vec<f64> {
        let mut ticks = Vec::new();
        let decades = (self.low.floor() as i32)..=(self.high.ceil() as i32);
        let is_long = self.high - self.low > 3.0;
        for decade in decades {
            for step in [1.0, 2.0, 5.0] {
                let tick = step * 10_f64.powi(decade);
                let inside = tick.log10() >= self.low - 1e-9 && tick.log10() <= self.high + 1e-9;
                if inside && (step == 1.0 || !is_long) {
                    ticks.push(tick);
                }
            }
        }
        ticks
    }
}

/// A chart under construction.
#[derive(Debug)]
pub struct Chart {
    body: String,
    x: LogAxis,
    y: LogAxis,
}

impl Chart {
    pub fn new(x: LogAxis, x_label: &str, y: LogAxis, y_label: &str) -> Self {
        let mut chart = Self { body: String::new(), x, y };
        for tick in x.ticks() {
            let at = chart.px(tick);
            let _ = write!(
                chart.body,
                "<line class='grid' x1='{at:.1}' x2='{at:.1}' y1='{TOP}' y2='{:.1}'/><text class='tick' x='{at:.1}' y='{:.1}' text-anchor='middle'>{}</text>",
                HEIGHT - BOTTOM,
                HEIGHT - BOTTOM + 16.0,
                number(tick)
            );
        }
        for tick in y.ticks() {
            let at = chart.py(tick);
            let _ = write!(
                chart.body,
                "<line class='grid' x1='{LEFT}' x2='{:.1}' y1='{at:.1}' y2='{at:.1}'/><text class='tick' x='{:.1}' y='{:.1}' text-anchor='end'>{}</text>",
                WIDTH - RIGHT,
                LEFT - 6.0,
                at + 4.0,
                number(tick)
            );
        }
        let _ = write!(
            chart.body,
            "<text class='label' x='{:.1}' y='{:.1}' text-anchor='middle'>{}</text><text class='label' transform='translate(15 {:.1}) rotate(-90)' text-anchor='middle'>{}</text>",
            LEFT + (WIDTH - LEFT - RIGHT) / 2.0,
            HEIGHT - 12.0,
            escape(x_label),
            TOP + (HEIGHT - TOP - BOTTOM) / 2.0,
            escape(y_label)
        );
        chart
    }

    fn px(&self, x: f64) -> f64 {
        LEFT + self.x.at(x) * (WIDTH - LEFT - RIGHT)
    }

    fn py(&self, y: f64) -> f64 {
        HEIGHT - BOTTOM - self.y.at(y) * (HEIGHT - TOP - BOTTOM)
    }

    /// Draws a dot. The browser shows `title` while the pointer is over the dot.
    pub fn dot(&mut self, x: f64, y: f64, radius: f64, color: &str, title: &str) {
        let _ = write!(
            self.body,
            "<circle cx='{:.1}' cy='{:.1}' r='{radius}' fill='{color}'><title>{}</title></circle>",
            self.px(x),
            self.py(y),
            escape(title)
        );
    }

    /// Draws a vertical error bar.
    pub fn error_bar(&mut self, x: f64, [low, high]: [f64; 2], color: &str) {
        let x = self.px(x);
        let _ = write!(
            self.body,
            "<line x1='{x:.1}' x2='{x:.1}' y1='{:.1}' y2='{:.1}' stroke='{color}' stroke-opacity='0.5'/>",
            self.py(low),
            self.py(high)
        );
    }

    /// Writes text beside a point.
    pub fn label(&mut self, x: f64, y: f64, color: &str, text: &str) {
        let (px, anchor) =
            if self.px(x) > WIDTH - 130.0 { (self.px(x) - 9.0, "end") } else { (self.px(x) + 9.0, "start") };
        let _ = write!(
            self.body,
            "<text class='mark' x='{px:.1}' y='{:.1}' fill='{color}' text-anchor='{anchor}'>{}</text>",
            self.py(y) - 7.0,
            escape(text)
        );
    }

    /// Draws a polyline.
    pub fn line(&mut self, points: &[(f64, f64)], color: &str, dashed: bool) {
        let path: Vec<String> = points.iter().map(|&(x, y)| format!("{:.1},{:.1}", self.px(x), self.py(y))).collect();
        let dash = if dashed { " stroke-dasharray='5 4'" } else { "" };
        let _ = write!(
            self.body,
            "<polyline points='{}' fill='none' stroke='{color}' stroke-width='2'{dash}/>",
            path.join(" ")
        );
    }

    /// Returns the text of an SVG file.
    pub fn file(self) -> String {
        format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}' height='{HEIGHT}' font-family='sans-serif'>\
             <style>.grid {{ stroke: #d4d4d4 }} .tick {{ font-size: 12px; fill: #555 }} .label {{ font-size: 13px }}</style>\
             <rect width='{WIDTH}' height='{HEIGHT}' fill='white'/>{}</svg>\n",
            self.body
        )
    }

    /// Returns the SVG element for an HTML page.
    pub fn finish(self) -> String {
        format!("<svg viewBox='0 0 {WIDTH} {HEIGHT}' role='img'>{}</svg>", self.body)
    }
}

/// Stacked horizontal bars of milliseconds, one bar per row, with a legend.
pub fn stacked_bars(rows: &[(String, Vec<(String, f64)>)]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in rows.iter().flat_map(|row| &row.1) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let color = |name: &str| COLORS[names.iter().position(|known| *known == name).unwrap_or(0) % COLORS.len()];
    let longest = rows.iter().map(|row| row.1.iter().map(|part| part.1).sum::<f64>()).fold(1e-9, f64::max);
    let (row_height, legend) = (28.0, 28.0);
    let height = legend + row_height * rows.len() as f64 + 8.0;
    let mut body = String::new();
    for (k, name) in names.iter().enumerate() {
        let x = LEFT + 40.0 + 110.0 * k as f64;
        let _ = write!(
            body,
            "<rect x='{x}' y='6' width='12' height='12' fill='{}'/><text class='tick' x='{}' y='16'>{}</text>",
            color(name),
            x + 17.0,
            escape(name)
        );
    }
    for (k, (label, parts)) in rows.iter().enumerate() {
        let y = legend + row_height * k as f64;
        let mut x = LEFT + 40.0;
        let scale = (WIDTH - x - 90.0) / longest;
        let _ = write!(
            body,
            "<text class='tick' x='{}' y='{}' text-anchor='end'>{}</text>",
            x - 8.0,
            y + 16.0,
            escape(label)
        );
        let total: f64 = parts.iter().map(|part| part.1).sum();
        for (name, ms) in parts {
            let width = ms * scale;
            let _ = write!(
                body,
                "<rect x='{x:.1}' y='{y:.1}' width='{width:.1}' height='20' fill='{}'><title>{} {} ms</title></rect>",
                color(name),
                escape(name),
                number(*ms)
            );
            x += width;
        }
        let _ = write!(body, "<text class='tick' x='{:.1}' y='{}'>{} ms</text>", x + 6.0, y + 15.0, number(total));
    }
    format!("<svg viewBox='0 0 {WIDTH} {height}' role='img'>{body}</svg>")
}

/// Colours that people with colour vision deficiency can distinguish (after Okabe and Ito).
pub const COLORS: [&str; 8] = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a7f00", "#666666"];

/// A number with three significant digits and without exponent.
pub fn number(x: f64) -> String {
    if !x.is_finite() {
        return "∞".to_owned();
    }
    let digits = if x == 0.0 { 0 } else { (2 - x.abs().log10().floor() as i32).clamp(0, 6) };
    let text = format!("{x:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('\'', "&#39;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_significant_digits() {
        assert_eq!([0.01234, 1.5, 12.34, 1234.6, 0.0].map(number), ["0.0123", "1.5", "12.3", "1235", "0"]);
    }

    #[test]
    fn an_axis_holds_its_values_and_survives_none() {
        let axis = LogAxis::over([3.0, 40.0, f64::INFINITY, 0.0]);
        assert!(axis.at(3.0) > 0.0 && axis.at(40.0) < 1.0, "{axis:?}");
        assert!(LogAxis::over([]).ticks().contains(&1.0));
        assert!(LogAxis::over([7.0]).ticks().len() >= 2);
    }

    #[test]
    fn text_cannot_break_out_of_a_chart() {
        let mut chart = Chart::new(LogAxis::over([1.0]), "<x>", LogAxis::over([1.0]), "y");
        chart.dot(1.0, 1.0, 3.0, "red", "a<script>'");
        assert!(!chart.finish().contains("<script>"));
    }
}
