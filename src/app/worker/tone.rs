//! Conversion of linear radiance to pixels of a texture.

use crate::render::Image;
use crate::render::image::tone_map::{ToneMap, srgb_byte};
use eframe::egui::{Color32, ColorImage};
use rayon::prelude::*;

/// Size of the table from display-linear values to sRGB bytes. At this size, only a few dark bytes are skipped.
const STEPS: usize = 4096;

/// Applies the tone map and converts to sRGB bytes.
pub fn color_image(image: &Image, tone_map: &ToneMap) -> ColorImage {
    let table: Vec<u8> = (0..=STEPS).map(|k| srgb_byte(k as f32 / STEPS as f32)).collect();
    let byte = |value: f32| table[(value * STEPS as f32 + 0.5) as usize];
    let pixels = image.pixels.par_iter().with_min_len(4096).map(|radiance| {
        let [r, g, b] = tone_map.apply(*radiance).to_array().map(byte);
        Color32::from_rgb(r, g, b)
    });
    ColorImage::new([image.width, image.height], pixels.collect())
}
