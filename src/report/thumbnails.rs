//! Small images of a scene at different settings, and their ΔE from the finest image.

use std::fmt::Write as _;

use glam::Vec3;

use crate::base::{Cancel, Result};
use crate::effective::Reflectance;
use crate::reference::Reference;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::{ToneMap, srgb_byte};
use crate::render::render;
use crate::render::{Image, RenderInput, RenderScene};
use crate::scene::LoadedScene;

/// Pixels per side.
const SIZE: usize = 120;
/// Largest number of lights.
const LIGHTS: usize = 8;

/// Renders a scene's object with different materials.
pub struct ThumbnailRenderer {
    render_scene: RenderScene,
    tone_map: ToneMap,
}

impl ThumbnailRenderer {
    /// # Errors
    /// Returns an error if the object, the environment or the camera cannot be used.
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        let mut fewer_lights = loaded.clone();
        fewer_lights.scene.light.count = fewer_lights.scene.light.count.min(LIGHTS);
        let render_scene = RenderScene::new(&fewer_lights)?;
        let tone_map = ToneMap::new(&render_scene.camera)?;
        Ok(Self { render_scene, tone_map })
    }

    /// # Errors
    /// Returns an error if the camera cannot frame the object.
    pub fn image(&self, material: &dyn Reflectance) -> Result<Image> {
        // Differences of these images are measured, and a noisy reference must not be interpolated.
        let background = ImageBackground::default();
        let input = self.render_scene.input(material, [SIZE, SIZE], 1, &background);
        Ok(render(&RenderInput { tolerance: 0.0, ..input })?.image)
    }

    /// The image as a PNG in a `data:` URL.
    ///
    /// # Errors
    /// Returns an error if the image cannot be encoded.
    pub fn png(&self, image: &Image) -> Result<String> {
        data_url(image, &self.tone_map)
    }

    /// A noisy image of the reference. The mean over many seeds converges to it. `None` if an image takes too long.
    ///
    /// # Errors
    /// Returns the errors of [`ThumbnailRenderer::image`], and [`crate::base::Error::Cancelled`].
    pub fn reference_image(&self, reference: &Reference<'_>, seed: u64, cancel: &Cancel) -> Result<Option<Image>> {
        let image = reference
            .stochastic_reference(seed, cancel)
            .map(|stochastic_reference| self.image(&stochastic_reference))
            .transpose()?;
        cancel.check()?;
        Ok(image)
    }

    /// CIE 1976 ΔE of each pixel after tone mapping.
    pub fn difference(&self, a: &Image, b: &Image) -> Vec<f32> {
        let lab = |p: &Vec3| lab(self.tone_map.apply(*p));
        a.pixels.iter().zip(&b.pixels).map(|(a, b)| lab(a).distance(lab(b))).collect()
    }
}

/// An image of ΔE as a `data:` URL: black is 0, white is [`FULL_SCALE`] or more.
///
/// # Errors
/// Returns an error if the image cannot be encoded.
pub fn difference_png(delta_e: &[f32]) -> Result<String> {
    let pixels = delta_e.iter().map(|delta| heat(*delta)).collect();
    let plain = ToneMap { curve: crate::render::image::tone_map::ToneCurve::Plain, gain: 1.0 };
    data_url(&Image { width: SIZE, height: SIZE, pixels }, &plain)
}

/// ΔE that difference images show as white. A ΔE of about 2 is just visible side by side.
pub const FULL_SCALE: f32 = 10.0;

/// The colour of a ΔE: black, purple, orange, and white for [`FULL_SCALE`] or more.
pub fn heat(delta_e: f32) -> Vec3 {
    let x = (delta_e / FULL_SCALE).clamp(0.0, 1.0);
    Vec3::new(
        (2.2 * x).min(1.0),
        (1.6 * x - 0.45).clamp(0.0, 1.0),
        if x < 0.4 { x } else { (2.5 * x - 1.5).max(0.4 - (x - 0.4)) }.clamp(0.0, 1.0),
    )
}

/// Converts display-linear Rec. 709 to CIE L*a*b* (D65).
fn lab(rgb: Vec3) -> Vec3 {
    let x = rgb.dot(Vec3::new(0.412_456, 0.357_576, 0.180_437)) / 0.950_47;
    let y = rgb.dot(Vec3::new(0.212_673, 0.715_152, 0.072_175));
    let z = rgb.dot(Vec3::new(0.019_334, 0.119_192, 0.950_304)) / 1.088_83;
    let f = |t: f32| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    Vec3::new(116.0 * f(y) - 16.0, 500.0 * (f(x) - f(y)), 200.0 * (f(y) - f(z)))
}

fn data_url(image: &Image, tone_map: &ToneMap) -> Result<String> {
    let bytes = image.png_bytes(tone_map)?;
    Ok(format!("data:image/png;base64,{}", base64(&bytes)))
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - chunk.len()));
        for k in 0..4 {
            if k <= chunk.len() {
                let _ = write!(text, "{}", LETTERS[(word >> (18 - 6 * k) & 63) as usize] as char);
            } else {
                text.push('=');
            }
        }
    }
    text
}

/// The colour scale of difference images as HTML.
pub fn scale_strip() -> String {
    let mut cells = String::new();
    for k in 0..=10 {
        let color = heat(k as f32 / 10.0 * FULL_SCALE).to_array().map(srgb_byte);
        let _ = write!(cells, "<span style='background:rgb({},{},{})'></span>", color[0], color[1], color[2]);
    }
    format!("<span class='strip'>0 {cells} {FULL_SCALE} ΔE</span>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // RFC 4648, Sec. 10.
        for (text, code) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(text.as_bytes()), code);
        }
    }

    #[test]
    fn white_is_a_hundred_without_hue() {
        let white = lab(Vec3::ONE);
        assert!((white.x - 100.0).abs() < 1e-2 && white.y.abs() < 0.02 && white.z.abs() < 0.02, "{white}");
    }
}
