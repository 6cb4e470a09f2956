//! Analytic lobes `f_r / tint · (n·i)(n·o)`. The caller ensures that both cosines are positive.
//!
//! The cosines cancel before any division: `F D G / (4 (n·i)(n·o))` becomes `D G / 4`. The lobes are therefore bounded
//! at the horizon. Every expression is symmetric in `n·i` and `n·o` to the bit.

use std::f32::consts::{FRAC_1_PI, PI};

use super::LobeAngles;
use super::fast_math::{exp_nonpositive, ln_cos_squared};

/// `(n·i)(n·o) / π`.
#[inline]
pub(super) fn lambertian(angles: &LobeAngles) -> f32 {
    angles.n_dot_i * angles.n_dot_o * FRAC_1_PI
}

/// `(e+8)/(8π) (n·h)^e (n·i)(n·o)`.
#[inline]
pub(super) fn blinn_phong(exponent: f32, angles: &LobeAngles) -> f32 {
    blinn_phong_without_cosines(exponent, angles) * (angles.n_dot_i * angles.n_dot_o)
}

/// `(e+8)/(8π) (n·h)^e`. A power of the rounded `n·h` would have a relative error of `e ε` near the mirror direction,
/// which is 6 % at e = 10⁶.
#[inline]
pub(super) fn blinn_phong_without_cosines(exponent: f32, angles: &LobeAngles) -> f32 {
    let power = exp_nonpositive((0.5 * exponent) * ln_cos_squared(angles.sin2_theta_h, angles.n_dot_h).min(0.0));
    (exponent + 8.0) / (8.0 * PI) * power
}

/// `D G / 4`: Beckmann's distribution and the V-cavity shadowing of Cook and Torrance 1982.
#[inline]
pub(super) fn cook_torrance(roughness: f32, angles: &LobeAngles) -> f32 {
    let m2 = roughness * roughness;
    let cos2 = angles.n_dot_h * angles.n_dot_h;
    // exp(-tan²/m²) / (π m² cos⁴). If the exponential is 0, the lobe is 0 for any cos⁴.
    let exponential = exp_of_tangent(angles.sin2_theta_h, cos2 * m2);
    // If the exponential is positive, the denominator is above 1e-8. The bound is for cosines that no unit vectors
    // have.
    let distribution = exponential / (PI * m2 * cos2 * cos2).max(1e-16);
    // min(1, 2 (n·h) min(n·i, n·o) / i·h) without dividing by an i·h that is 0 for opposite directions.
    let cavity = (2.0 * angles.n_dot_h * angles.n_dot_i.min(angles.n_dot_o)).max(0.0);
    let shadowing = if cavity < angles.i_dot_h { cavity / angles.i_dot_h } else { 1.0 };
    0.25 * distribution * shadowing
}

/// `exp(-tan²θ_h/α²) sqrt((n·i)(n·o)) / (4π α²)` (Ward 1992).
#[inline]
pub(super) fn ward(roughness: f32, angles: &LobeAngles) -> f32 {
    let a2 = roughness * roughness;
    let exponential = exp_of_tangent(angles.sin2_theta_h, angles.n_dot_h * angles.n_dot_h * a2);
    exponential * (angles.n_dot_i * angles.n_dot_o).sqrt() / (4.0 * PI * a2)
}

/// `D G2 / 4`: GGX (Walter et al. 2007) with height-correlated Smith shadowing (Heitz 2014, Eq. 99).
#[inline]
pub(super) fn ggx(roughness: f32, angles: &LobeAngles) -> f32 {
    let a2 = roughness * roughness;
    let (ni, no) = (angles.n_dot_i, angles.n_dot_o);
    // α² / (π ((n·h)²(α²-1)+1)²) with 1 = cos² + sin², which avoids cancellation near the mirror direction.
    let spread = (angles.sin2_theta_h + a2 * angles.n_dot_h * angles.n_dot_h).max(1e-16);
    let distribution = FRAC_1_PI * (a2 / spread) / spread;
    // G2 = 2 ni no / (no √(α²+(1-α²)ni²) + ni √(α²+(1-α²)no²)).
    let slope_i = (a2 + (1.0 - a2) * ni * ni).sqrt();
    let slope_o = (a2 + (1.0 - a2) * no * no).sqrt();
    let denominator = no * slope_i + ni * slope_o;
    let shadowing = if denominator > 0.0 { 0.5 * (ni * no) / denominator } else { 0.0 };
    distribution * shadowing
}

/// `exp(-sin² / cos2_scaled)`; 0 if the denominator underflows.
#[inline]
fn exp_of_tangent(sin2: f32, cos2_scaled: f32) -> f32 {
    exp_nonpositive(-(sin2 / cos2_scaled.max(f32::MIN_POSITIVE)))
}

/// Schlick's `(1 - i·h)^5`, clamped to [0, 1].
#[inline]
pub fn schlick_weight(i_dot_h: f32) -> f32 {
    let t = (1.0 - i_dot_h).clamp(0.0, 1.0);
    let t2 = t * t;
    t2 * t2 * t
}

#[cfg(test)]
#[path = "analytic_tests.rs"]
mod tests;
