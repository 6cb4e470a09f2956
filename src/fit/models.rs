//! The analytic models: Lambertian plus Cook-Torrance, as in Wu et al. 2011, Fig. 7, and a GGX base as in glTF and
//! OpenPBR.

use std::f64::consts::PI;

use glam::Vec3;

use crate::brdf::{LobeAngles, Term, schlick_weight};
use crate::math::directions::half_vector;

/// The analytic model of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// Lambertian plus Cook-Torrance (Beckmann, V-cavities, Schlick): weights are albedo and f0.
    CookTorrance,
    /// Lambertian plus anisotropic GGX (Smith, Schlick) plus sheen: weights are base colour, specular f0, sheen colour.
    Ggx,
}

/// The nonlinear parameters of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeShape {
    /// Width of the lobe along its x and y: Beckmann's m, GGX's α.
    pub roughness: [f32; 2],
    /// Azimuth of the lobe's x from the tangent, radians.
    pub rotation: f32,
    /// Fresnel factor of the lobe at grazing angles: 1 for a smooth interface, 0 without one.
    pub edge: f32,
}

/// Lobe values at a pair, including the light's cosine.
pub struct Lobes {
    /// Values that the weights multiply.
    pub weighted: Vec<f64>,
    /// The value that no weight multiplies, the white edge of the Fresnel factor: `edge lobe (1-i·h)^5`.
    pub fixed: f64,
}

/// Bounds of the roughness; 1 is the maximum of glTF and OpenPBR.
const ROUGHNESS: [f32; 2] = [0.02, 1.0];
/// Roughness of the sheen, which is fixed.
const SHEEN_ROUGHNESS: f64 = 0.5;

impl Model {
    pub const ALL: [Self; 2] = [Self::CookTorrance, Self::Ggx];

    /// Returns the model's name in output.
    pub fn name(self) -> &'static str {
        match self {
            Self::CookTorrance => "lambertian_cook_torrance",
            Self::Ggx => "ggx_base",
        }
    }

    /// Returns the names of the weights.
    pub fn weight_names(self) -> &'static [&'static str] {
        match self {
            Self::CookTorrance => &["albedo", "f0"],
            Self::Ggx => &["base_color", "specular_f0", "sheen_color"],
        }
    }

    pub(super) fn lobes(self) -> usize {
        self.weight_names().len()
    }

    /// Returns the starting points of the search, with a small and a large edge. The parameters are the angle whose
    /// squared sine is the edge and the logarithm of the roughness; GGX adds the logarithm of the square root of the
    /// anisotropy and the azimuth.
    pub(super) fn starts(self) -> Vec<Vec<f64>> {
        let shapes: &[&[f64]] = match self {
            Self::CookTorrance => &[&[-2.3], &[-1.2], &[-0.4]],
            Self::Ggx => &[&[-1.9, 0.4, 0.1], &[-1.9, -0.4, 0.1], &[-0.7, 0.2, 0.1]],
        };
        let edges = [0.2, 1.1];
        edges.iter().flat_map(|&edge| shapes.iter().map(move |shape| [&[edge], *shape].concat())).collect()
    }

    pub(super) fn shape(self, parameters: &[f64]) -> LobeShape {
        let bounded = |log: f64| (log.exp() as f32).clamp(ROUGHNESS[0], ROUGHNESS[1]);
        let edge = parameters.first().map_or(1.0, |angle| angle.sin().powi(2) as f32);
        match (self, parameters) {
            (Self::Ggx, [_, log, ratio, azimuth]) => {
                LobeShape { roughness: [bounded(log + ratio), bounded(log - ratio)], rotation: *azimuth as f32, edge }
            }
            _ => {
                let roughness = bounded(parameters.get(1).copied().unwrap_or(-1.0));
                LobeShape { roughness: [roughness; 2], rotation: 0.0, edge }
            }
        }
    }

    /// Evaluates the lobes at a pair above the horizon.
    pub(super) fn evaluate(self, shape: &LobeShape, i: Vec3, o: Vec3) -> Lobes {
        let h = half_vector(i, o);
        let fresnel = f64::from(schlick_weight(i.dot(h)));
        let edge = f64::from(shape.edge) * fresnel;
        let diffuse = f64::from(i.z) / PI;
        match self {
            Self::CookTorrance => {
                let angles = LobeAngles::new(Vec3::Z, i, o, h);
                let term = Term::CookTorrance { roughness: shape.roughness[0], f0: Vec3::ONE };
                // `lobe_cos` includes both cosines; the division removes the viewer's.
                let lobe = f64::from(term.lobe_cos(&angles)) / f64::from(o.z);
                Lobes { weighted: vec![diffuse, lobe * (1.0 - fresnel)], fixed: lobe * edge }
            }
            Self::Ggx => {
                let lobe = anisotropic_ggx(shape, i, o, h);
                let sheen = sheen(i, o, h) * f64::from(i.z);
                Lobes { weighted: vec![diffuse, lobe * (1.0 - fresnel), sheen], fixed: lobe * edge }
            }
        }
    }
}

/// Returns `D G2 / (4 cosθ_o)` of anisotropic GGX with height-correlated Smith shadowing (Heitz 2014); this includes
/// the light's cosine.
fn anisotropic_ggx(shape: &LobeShape, i: Vec3, o: Vec3, h: Vec3) -> f64 {
    let (sin, cos) = f64::from(shape.rotation).sin_cos();
    let rotated = |v: Vec3| {
        let v = v.as_dvec3();
        glam::DVec3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z)
    };
    let [alpha_x, alpha_y] = shape.roughness.map(f64::from);
    let (i, o, h) = (rotated(i), rotated(o), rotated(h));
    let stretched = (h.x / alpha_x).powi(2) + (h.y / alpha_y).powi(2) + h.z * h.z;
    let density = 1.0 / (PI * alpha_x * alpha_y * stretched * stretched);
    let lambda = |v: glam::DVec3| ((v.x * alpha_x).powi(2) + (v.y * alpha_y).powi(2) + v.z * v.z).sqrt();
    // G2 / (4 cosθ_i cosθ_o), times cosθ_i.
    density * 0.5 * i.z / (o.z * lambda(i) + i.z * lambda(o))
}

/// Returns the Charlie sheen (Estevez and Kulla 2017) as defined by glTF's `KHR_materials_sheen`, with Neubelt's
/// visibility term.
fn sheen(i: Vec3, o: Vec3, h: Vec3) -> f64 {
    let inverse = 1.0 / SHEEN_ROUGHNESS;
    let sine = f64::from((1.0 - h.z * h.z).max(0.0)).sqrt();
    let density = (2.0 + inverse) * sine.powf(inverse) / (2.0 * PI);
    let (n_i, n_o) = (f64::from(i.z), f64::from(o.z));
    density / (4.0 * (n_i + n_o - n_i * n_o))
}

impl LobeShape {
    /// Returns roughness and anisotropy in glTF's convention: the narrow α is `r²`, the wide α is
    /// `mix(r², 1, anisotropy²)`.
    pub fn perceptual(&self) -> (f32, f32) {
        let [x, y] = self.roughness;
        let (wide, narrow) = (x.max(y), x.min(y));
        (narrow.sqrt(), ((wide - narrow) / (1.0 - narrow).max(1e-3)).clamp(0.0, 1.0).sqrt())
    }

    /// Returns the azimuth of the wide direction of the lobe, radians.
    pub fn wide_azimuth(&self) -> f32 {
        let offset = if self.roughness[0] >= self.roughness[1] { 0.0 } else { std::f32::consts::FRAC_PI_2 };
        self.rotation + offset
    }
}
