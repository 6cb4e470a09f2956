//! Environments: latitude-longitude maps, built in or from files, and their directional lights.

mod files;
mod procedural;
mod split;

use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::{DVec3, Vec3};

use crate::base::{InputError, Result};

pub use self::split::split;

/// Names that `light.environment` accepts besides paths.
pub const BUILT_IN: [&str; 5] = ["studio", "clear_sky", "overcast_sky", "sun", "none"];

/// A map and warnings about its texels.
#[derive(Debug, Clone, Default)]
pub struct Environment {
    pub map: LatLongMap,
    pub warnings: Vec<String>,
}

/// Radiance by direction: row 0 is at the zenith (+y), the middle of a row is at -z, and columns to the right turn
/// towards +x. An empty map is black.
#[derive(Debug, Clone, Default)]
pub struct LatLongMap {
    pub width: usize,
    pub height: usize,
    /// Linear RGB radiance, row by row; finite and not negative.
    pub texels: Vec<Vec3>,
}

impl LatLongMap {
    /// Samples `radiance(direction)` at the texel centres.
    pub fn from_fn(width: usize, height: usize, radiance: impl Fn(DVec3) -> DVec3) -> Self {
        let mut map = Self { width, height, texels: Vec::with_capacity(width * height) };
        for row in 0..height {
            for column in 0..width {
                map.texels.push(radiance(map.direction(column as f64 + 0.5, row as f64 + 0.5)).as_vec3());
            }
        }
        map
    }

    /// Returns the unit direction at continuous texel coordinates; texel centres are at halves.
    pub fn direction(&self, column: f64, row: f64) -> DVec3 {
        let (sin_theta, cos_theta) = (PI * row / self.height as f64).sin_cos();
        let (sin_phi, cos_phi) = (TAU * (column / self.width as f64 - 0.5)).sin_cos();
        DVec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
    }

    /// Returns the continuous texel coordinates of a unit direction.
    pub fn texel_at(&self, direction: DVec3) -> (f64, f64) {
        let theta = direction.x.hypot(direction.z).atan2(direction.y);
        let phi = direction.x.atan2(-direction.z);
        ((phi / TAU + 0.5) * self.width as f64, theta / PI * self.height as f64)
    }

    /// Returns the exact solid angle of one texel of a row \[sr\].
    pub fn solid_angle(&self, row: usize) -> f64 {
        let edge = |row: usize| (PI * row as f64 / self.height as f64).cos();
        TAU / self.width as f64 * (edge(row) - edge(row + 1))
    }

    /// Returns `∫ L dω` over all directions, per channel.
    pub fn total(&self) -> DVec3 {
        let rows = self.texels.chunks_exact(self.width.max(1)).enumerate();
        rows.map(|(row, texels)| texels.iter().map(|t| t.as_dvec3()).sum::<DVec3>() * self.solid_angle(row)).sum()
    }
}

/// Luminance of linear Rec. 709 RGB.
pub fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Loads a built-in environment by name, or a `.hdr` or `.exr` file relative to `base_dir`.
pub fn load(name: &str, base_dir: &Path) -> Result<Environment> {
    let built_in = |map| Ok(Environment { map, warnings: Vec::new() });
    match name {
        "studio" => built_in(procedural::studio()),
        "clear_sky" => built_in(procedural::clear_sky()),
        "overcast_sky" => built_in(procedural::overcast_sky()),
        "sun" => built_in(procedural::sun()),
        "none" => built_in(LatLongMap::default()),
        path => match Path::new(path).extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("hdr") => files::load_hdr(&base_dir.join(path)),
            Some("exr") => files::load_exr(&base_dir.join(path)),
            _ => Err(unknown(name).into()),
        },
    }
}

fn unknown(name: &str) -> InputError {
    let expected = format!("{} or a .hdr or .exr file", BUILT_IN.join(", "));
    let error = InputError::new("light.environment", format!("\"{name}\""), expected);
    let distance = |known: &str| strsim::damerau_levenshtein(name, known);
    match BUILT_IN.iter().min_by_key(|known| distance(known)) {
        Some(nearest) if distance(nearest) <= 3 => error.with_hint(format!("did you mean \"{nearest}\"?")),
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texel_coordinates_and_directions_are_inverse() {
        let map = LatLongMap { width: 64, height: 32, texels: Vec::new() };
        for (column, row) in [(0.5, 0.5), (13.2, 7.9), (63.5, 31.5), (32.0, 16.0)] {
            let (c, r) = map.texel_at(map.direction(column, row));
            assert!((c - column).abs() < 1e-9 && (r - row).abs() < 1e-9);
        }
        assert!(map.direction(32.0, 16.0).distance(DVec3::NEG_Z) < 1e-12);
        assert!(map.direction(48.0, 16.0).distance(DVec3::X) < 1e-12);
    }

    #[test]
    fn solid_angles_sum_to_the_sphere() {
        let map = LatLongMap::from_fn(36, 18, |_| DVec3::ONE);
        assert!((map.total().x - 2.0 * TAU).abs() < 1e-10);
    }
}
