//! Sampled heights of the surface as visible from above, and a 16-bit image of them.

use glam::{DVec2, UVec2};

use super::TileOptions;
use crate::base::{Error, Progress, Result, progress};
use crate::geometry::TileMesh;

/// Heights at regularly spaced points of one period, in tile units.
pub struct SampledHeights {
    pub count: UVec2,
    /// Heights row by row, y upwards.
    pub values: Vec<f64>,
    /// Number of points that no triangle covers; they have the lowest height.
    pub holes: usize,
}

impl SampledHeights {
    /// Samples the highest triangle over each point `((i + shift)/nx, (j + shift)/ny)` of the tile.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` cancels.
    pub fn from_above(mesh: &TileMesh, count: UVec2, shift: f64, progress: &Progress<'_>) -> Result<Self> {
        let step = mesh.size.as_dvec2() / count.as_dvec2();
        let mut values = vec![f64::NEG_INFINITY; (count.x * count.y) as usize];
        for triangle in 0..mesh.triangles.len() {
            progress::step(progress, triangle, mesh.triangles.len())?;
            let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
            let flat = [a, b, c].map(|p| p.truncate());
            let area = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]);
            if area.abs() < 1e-15 {
                continue;
            }
            let (low, high) = (flat[0].min(flat[1]).min(flat[2]), flat[0].max(flat[1]).max(flat[2]));
            let (first, last) = ((low / step - shift).floor(), (high / step - shift).ceil());
            for j in first.y as i64..=last.y as i64 {
                for i in first.x as i64..=last.x as i64 {
                    let at = (DVec2::new(i as f64, j as f64) + shift) * step;
                    let weight = |p: DVec2, q: DVec2| (q - p).perp_dot(at - p) / area;
                    let [u, v, w] = [weight(flat[1], flat[2]), weight(flat[2], flat[0]), weight(flat[0], flat[1])];
                    // Rounding must not open a seam between neighbours.
                    if u.min(v).min(w) < -1e-7 {
                        continue;
                    }
                    let (x, y) = (i.rem_euclid(i64::from(count.x)), j.rem_euclid(i64::from(count.y)));
                    let height = &mut values[(y * i64::from(count.x) + x) as usize];
                    *height = height.max(u * a.z + v * b.z + w * c.z);
                }
            }
        }
        let holes = values.iter().filter(|value| !value.is_finite()).count();
        let lowest = f64::from(mesh.z_range().0);
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = lowest);
        Ok(Self { count, values, holes })
    }

    /// Returns a height of the periodic surface.
    pub fn at(&self, i: u32, j: u32) -> f64 {
        self.values[((j % self.count.y) * self.count.x + i % self.count.x) as usize]
    }

    /// Returns the lowest and the highest value.
    pub fn range(&self) -> (f64, f64) {
        self.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &z| (low.min(z), high.max(z)))
    }
}

/// Returns a PNG with 16 bits and notes on it. 0 is the lowest and 65535 the highest height, and row 0 is at y = 0. The
/// geometry `heightfield` reads this file.
pub fn png(
    mesh: &TileMesh,
    options: &TileOptions,
    unit: &str,
    progress: &Progress<'_>,
) -> Result<(Vec<u8>, Vec<String>)> {
    let heights = SampledHeights::from_above(mesh, options.samples, 0.5, &progress::part(progress, 0.0, 0.5))?;
    let (low, high) = heights.range();
    let scale = if high > low { 65535.0 / (high - low) } else { 0.0 };
    let [width, height] = (options.samples * options.repeat).to_array();
    let mut pixels = Vec::with_capacity(2 * (width * height) as usize);
    for j in 0..height {
        progress::report(progress, 0.5 + 0.25 * j as f32 / height as f32)?;
        for i in 0..width {
            let value = ((heights.at(i, j) - low) * scale).round() as u16;
            pixels.extend(value.to_ne_bytes());
        }
    }
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &pixels, width, height, image::ExtendedColorType::L16)
        .map_err(|error| Error::failed(format!("PNG: {error}")))?;
    let mut notes =
        vec![format!("0 is z = {low} {unit}, 65535 is z = {high}: `height_scale = {}`", (high - low) as f32)];
    notes.push("row 0 of the image is y = 0; a sample is the middle of its pixel".to_owned());
    if heights.holes > 0 {
        notes.push(format!(
            "{} of {} samples are holes and stand at the lowest height",
            heights.holes,
            heights.values.len()
        ));
    }
    Ok((bytes, notes))
}
