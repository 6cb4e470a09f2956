//! Tables as OpenEXR: an atlas with one block per light direction, whose pixels are view directions.
//!
//! Entry `(ti, pi, to, po)` is pixel `x = pi Nφ_o + po`, `y = ti Nθ_o + to`. The first part, `brdf`, holds R, G, B of
//! `f̄ / cos θ_i`. The second part, `reciprocal_g`, holds those of `G`. The `comments` attribute of both parts is JSON
//! that includes the axes.

use std::io::{self, Cursor, Write};

use exr::image::RgbChannels;
use exr::prelude::{
    Encoding, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Text, Vec2,
    WritableImage as _,
};
use glam::Vec3;
use serde::Serialize;

use super::meta::Description;
use super::table::ExportTable;

#[derive(Serialize)]
struct Comments<'a> {
    layout: &'static str,
    theta_i: &'a [f32],
    phi_i: &'a [f32],
    theta_o: &'a [f32],
    phi_o: &'a [f32],
    #[serde(flatten)]
    description: &'a Description<'a>,
}

/// Writes both parts as f32 channels with lossless compression.
pub fn write(table: &ExportTable, description: &Description<'_>, out: &mut dyn Write) -> io::Result<()> {
    let grid = &table.grid;
    let comments = Comments {
        layout: "pixel x = pi * len(phi_o) + po, y = ti * len(theta_o) + to; part brdf, then part reciprocal_g",
        theta_i: &grid.light.theta,
        phi_i: &grid.light.phi,
        theta_o: &grid.view.theta,
        phi_o: &grid.view.phi,
        description,
    };
    // OpenEXR text is Latin-1, so JSON escapes encode other characters.
    let comments = Text::new_or_none(ascii(&serde_json::to_string(&comments)?));
    let [ti, pi, to, po] = grid.shape();
    let size = Vec2(pi * po, ti * to);
    let attributes = |name: &str| LayerAttributes { comments: comments.clone(), ..LayerAttributes::named(name) };
    let image = Image::empty(ImageAttributes::new(IntegerBounds::from_dimensions(size)))
        .with_layer(Layer::new(size, attributes("brdf"), Encoding::SMALL_LOSSLESS, channels(table, &table.brdf)))
        .with_layer(Layer::new(size, attributes("reciprocal_g"), Encoding::SMALL_LOSSLESS, channels(table, &table.g)));
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(io::Error::other)?;
    out.write_all(bytes.get_ref())
}

/// Writes one part of f32 channels R, G and B, row by row, with `comments` (JSON) as attribute.
pub(super) fn rgb(size: [usize; 2], comments: &str, values: &[Vec3], out: &mut dyn Write) -> io::Result<()> {
    let size = Vec2(size[0], size[1]);
    let channels =
        SpecificChannels::rgb(|at: Vec2<usize>| -> (f32, f32, f32) { values[at.y() * size.x() + at.x()].into() });
    let attributes = LayerAttributes { comments: Text::new_or_none(ascii(comments)), ..LayerAttributes::default() };
    let image = Image::empty(ImageAttributes::new(IntegerBounds::from_dimensions(size))).with_layer(Layer::new(
        size,
        attributes,
        Encoding::SMALL_LOSSLESS,
        channels,
    ));
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(io::Error::other)?;
    out.write_all(bytes.get_ref())
}

/// Returns R, G, B of `values` in the layout of the atlas.
fn channels<'a>(
    table: &'a ExportTable,
    values: &'a [Vec3],
) -> SpecificChannels<impl Fn(Vec2<usize>) -> (f32, f32, f32) + Sync + 'a, RgbChannels> {
    let [_, pi, to, po] = table.grid.shape();
    SpecificChannels::rgb(move |at: Vec2<usize>| {
        let (light, view) = (at.y() / to * pi + at.x() / po, at.y() % to * po + at.x() % po);
        values[light * (to * po) + view].into()
    })
}

/// Encodes JSON in ASCII: other characters, which occur only in strings, become `\uXXXX`.
fn ascii(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for character in json.chars() {
        if character.is_ascii() {
            text.push(character);
        } else {
            let mut units = [0; 2];
            for unit in character.encode_utf16(&mut units) {
                text.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    text
}
