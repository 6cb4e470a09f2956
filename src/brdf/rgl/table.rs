//! Fields of an RGL file and their evaluation by the published method.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::tensor_file::TensorFile;
use super::warp::{Between, Grid, SliceBlend, Warp};
use crate::base::InputError;
use crate::brdf::spectrum::rgb_weights;

/// Coordinate of a polar angle on the unit square, `√(2θ/π)`.
pub(crate) fn u_of_theta(theta: f64) -> f64 {
    (theta / FRAC_PI_2).sqrt()
}

/// Coordinate of an azimuth on the unit square, `(φ+π)/2π`, wrapped to [0, 1).
pub(crate) fn u_of_phi(phi: f64) -> f64 {
    let fraction = (phi + PI) / TAU;
    fraction - fraction.floor()
}

/// Unit vector at a point of the unit square.
pub(crate) fn direction_of_u([x, y]: [f64; 2]) -> DVec3 {
    let (theta, phi) = (x * x * FRAC_PI_2, y * TAU - PI);
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

pub(crate) fn elevation(v: DVec3) -> f64 {
    v.x.hypot(v.y).atan2(v.z)
}

/// Point of a unit vector on the unit square.
pub(crate) fn u_of_direction(v: DVec3) -> [f64; 2] {
    [u_of_theta(elevation(v)), u_of_phi(v.y.atan2(v.x))]
}

/// Fields of a file for exact evaluation. The slices are ordered by `phi_i`, then `theta_i`.
pub(crate) struct RglTable {
    pub phi_i: Vec<f64>,
    pub theta_i: Vec<f64>,
    pub ndf: (Grid, Vec<f64>),
    pub sigma: (Grid, Vec<f64>),
    pub vndf: Warp,
    /// `[slice][channel][y][x]`; three channels.
    pub rgb: (Grid, Vec<f64>),
    /// True if the stored values are divided by `ndf / (4 sigma)`.
    pub jacobian: bool,
}

/// Name, shape and values of the colours: `rgb`, or `spectra` converted to RGB for daylight.
fn colors(file: &TensorFile) -> Result<(&'static str, [usize; 5], Vec<f64>), InputError> {
    if file.has("rgb") || !file.has("spectra") {
        let (shape, values) = file.floats("rgb")?;
        return Ok(("rgb", shape, values));
    }
    let ([count], wavelengths) = file.floats("wavelengths")?;
    if count < 2 || !wavelengths.windows(2).all(|pair| pair[0] < pair[1]) {
        return Err(InputError::new(
            "field \"wavelengths\"",
            format!("{count} numbers"),
            "increasing wavelengths, at least two",
        ));
    }
    let ([phis, thetas, channels, height, width], spectra) = file.floats::<5>("spectra")?;
    if channels != count {
        let expected = format!("{count} channels, as wavelengths");
        return Err(InputError::new("field \"spectra\"", format!("{channels} channels"), expected));
    }
    let weights = rgb_weights(&wavelengths);
    let plane = height * width;
    let mut rgb = Vec::with_capacity(phis * thetas * 3 * plane);
    for slice in spectra.chunks_exact((channels * plane).max(1)) {
        for channel in 0..3 {
            rgb.extend((0..plane).map(|at| {
                weights.iter().enumerate().map(|(k, weight)| weight[channel] * slice[k * plane + at]).sum::<f64>()
            }));
        }
    }
    Ok(("spectra", [phis, thetas, 3, height, width], rgb))
}

impl RglTable {
    pub(crate) fn from_fields(file: &TensorFile) -> Result<Self, InputError> {
        let ([phi_count], phi_i) = file.floats("phi_i")?;
        let ([theta_count], theta_i) = file.floats("theta_i")?;
        for (name, angles) in [("phi_i", &phi_i), ("theta_i", &theta_i)] {
            if angles.is_empty() || !angles.windows(2).all(|pair| pair[0] < pair[1]) {
                return Err(InputError::new(format!("field \"{name}\""), format!("{angles:?}"), "increasing angles"));
            }
        }
        let plane = |name: &str| {
            let ([height, width], values) = file.floats(name)?;
            Ok((Grid::new(name, width, height)?, values))
        };
        let slices = |name: &str, found: &[usize]| {
            let expected = format!("one slice for each of {phi_count} phi_i and {theta_count} theta_i");
            let matches = found[..2] == [phi_count, theta_count] && (found.len() < 3 || found[2] == 3);
            let expected = if found.len() < 3 { expected } else { expected + ", three channels" };
            if matches {
                Ok(())
            } else {
                Err(InputError::new(format!("field \"{name}\""), format!("{found:?}"), expected))
            }
        };
        let ([phis, thetas, height, width], vndf) = file.floats("vndf")?;
        slices("vndf", &[phis, thetas])?;
        let vndf_grid = Grid::new("vndf", width, height)?;
        let (channels, [phis, thetas, count, height, width], rgb) = colors(file)?;
        slices(channels, &[phis, thetas, count])?;
        let rgb_grid = Grid::new(channels, width, height)?;
        let jacobian = file.has("jacobian") && file.floats::<1>("jacobian")?.1.first().is_some_and(|&flag| flag != 0.0);
        Ok(Self {
            phi_i,
            theta_i,
            ndf: plane("ndf")?,
            sigma: plane("sigma")?,
            vndf: Warp::new(vndf_grid, vndf)?,
            rgb: (rgb_grid, rgb),
            jacobian,
        })
    }

    /// Returns true if the file has one or two azimuths, which then represent all.
    pub(crate) fn is_isotropic(&self) -> bool {
        self.phi_i.len() <= 2
    }

    /// `f_r(i,o) cosθ_o` as the file defines it, which is not reciprocal; negative interpolated values become 0. `i`
    /// and `o` are unit vectors above the surface, and the slices are those of `i`.
    pub(crate) fn eval(&self, i: DVec3, o: DVec3) -> DVec3 {
        let Some(h) = (i + o).try_normalize() else {
            return DVec3::ZERO;
        };
        let (theta_i, phi_i) = (elevation(i), i.y.atan2(i.x));
        let rotation = if self.is_isotropic() { phi_i } else { 0.0 };
        let u_h = [u_of_theta(elevation(h)), u_of_phi(h.y.atan2(h.x) - rotation)];
        let phi =
            if self.is_isotropic() { Between { lower: 0, weight: 0.0 } } else { Between::find(&self.phi_i, phi_i) };
        let slice = SliceBlend::new(phi, Between::find(&self.theta_i, theta_i), self.theta_i.len());
        let s = self.vndf.invert(slice, u_h);
        let (grid, rgb) = &self.rgb;
        let channel = |c: usize| {
            slice.mix(|slice| grid.eval(&rgb[(slice * 3 + c) * grid.len()..(slice * 3 + c + 1) * grid.len()], s))
        };
        let value = DVec3::new(channel(0), channel(1), channel(2)).max(DVec3::ZERO);
        if self.jacobian { value * self.jacobian(u_of_direction(i), u_h) } else { value }
    }

    /// `ndf(u_h) / (4 sigma(u_i))`, or 0 if sigma is not positive.
    pub(crate) fn jacobian(&self, u_i: [f64; 2], u_h: [f64; 2]) -> f64 {
        let sigma = self.sigma.0.eval(&self.sigma.1, u_i);
        let ndf = self.ndf.0.eval(&self.ndf.1, u_h);
        if sigma > 0.0 { (ndf / (4.0 * sigma)).max(0.0) } else { 0.0 }
    }
}
