//! Small-scale BRDFs: isotropic, per colour channel, evaluated at any normal.
//!
//! An analytic term is a scalar lobe times a colour, `f = tint(i·h) · lobe_cos`. A measured term is a table over half
//! and difference angles, which is made reciprocal when the file is read. [`Brdf::from_specs`] creates both from a
//! scene.

mod albedo;
mod analytic;
mod color_basis;
mod fast_math;
mod from_specs;
mod half_difference;
mod material;
mod measured;
pub(crate) mod merl;
pub(crate) mod npz;
pub(crate) mod rgl;
pub(crate) mod spectrum;
mod spherical;
pub(crate) mod utia;

use std::sync::Arc;

use glam::Vec3;

pub use analytic::schlick_weight;
pub use color_basis::ColorBasis;
pub use half_difference::HalfDifferenceTable;
pub use material::{Material, MaterialAssignment, analytic_lobe};
pub use measured::{Measured, MeasuredCache, MeasuredKind, MeasuredReport};

use crate::math::directions::half_vector;

/// Cosines that an isotropic BRDF depends on. If `n·h`, `n·i` or `n·o` is negative, the BRDF is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeAngles {
    pub n_dot_i: f32,
    pub n_dot_o: f32,
    pub n_dot_h: f32,
    /// `|n×h|²`, which is exact near the mirror direction; `1 - (n·h)²` would cancel.
    pub sin2_theta_h: f32,
    pub i_dot_h: f32,
}

impl LobeAngles {
    /// Computes the cosines of unit vectors; `h` is [`crate::math::directions::half_vector`] of `i` and `o`. Swapping
    /// `i` and `o` swaps `n·i` and `n·o` and changes no other bit.
    #[inline]
    pub fn new(n: Vec3, i: Vec3, o: Vec3, h: Vec3) -> Self {
        Self {
            n_dot_i: n.dot(i),
            n_dot_o: n.dot(o),
            n_dot_h: n.dot(h),
            sin2_theta_h: n.cross(h).length_squared(),
            i_dot_h: 0.5 * (i + o).dot(h),
        }
    }

    /// Returns true if both directions are above the surface. Otherwise every BRDF is 0.
    #[inline]
    pub fn above(&self) -> bool {
        self.n_dot_i > 0.0 && self.n_dot_o > 0.0
    }
}

/// A sum of terms.
#[derive(Debug, Clone, Default)]
pub struct Brdf {
    pub terms: Vec<Term>,
}

/// One term of a BRDF. An analytic term is a scalar lobe times a colour that depends on `i·h` only ([`Term::tint`]).
/// The colour does not depend on the facet's normal, so a sum over facets needs one channel.
#[derive(Debug, Clone)]
pub enum Term {
    Lambertian { albedo: Vec3 },
    BlinnPhong { exponent: f32, specular: Vec3 },
    CookTorrance { roughness: f32, f0: Vec3 },
    Ward { roughness: f32, specular: Vec3 },
    Ggx { roughness: f32, f0: Vec3 },
    Measured(Arc<dyn Measured>),
}

impl Term {
    /// The table of a measured term, which [`Term::lobe_cos`] and [`Term::tint`] do not describe; `None` for analytic
    /// terms.
    pub fn measured(&self) -> Option<&Arc<dyn Measured>> {
        match self {
            Self::Measured(table) => Some(table),
            _ => None,
        }
    }

    /// Returns true if the colour depends on `i·h` (Fresnel).
    pub fn has_fresnel(&self) -> bool {
        matches!(self, Self::CookTorrance { .. } | Self::Ggx { .. })
    }

    /// The roughness of a lobe as Beckmann's `m`; `None` without a lobe and for a measured term.
    pub fn roughness(&self) -> Option<f32> {
        match *self {
            Self::Lambertian { .. } | Self::Measured(_) => None,
            Self::BlinnPhong { exponent, .. } => Some((2.0 / exponent.max(1.0)).sqrt()),
            Self::CookTorrance { roughness, .. } | Self::Ward { roughness, .. } | Self::Ggx { roughness, .. } => {
                Some(roughness)
            }
        }
    }

    /// The scalar lobe `f_r / tint · (n·i)+ (n·o)+` [1/sr]. It is finite, not negative, and has the same bits if `i`
    /// and `o` are swapped. A measured term has no scalar lobe: this function returns its luminance, and [`Term::tint`]
    /// is white. Its exact value is [`Term::f_cos`].
    #[inline]
    pub fn lobe_cos(&self, angles: &LobeAngles) -> f32 {
        if !angles.above() {
            return 0.0;
        }
        match self {
            Self::Lambertian { .. } => analytic::lambertian(angles),
            Self::BlinnPhong { exponent, .. } => analytic::blinn_phong(*exponent, angles),
            Self::CookTorrance { roughness, .. } => analytic::cook_torrance(*roughness, angles),
            Self::Ward { roughness, .. } => analytic::ward(*roughness, angles),
            Self::Ggx { roughness, .. } => analytic::ggx(*roughness, angles),
            Self::Measured(table) => table.f_r(angles).dot(LUMINANCE) * (angles.n_dot_i * angles.n_dot_o),
        }
    }

    /// Computes [`Term::lobe_cos`] of many angles with the same bits. The model is selected once, so the loop
    /// vectorises. Fills as many values as the shorter slice has.
    pub fn lobe_cos_many(&self, angles: &[LobeAngles], out: &mut [f32]) {
        struct Fill<'a>(&'a [LobeAngles], &'a mut [f32]);
        impl LobeVisitor for Fill<'_> {
            type Output = ();
            fn visit(self, lobe_cos: impl Fn(&LobeAngles) -> f32 + Copy + Send + Sync) {
                for (out, angles) in self.1.iter_mut().zip(self.0) {
                    *out = lobe_cos(angles);
                }
            }
        }
        self.visit_lobe(Fill(angles, out));
    }

    /// Passes [`Term::lobe_cos`] to the visitor as a function specialized for this kind of term. For analytic terms it
    /// has no branch. The visitor's loops are compiled once per kind and vectorise.
    pub fn visit_lobe<V: LobeVisitor>(&self, visitor: V) -> V::Output {
        fn above(
            lobe: impl Fn(&LobeAngles) -> f32 + Copy + Send + Sync,
        ) -> impl Fn(&LobeAngles) -> f32 + Copy + Send + Sync {
            move |angles| {
                let value = lobe(angles);
                if angles.above() { value } else { 0.0 }
            }
        }
        match *self {
            Self::Lambertian { .. } => visitor.visit(above(analytic::lambertian)),
            Self::BlinnPhong { exponent, .. } => visitor.visit(above(move |a| analytic::blinn_phong(exponent, a))),
            Self::CookTorrance { roughness, .. } => {
                visitor.visit(above(move |a| analytic::cook_torrance(roughness, a)))
            }
            Self::Ward { roughness, .. } => visitor.visit(above(move |a| analytic::ward(roughness, a))),
            Self::Ggx { roughness, .. } => visitor.visit(above(move |a| analytic::ggx(roughness, a))),
            Self::Measured(_) => visitor.visit(|a| self.lobe_cos(a)),
        }
    }

    /// The colour that multiplies [`Term::lobe_cos`]: albedo, specular colour, or Schlick's Fresnel term
    /// `f0 + (1-f0)(1-i·h)^5`. It is white for a measured term.
    #[inline]
    pub fn tint(&self, i_dot_h: f32) -> Vec3 {
        match *self {
            Self::Lambertian { albedo } => albedo,
            Self::BlinnPhong { specular, .. } | Self::Ward { specular, .. } => specular,
            Self::CookTorrance { f0, .. } | Self::Ggx { f0, .. } => f0 + (Vec3::ONE - f0) * schlick_weight(i_dot_h),
            Self::Measured(_) => Vec3::ONE,
        }
    }

    /// `f = f_r (n·i)+ (n·o)+` [1/sr].
    #[inline]
    pub fn f_cos(&self, angles: &LobeAngles) -> Vec3 {
        match self {
            Self::Measured(table) if angles.above() => table.f_r(angles) * (angles.n_dot_i * angles.n_dot_o),
            Self::Measured(_) => Vec3::ZERO,
            _ => self.tint(angles.i_dot_h) * self.lobe_cos(angles),
        }
    }

    /// `f_r` [1/sr]. Models whose `f_r` is unbounded at the horizon are limited to the largest f32.
    pub fn f_r(&self, angles: &LobeAngles) -> Vec3 {
        if !angles.above() {
            return Vec3::ZERO;
        }
        match self {
            Self::Measured(table) => table.f_r(angles),
            Self::Lambertian { albedo } => *albedo / std::f32::consts::PI,
            Self::BlinnPhong { exponent, specular } => {
                *specular * analytic::blinn_phong_without_cosines(*exponent, angles)
            }
            _ => {
                let cosines = (angles.n_dot_i * angles.n_dot_o).max(f32::MIN_POSITIVE);
                (self.f_cos(angles) / cosines).min(Vec3::splat(f32::MAX))
            }
        }
    }
}

/// A computation over a term's scalar lobe, compiled for each kind of term ([`Term::visit_lobe`]).
pub trait LobeVisitor {
    type Output;
    fn visit(self, lobe_cos: impl Fn(&LobeAngles) -> f32 + Copy + Send + Sync) -> Self::Output;
}

/// Rec. 709 luminance weights of linear RGB.
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

impl Brdf {
    /// `f = Σ f_r (n·i)+ (n·o)+` [1/sr] of unit vectors; 0 if either direction is not above the surface.
    pub fn f(&self, n: Vec3, i: Vec3, o: Vec3) -> Vec3 {
        self.f_cos(&LobeAngles::new(n, i, o, half_vector(i, o)))
    }

    /// `f_r` [1/sr] of unit vectors; 0 if either direction is not above the surface.
    pub fn f_r(&self, n: Vec3, i: Vec3, o: Vec3) -> Vec3 {
        let angles = LobeAngles::new(n, i, o, half_vector(i, o));
        self.terms.iter().map(|term| term.f_r(&angles)).sum::<Vec3>().min(Vec3::splat(f32::MAX))
    }

    /// [`Brdf::f`] from the cosines.
    #[inline]
    pub fn f_cos(&self, angles: &LobeAngles) -> Vec3 {
        self.terms.iter().map(|term| term.f_cos(angles)).sum()
    }
}

#[cfg(test)]
mod speed_tests;
