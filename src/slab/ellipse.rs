//! Analytic distributions of slopes: Beckmann (Gaussian) and GGX, stretched along any two perpendicular axes.

use std::f64::consts::{PI, TAU};

use glam::{DMat2, DVec2, DVec3};

/// A family of distributions of slopes. `q = mᵀ S⁻¹ m` with the matrix of squared roughnesses `S`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// `exp(-q) / (π √|S|)`: Gaussian with the covariance `S/2`.
    Beckmann,
    /// `1 / (π √|S| (1 + q)²)`; its variance is infinite.
    Ggx,
}

/// A distribution of slopes of one family, with mean 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    pub profile: Profile,
    /// Squared roughnesses `S`.
    pub squares: DMat2,
    pub(super) inverse: DMat2,
    /// `S = L Lᵀ`, lower triangular.
    root: DMat2,
    /// `1 / (π √|S|)`.
    peak: f64,
}

/// Smallest roughness of an axis beside a rough one. A line of slopes has no density.
const MIN_ROUGHNESS: f64 = 1e-4;

impl Ellipse {
    /// A distribution with the roughnesses `roughness` along axes that are turned by `rotation` [rad]. `None` if both
    /// roughnesses are 0: then all facets are level.
    pub fn new(profile: Profile, roughness: DVec2, rotation: f64) -> Option<Self> {
        let roughness = roughness.abs();
        if roughness.max_element().is_nan() || roughness.max_element() <= 0.0 {
            return None;
        }
        let roughness = roughness.max(DVec2::splat(MIN_ROUGHNESS));
        let turn = DMat2::from_angle(rotation);
        Some(Self::of_squares(profile, turn * DMat2::from_diagonal(roughness * roughness) * turn.transpose()))
    }

    /// A distribution with the matrix `S` of squared roughnesses, which is positive definite.
    fn of_squares(profile: Profile, squares: DMat2) -> Self {
        let a = squares.x_axis.x.sqrt();
        let b = squares.x_axis.y / a;
        let c = (squares.y_axis.y - b * b).max(MIN_ROUGHNESS * MIN_ROUGHNESS * 1e-4).sqrt();
        let root = DMat2::from_cols(DVec2::new(a, b), DVec2::new(0.0, c));
        Self { profile, squares, inverse: squares.inverse(), root, peak: 1.0 / (PI * a * c) }
    }

    /// Density of the slope `m`.
    pub fn density(&self, m: DVec2) -> f64 {
        let q = m.dot(self.inverse * m);
        self.peak
            * match self.profile {
                Profile::Beckmann => (-q).exp(),
                Profile::Ggx => 1.0 / ((1.0 + q) * (1.0 + q)),
            }
    }

    /// The slope at a point of the unit square; points spread evenly give slopes spread as the density.
    pub fn slope(&self, u: f64, v: f64) -> DVec2 {
        // The limit keeps the slopes of GGX below some ten thousand times the roughness.
        let u = u.clamp(0.0, 1.0 - 1e-9);
        let radius = match self.profile {
            Profile::Beckmann => (-(-u).ln_1p()).sqrt(),
            Profile::Ggx => (u / (1.0 - u)).sqrt(),
        };
        let (sin, cos) = (TAU * v).sin_cos();
        self.root * (radius * DVec2::new(cos, sin))
    }

    /// The slope of a facet that the direction `w` above sees, at a point of the unit square: random points give facets by their
    /// areas as seen along `w` (Heitz 2018). `None` for Beckmann.
    pub fn visible_slope(&self, w: DVec3, u: f64, v: f64) -> Option<DVec2> {
        if self.profile != Profile::Ggx {
            return None;
        }
        let stretched = (self.root.transpose() * w.truncate()).extend(w.z).try_normalize()?;
        let across = DVec2::new(-stretched.y, stretched.x).try_normalize().unwrap_or(DVec2::X).extend(0.0);
        let along = stretched.cross(across);
        let (sin, cos) = (TAU * v).sin_cos();
        let (s, t) = (u.sqrt() * cos, u.sqrt() * sin);
        let half = 0.5 * (1.0 + stretched.z);
        let t = (1.0 - half) * (1.0 - s * s).max(0.0).sqrt() + half * t;
        let normal = s * across + t * along + (1.0 - s * s - t * t).max(0.0).sqrt() * stretched;
        (normal.z > 1e-9).then(|| self.root * (normal.truncate() / normal.z))
    }

    /// Smith's Λ of a direction `w` with `k = w.xy / w.z` (Walter et al. 2007, Eqs. 34 and 25 for Beckmann and GGX).
    pub fn lambda(&self, k: DVec2) -> f64 {
        let square = k.dot(self.squares * k).max(0.0);
        match self.profile {
            Profile::Ggx => 0.5 * ((1.0 + square).sqrt() - 1.0),
            Profile::Beckmann => {
                let v = 1.0 / square.sqrt();
                // Λ(4.5) is below 3e-12.
                if v > 4.5 {
                    return 0.0;
                }
                (0.5 * ((-v * v).exp() / (v * PI.sqrt()) - libm::erfc(v))).max(0.0)
            }
        }
    }

    /// Mean squared slope of Beckmann; for GGX, whose variance is infinite, the value of a Beckmann distribution of the
    /// same roughness.
    pub fn variance(&self) -> f64 {
        0.5 * (self.squares.x_axis.x + self.squares.y_axis.y)
    }

    /// Largest slope along one axis that a table of this distribution should hold.
    pub fn span(&self) -> f64 {
        let widest = self.squares.x_axis.x.max(self.squares.y_axis.y).sqrt();
        match self.profile {
            // Beyond 3.2 roughnesses lie 4e-5 of the slopes.
            Profile::Beckmann => 3.2 * widest,
            // Beyond 14 roughnesses lie 0.5 % of the slopes.
            Profile::Ggx => 14.0 * widest,
        }
    }

    /// Returns true if both roughnesses are the same.
    pub fn is_round(&self) -> bool {
        let (x, y) = (self.squares.x_axis.x, self.squares.y_axis.y);
        (x - y).abs() <= 1e-9 * (x + y) && self.squares.x_axis.y.abs() <= 1e-9 * (x + y)
    }

    /// Smallest roughness of any axis.
    pub fn narrowest(&self) -> f64 {
        let (trace, determinant) = (self.squares.x_axis.x + self.squares.y_axis.y, self.squares.determinant());
        let difference = (trace * trace - 4.0 * determinant).max(0.0).sqrt();
        (0.5 * (trace - difference)).max(0.0).sqrt()
    }

    /// The distribution of `m_a - m_b` for independent slopes: squares add. `None` unless both are Beckmann.
    pub fn difference(&self, other: &Self) -> Option<Self> {
        let closed = self.profile == Profile::Beckmann && other.profile == Profile::Beckmann;
        closed.then(|| Self::of_squares(Profile::Beckmann, self.squares + other.squares))
    }
}

#[cfg(test)]
#[path = "ellipse_tests.rs"]
mod tests;
