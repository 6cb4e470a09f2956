//! Tone mapping of linear radiance: exposure, a tone curve, sRGB encoding.

use glam::Vec3;

use crate::base::{InputError, Result};
use crate::scene;

/// Mapping of radiance to display values; it decides how radiance above 1 is displayed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToneCurve {
    /// Compresses highlights so that radiance 8 becomes white, and keeps low radiance unchanged.
    Filmic,
    /// Clamps at 1.
    Plain,
}

/// Names that `camera.tone_map` accepts.
pub const CURVES: [&str; 2] = ["filmic", "plain"];

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToneMap {
    pub curve: ToneCurve,
    /// Factor applied to radiance, `2^exposure_ev`.
    pub gain: f32,
}

impl ToneMap {
    pub fn new(camera: &scene::Camera) -> Result<Self> {
        let curve = match camera.tone_map.as_str() {
            "filmic" => ToneCurve::Filmic,
            "plain" => ToneCurve::Plain,
            other => {
                return Err(InputError::new("camera.tone_map", format!("\"{other}\""), CURVES.join(" or ")).into());
            }
        };
        if !camera.exposure_ev.is_finite() || camera.exposure_ev.abs() > 60.0 {
            return Err(InputError::new("camera.exposure_ev", camera.exposure_ev, "-60 to 60").into());
        }
        Ok(Self { curve, gain: camera.exposure_ev.exp2() })
    }

    /// Returns display-linear RGB in [0, 1]; NaN becomes black.
    pub fn apply(&self, radiance: Vec3) -> Vec3 {
        let exposed = radiance * self.gain;
        match self.curve {
            ToneCurve::Filmic => exposed.map(filmic),
            ToneCurve::Plain => exposed.map(|x| within(x, 1.0)),
        }
    }
}

/// The rational curve `x (1 + p x) / (1 + q x + r x²)` with `p = 83/64`, `q = 3/4`, `r = 21/16`. It solves
/// `f'(0) = 1, f(1) = 3/4, f(8) = 1, f'(8) = 0`. It increases from 0 to 8 and is 1 beyond.
fn filmic(x: f32) -> f32 {
    let x = within(x, 8.0);
    x * (1.0 + 1.296_875 * x) / (1.0 + 0.75 * x + 1.3125 * x * x)
}

/// Clamps `x` to `0..=high`; NaN becomes 0, because it is not above 0.
fn within(x: f32, high: f32) -> f32 {
    if x > 0.0 { x.min(high) } else { 0.0 }
}

/// Encodes linear light with the sRGB transfer function (IEC 61966-2-1).
pub fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Encodes linear light with [`srgb`] in 8 bits.
pub fn srgb_byte(linear: f32) -> u8 {
    (srgb(linear) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filmic_curve_meets_its_conditions_and_rises() {
        assert!((filmic(1e-4) / 1e-4 - 1.0).abs() < 1e-3);
        assert!((filmic(1.0) - 0.75).abs() < 1e-6);
        assert!((filmic(8.0) - 1.0).abs() < 1e-6 && filmic(1e9) == filmic(8.0));
        let rising = (0..8000).all(|k| filmic(k as f32 * 1e-3) <= filmic((k + 1) as f32 * 1e-3) + 1e-6);
        assert!(rising);
    }

    #[test]
    fn srgb_bytes_match_the_standard_at_known_points() {
        assert_eq!([0.0, 1.0, 0.214_041_14, 0.002].map(srgb_byte), [0, 255, 128, 7]);
    }

    #[test]
    fn exposure_doubles_per_stop_and_bad_radiance_is_black() {
        let camera = scene::Camera { exposure_ev: 1.0, tone_map: "plain".to_owned(), ..scene::Camera::default() };
        let map = ToneMap::new(&camera).unwrap();
        assert_eq!(map.apply(Vec3::new(0.2, 0.7, f32::NAN)), Vec3::new(0.4, 1.0, 0.0));
        let camera = scene::Camera { tone_map: "agx".to_owned(), ..camera };
        assert!(ToneMap::new(&camera).unwrap_err().to_string().contains("filmic or plain"));
    }
}
