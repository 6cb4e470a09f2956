//! A sheet of coloured shapes and lines at true scale, as SVG or PDF.

use std::fmt::Write as _;

use glam::{DVec2, Vec3};

use crate::base::{Progress, Result, progress};
use crate::render::image::tone_map::srgb_byte;

/// Line style of an outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    None,
    /// A line to cut along.
    Cut,
    /// A fold away from the reader: a ridge.
    Mountain,
    /// A fold towards the reader: a valley.
    Valley,
    /// A mark for gluing or measuring.
    Mark,
}

impl Line {
    /// Returns the dash lengths in millimetres; none for a solid line.
    fn dashes(self) -> &'static [f64] {
        match self {
            Self::Mountain => &[3.0, 1.0, 0.5, 1.0],
            Self::Valley => &[2.0, 1.0],
            Self::Mark => &[0.5, 0.5],
            Self::None | Self::Cut => &[],
        }
    }
}

/// A polygon or polyline of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct PageShape {
    /// Points in millimetres, y downwards.
    pub points: Vec<DVec2>,
    pub closed: bool,
    /// Fill colour, linear RGB.
    pub fill: Option<Vec3>,
    pub line: Line,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub struct Page {
    pub shapes: Vec<PageShape>,
    pub texts: Vec<(DVec2, String)>,
}

const MARGIN_MM: f64 = 10.0;
const LINE_MM: f64 = 0.15;
const TEXT_MM: f64 = 3.0;
/// PDF points (1/72 inch) per millimetre.
const POINTS_PER_MM: f64 = 72.0 / 25.4;

impl Page {
    pub fn polygon(&mut self, points: impl IntoIterator<Item = DVec2>, fill: Option<Vec3>, line: Line) {
        self.shapes.push(PageShape { points: points.into_iter().collect(), closed: true, fill, line });
    }

    pub fn segment(&mut self, from: DVec2, to: DVec2, line: Line) {
        self.shapes.push(PageShape { points: vec![from, to], closed: false, fill: None, line });
    }

    pub fn text(&mut self, at: DVec2, text: impl Into<String>) {
        self.texts.push((at, text.into()));
    }

    /// Returns the corner and the extent of the content, with a margin.
    pub fn bounds(&self) -> (DVec2, DVec2) {
        let points = self.shapes.iter().flat_map(|shape| &shape.points).copied();
        let text_ends = self
            .texts
            .iter()
            .flat_map(|(at, text)| [*at, *at + DVec2::new(0.6 * TEXT_MM * text.chars().count() as f64, 0.0)]);
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for point in points.chain(text_ends) {
            low = low.min(point);
            high = high.max(point);
        }
        if !low.is_finite() {
            (low, high) = (DVec2::ZERO, DVec2::ZERO);
        }
        (low - MARGIN_MM, high - low + 2.0 * MARGIN_MM)
    }

    /// Returns the page as SVG.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`] if `progress` cancels.
    pub fn svg(&self, progress: &Progress<'_>) -> Result<Vec<u8>> {
        let (corner, size) = self.bounds();
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let _ = writeln!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w:.3}mm\" height=\"{h:.3}mm\" viewBox=\"{:.3} {:.3} {w:.3} {h:.3}\">",
            corner.x,
            corner.y,
            w = size.x,
            h = size.y
        );
        let _ = writeln!(
            text,
            "<g stroke-width=\"{LINE_MM}\" stroke-linejoin=\"round\" font-family=\"sans-serif\" font-size=\"{TEXT_MM}\">"
        );
        for (k, shape) in self.shapes.iter().enumerate() {
            progress::step(progress, k, self.shapes.len())?;
            let name = if shape.closed { "polygon" } else { "polyline" };
            let points: Vec<String> = shape.points.iter().map(|p| format!("{:.4},{:.4}", p.x, p.y)).collect();
            let fill = shape.fill.map_or_else(
                || "none".to_owned(),
                |color| {
                    let [r, g, b] = color.to_array().map(srgb_byte);
                    format!("#{r:02x}{g:02x}{b:02x}")
                },
            );
            let stroke = if shape.line == Line::None { "none" } else { "black" };
            let dashes: Vec<String> = shape.line.dashes().iter().map(f64::to_string).collect();
            let dashes =
                if dashes.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", dashes.join(" ")) };
            let _ =
                writeln!(text, "<{name} points=\"{}\" fill=\"{fill}\" stroke=\"{stroke}\"{dashes}/>", points.join(" "));
        }
        for (at, label) in &self.texts {
            let label = label.replace('&', "&amp;").replace('<', "&lt;");
            let _ = writeln!(text, "<text x=\"{:.3}\" y=\"{:.3}\">{label}</text>", at.x, at.y);
        }
        text.push_str("</g>\n</svg>\n");
        Ok(text.into_bytes())
    }

    /// Returns the page as a PDF 1.4 file.
    ///
    /// # Errors
    /// The errors of [`Page::svg`].
    pub fn pdf(&self, progress: &Progress<'_>) -> Result<Vec<u8>> {
        let (corner, size) = self.bounds();
        // PDF's y points upwards.
        let at = |p: DVec2| {
            format!("{:.4} {:.4}", (p.x - corner.x) * POINTS_PER_MM, (corner.y + size.y - p.y) * POINTS_PER_MM)
        };
        let mut content = format!("{:.4} w 1 j\n", LINE_MM * POINTS_PER_MM);
        for (k, shape) in self.shapes.iter().enumerate() {
            progress::step(progress, k, self.shapes.len())?;
            for (k, point) in shape.points.iter().enumerate() {
                let _ = writeln!(content, "{} {}", at(*point), if k == 0 { "m" } else { "l" });
            }
            if let Some(color) = shape.fill {
                let [r, g, b] = color.to_array().map(|channel| f32::from(srgb_byte(channel)) / 255.0);
                let _ = writeln!(content, "{r:.4} {g:.4} {b:.4} rg");
            }
            let dashes: Vec<String> =
                shape.line.dashes().iter().map(|mm| format!("{:.3}", mm * POINTS_PER_MM)).collect();
            let _ = writeln!(content, "[{}] 0 d", dashes.join(" "));
            if shape.closed {
                content.push_str("h ");
            }
            content.push_str(match (shape.fill.is_some(), shape.line) {
                (true, Line::None) => "f\n",
                (true, _) => "B\n",
                (false, Line::None) => "n\n",
                (false, _) => "S\n",
            });
        }
        for (position, label) in &self.texts {
            let plain: String =
                label.chars().map(|c| if c.is_ascii() && !"()\\".contains(c) { c } else { ' ' }).collect();
            let _ = writeln!(content, "BT /F 8.5 Tf 0 g {} Td ({plain}) Tj ET", at(*position));
        }
        let [width, height] = (size * POINTS_PER_MM).to_array();
        let objects = [
            "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.3} {height:.3}] /Contents 4 0 R \
                 /Resources << /Font << /F << /Type /Font /Subtype /Type1 /BaseFont /Helvetica >> >> >> >>"
            ),
            format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
        ];
        let mut bytes = b"%PDF-1.4\n".to_vec();
        let mut offsets = Vec::new();
        for (k, object) in objects.iter().enumerate() {
            offsets.push(bytes.len());
            bytes.extend(format!("{} 0 obj\n{object}\nendobj\n", k + 1).bytes());
        }
        let table = bytes.len();
        bytes.extend(format!("xref\n0 {}\n0000000000 65535 f \n", objects.len() + 1).bytes());
        offsets.iter().for_each(|offset| bytes.extend(format!("{offset:010} 00000 n \n").bytes()));
        bytes.extend(
            format!("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n", objects.len() + 1).bytes(),
        );
        Ok(bytes)
    }
}
