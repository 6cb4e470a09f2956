//! Slopes that are seen and lit on a surface with Gaussian slopes (Heitz et al. 2013, Sec. 5.2).

mod weighted;

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::{Normal, normal};
pub use weighted::{Focus, SlopeDriver};

/// Normally distributed slopes `(∂h/∂x, ∂h/∂y)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes {
    pub mean: DVec2,
    /// Covariance: xx, xy, yy.
    pub covariance: [f64; 3],
}

/// The polar angle's cotangent and the azimuth's unit vector of a direction. The horizon has cotangent 0, and so has
/// every direction below it.
pub fn cotangent(direction: DVec3) -> (f64, DVec2) {
    let across = direction.truncate();
    let sine = across.length();
    if sine == 0.0 {
        return (f64::INFINITY, DVec2::X);
    }
    (direction.z.max(0.0) / sine, across / sine)
}

/// A direction from its polar angle and azimuth [rad]. Angles at or beyond the horizon lie on it exactly.
pub fn direction(theta: f64, phi: f64) -> DVec3 {
    let (sin_phi, cos_phi) = phi.sin_cos();
    let (sine, cosine) = if theta.abs() >= FRAC_PI_2 { (1.0, 0.0) } else { theta.sin_cos() };
    DVec3::new(sine * cos_phi, sine * sin_phi, cosine)
}

impl Slopes {
    /// Variance along a unit vector.
    pub fn variance_along(&self, t: DVec2) -> f64 {
        (t.x * self.times(t).x + t.y * self.times(t).y).max(0.0)
    }

    /// The covariance times a vector.
    fn times(&self, t: DVec2) -> DVec2 {
        let [xx, xy, yy] = self.covariance;
        DVec2::new(xx * t.x + xy * t.y, xy * t.x + yy * t.y)
    }

    /// `(cot θ - mean along the azimuth) / deviation along it`, of which masking and visible slopes are functions. Infinite
    /// for slopes that do not vary and face the direction.
    pub fn nu(&self, direction: DVec3) -> f64 {
        let (cot, t) = cotangent(direction);
        let (above, deviation) = (cot - self.mean.dot(t), self.variance_along(t).sqrt());
        if deviation > 0.0 {
            above / deviation
        } else if above > 0.0 {
            f64::INFINITY
        } else {
            0.0
        }
    }

    /// Λ of a direction (Eq. 3).
    pub fn lambda(&self, direction: DVec3) -> f64 {
        super::heights::lambda(self.nu(direction))
    }

    /// The slopes that a viewer sees: density `p(s) (cot θ - s·t)+`, as its mean and covariance, which are exact for any
    /// mean and covariance.
    pub fn visible(&self, o: DVec3) -> Self {
        let (_, t) = cotangent(o);
        let deviation = self.variance_along(t).sqrt();
        let nu = self.nu(o);
        if !(deviation > 0.0 && nu < 1e8) {
            return *self;
        }
        let (mean, variance) = visible_moments(nu);
        // In deviations, slopes towards the viewer are -s·t.
        let shift = self.times(t) / deviation;
        let change = variance - 1.0;
        let [xx, xy, yy] = self.covariance;
        Self {
            mean: self.mean - shift * mean,
            covariance: [
                (xx + shift.x * shift.x * change).max(0.0),
                xy + shift.x * shift.y * change,
                (yy + shift.y * shift.y * change).max(0.0),
            ],
        }
    }

    /// The product of this density with a normal one of a variance about a slope: its mass, and the normalized product.
    pub fn times_normal(&self, centre: DVec2, variance: f64) -> (f64, Self) {
        let [xx, xy, yy] = self.covariance;
        // Σ (Σ + v)⁻¹ maps the distance of the centres and the variance alike.
        let (a, d) = (xx + variance, yy + variance);
        let determinant = (a * d - xy * xy).max(f64::MIN_POSITIVE);
        let inverse = [d / determinant, -xy / determinant, a / determinant];
        let solve = |t: DVec2| DVec2::new(inverse[0] * t.x + inverse[1] * t.y, inverse[1] * t.x + inverse[2] * t.y);
        let away = centre - self.mean;
        let mass = (-0.5 * away.dot(solve(away))).exp() / (std::f64::consts::TAU * determinant.sqrt());
        let (x, y) = (solve(DVec2::X), solve(DVec2::Y));
        let narrowed = [variance * self.times(x).x, variance * self.times(x).y, variance * self.times(y).y];
        let covariance = [narrowed[0].max(0.0), narrowed[1], narrowed[2].max(0.0)];
        (mass, Self { mean: self.mean + self.times(solve(away)), covariance })
    }

    /// The driver of a slope layer, the slope `-∂h/∂a` along an azimuth [rad].
    pub fn driver(&self, azimuth: f64) -> Normal {
        let e = DVec2::from_angle(azimuth);
        Normal { mean: -self.mean.dot(e), deviation: self.variance_along(e).sqrt() }
    }
}

/// Mean and variance of z under the density `φ(z) (ν + z)+`, normalized.
pub fn visible_moments(nu: f64) -> (f64, f64) {
    if nu < -30.0 {
        // Only facets far from the mean are seen, and the difference of large terms would be left.
        let u = 1.0 / (nu * nu);
        return (-nu * (1.0 + 2.0 * u), 2.0 * u);
    }
    if nu > 38.0 {
        return (1.0 / nu, 1.0);
    }
    let mills = normal::mills(nu);
    let mean = if nu < -5.0 { normal::cdf(nu) / normal::ramp(nu) } else { 1.0 / (nu + mills) };
    (mean, (1.0 + mills * mean - mean * mean).max(0.0))
}

#[cfg(test)]
mod tests;
