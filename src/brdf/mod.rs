//! Small-scale BRDFs: isotropic, per colour channel, evaluated at any normal (DESIGN.md, Sec. 3).

use std::sync::Arc;

use glam::Vec3;

/// The cosines an isotropic BRDF depends on. `n·h`, `n·i`, `n·o` may be negative: then the BRDF is 0.
#[derive(Debug, Clone, Copy)]
pub struct LobeAngles {
    pub n_dot_i: f32,
    pub n_dot_o: f32,
    pub n_dot_h: f32,
    /// `|n×h|²`: exact near the mirror direction, where `1 - (n·h)²` cancels.
    pub sin2_theta_h: f32,
    pub i_dot_h: f32,
}

impl LobeAngles {
    /// All unit vectors; `h` is [`crate::directions::half_vector`] of `i` and `o`.
    pub fn new(n: Vec3, i: Vec3, o: Vec3, h: Vec3) -> Self {
        Self {
            n_dot_i: n.dot(i),
            n_dot_o: n.dot(o),
            n_dot_h: n.dot(h),
            sin2_theta_h: n.cross(h).length_squared(),
            i_dot_h: i.dot(h),
        }
    }
}

/// A sum of terms.
#[derive(Debug, Clone, Default)]
pub struct Brdf {
    pub terms: Vec<Term>,
}

/// One term of a BRDF. Analytic terms are a scalar lobe times a colour that depends on `i·h` only ([`Term::tint`]),
/// which no facet normal enters: sums over facets need one channel.
#[derive(Debug, Clone)]
pub enum Term {
    Lambertian { albedo: Vec3 },
    BlinnPhong { exponent: f32, specular: Vec3 },
    CookTorrance { roughness: f32, f0: Vec3 },
    Ward { roughness: f32, specular: Vec3 },
    Ggx { roughness: f32, f0: Vec3 },
    Measured(Arc<dyn Measured>),
}

/// A tabulated BRDF, already made reciprocal.
pub trait Measured: std::fmt::Debug + Send + Sync {
    /// `f_r` [1/sr]; finite and not negative; 0 where `n·i` or `n·o` is not positive.
    fn f_r(&self, angles: &LobeAngles) -> Vec3;
    /// Where it came from, for messages.
    fn name(&self) -> &str;
}
