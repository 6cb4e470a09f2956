//! Random directions in proportion to what a BRDF reflects.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

use glam::Vec3;

use super::mean_albedo;
use crate::brdf::{Brdf, LobeAngles, Term};
use crate::math::directions::{from_angles, half_vector};

/// Rows of the table: angles of the fixed direction, in even steps.
const ROWS: usize = 16;
/// Bins of the angle between half vector and normal. Their bounds are `π/2 (b / BINS)²`, so that narrow lobes cover
/// several.
const BINS: usize = 64;
/// Azimuths per bin of the quadrature.
const AZIMUTHS: usize = 12;
/// Rings and samples of the mean albedo.
const MEAN: (usize, usize) = (4, 32);
/// Smallest probability of a cosine-weighted direction. It bounds the weight where the table has too little.
const MIN_COSINE_PROBABILITY: f32 = 0.1;

/// Samples directions for one BRDF: cosine-weighted for its Lambertian terms; by the half vector, from a table, for all
/// others (as Lawrence et al. 2004 do with factors). The density is the mixture of both.
#[derive(Debug)]
pub struct LobeSampler {
    rows: Vec<Row>,
    /// Colour with which the BRDF reflects all light of a uniform sky; infinite if it is black.
    brightest: Vec3,
}

/// Densities for one angle of the fixed direction.
#[derive(Debug, Clone)]
struct Row {
    /// Probability of a cosine-weighted direction.
    cosine: f32,
    /// Probability that a half vector is in a bin or one before it.
    cumulative: [f32; BINS],
}

impl LobeSampler {
    pub fn new(brdf: &Brdf) -> Self {
        let rows = (0..ROWS).map(|row| Row::new(brdf, (row as f32 + 0.5) * FRAC_PI_2 / ROWS as f32)).collect();
        Self { rows, brightest: mean_albedo(brdf, MEAN.0, MEAN.1).recip() }
    }

    /// The colour by which a walk is multiplied at a facet of this one. It is smaller where the material would reflect
    /// more light than it receives: between facets that create energy, walks would grow at every reflection, past the
    /// range of f32.
    pub fn color_of_walk(&self, color: Vec3) -> Vec3 {
        color.min(self.brightest)
    }

    /// Draws a direction for the fixed direction `to`. Returns it with `f / (n·to) / density`, a weight whose mean is
    /// the albedo; `None` if the direction is not above the surface.
    pub fn sample(&self, brdf: &Brdf, normal: Vec3, to: Vec3, [choice, u, v]: [f32; 3]) -> Option<(Vec3, Vec3)> {
        let cosine = normal.dot(to).clamp(1e-4, 1.0);
        let row = &self.rows[((cosine.acos() * (ROWS as f32 / FRAC_PI_2)) as usize).min(ROWS - 1)];
        let direction = if choice < row.cosine {
            from_cosine(normal, u, v)
        } else {
            let half = row.half_vector(normal, u, v);
            half * (2.0 * half.dot(to)) - to
        };
        let away = normal.dot(direction);
        if away <= 0.0 {
            return None;
        }
        let half = half_vector(to, direction);
        let angles = LobeAngles::new(normal, to, direction, half);
        let density = row.cosine * away * FRAC_1_PI
            + (1.0 - row.cosine) * row.half_density(angles.sin2_theta_h, angles.n_dot_h) / (4.0 * angles.i_dot_h);
        let weight = brdf.f_cos(&angles) / (cosine * density);
        weight.is_finite().then_some((direction, weight))
    }
}

impl Row {
    fn new(brdf: &Brdf, theta: f32) -> Self {
        let to = from_angles(theta, 0.0);
        let mut cumulative = [0.0; BINS];
        let (mut lambertian, mut sum) = (0.0, 0.0);
        let mut other = Brdf { terms: Vec::new() };
        for term in &brdf.terms {
            match term {
                Term::Lambertian { albedo } => lambertian += albedo.max_element(),
                _ => other.terms.push(term.clone()),
            }
        }
        for (bin, cumulative) in cumulative.iter_mut().enumerate().filter(|_| !other.terms.is_empty()) {
            let half_theta = 2.0 * (0.5 * (bin_bound(bin) + bin_bound(bin + 1))).sqrt().asin();
            let solid_angle = 4.0 * PI * (bin_bound(bin + 1) - bin_bound(bin)) / AZIMUTHS as f32;
            for azimuth in 0..AZIMUTHS {
                // The lobe is symmetric in the plane of `to`.
                let half = from_angles(half_theta, PI * (azimuth as f32 + 0.5) / AZIMUTHS as f32);
                let i_dot_h = half.dot(to);
                if i_dot_h > 0.0 {
                    let from = half * (2.0 * i_dot_h) - to;
                    let f = other.f_cos(&LobeAngles::new(Vec3::Z, to, from, half)).max_element();
                    sum += f * 4.0 * i_dot_h * solid_angle / to.z;
                }
            }
            *cumulative = sum;
        }
        if sum > 0.0 {
            cumulative.iter_mut().for_each(|value| *value /= sum);
        }
        let cosine = if sum > 0.0 { (lambertian / (lambertian + sum)).max(MIN_COSINE_PROBABILITY) } else { 1.0 };
        Self { cosine, cumulative }
    }

    fn half_vector(&self, normal: Vec3, u: f32, v: f32) -> Vec3 {
        let bin = self.cumulative.partition_point(|sum| *sum <= u).min(BINS - 1);
        let below = if bin > 0 { self.cumulative[bin - 1] } else { 0.0 };
        let t = ((u - below) / (self.cumulative[bin] - below).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let s = bin_bound(bin) + t * (bin_bound(bin + 1) - bin_bound(bin));
        // s = sin²(θ/2): sin θ = 2 √(s (1-s)).
        about(normal, 2.0 * (s * (1.0 - s)).max(0.0).sqrt(), 1.0 - 2.0 * s, v)
    }

    /// Density of the half vector over solid angle.
    fn half_density(&self, sin2: f32, cosine: f32) -> f32 {
        if cosine <= 0.0 {
            return 0.0;
        }
        // θ from its sine, which is exact near the normal.
        let theta = sin2.sqrt().atan2(cosine);
        let bin = (((theta / FRAC_PI_2).sqrt() * BINS as f32) as usize).min(BINS - 1);
        let below = if bin > 0 { self.cumulative[bin - 1] } else { 0.0 };
        (self.cumulative[bin] - below) / (4.0 * PI * (bin_bound(bin + 1) - bin_bound(bin)))
    }
}

/// `sin²(θ/2)` of the lower bound of a bin; over solid angle, it is uniform.
fn bin_bound(bin: usize) -> f32 {
    let part = bin as f32 / BINS as f32;
    (0.5 * FRAC_PI_2 * part * part).sin().powi(2)
}

/// A direction with density `cos θ / π` about `normal`, from two numbers in `[0, 1)`.
pub(super) fn from_cosine(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let u = u.min(1.0 - 1e-6);
    about(normal, u.sqrt(), (1.0 - u).sqrt(), v)
}

/// A direction of the hemisphere about `normal`, uniform in solid angle.
pub(super) fn from_solid_angle(normal: Vec3, u: f32, v: f32) -> Vec3 {
    about(normal, (u * (2.0 - u)).max(0.0).sqrt(), 1.0 - u, v)
}

/// The direction with this sine and cosine to `normal`, at an azimuth in turns.
fn about(normal: Vec3, sine: f32, cosine: f32, turns: f32) -> Vec3 {
    let (sin_phi, cos_phi) = (turns * TAU).sin_cos();
    let (x, y) = normal.any_orthonormal_pair();
    (x * (sine * cos_phi) + y * (sine * sin_phi) + normal * cosine).normalize_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Even points on the unit cube (R3).
    fn numbers(k: usize) -> [f32; 3] {
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2]
            .map(|step: f64| (0.5 + k as f64 * step).fract() as f32)
    }

    #[test]
    fn the_mean_weight_of_sampled_directions_is_the_albedo() {
        const SAMPLES: usize = 1 << 15;
        let white = Vec3::ONE;
        let lambertian = Term::Lambertian { albedo: white * 0.4 };
        let ggx = |roughness| Term::Ggx { roughness, f0: white };
        let brdfs = [
            vec![lambertian.clone()],
            vec![ggx(0.1)],
            vec![ggx(0.5)],
            vec![Term::CookTorrance { roughness: 0.3, f0: white * 0.8 }],
            vec![Term::BlinnPhong { exponent: 200.0, specular: white * 0.5 }],
            vec![Term::Ward { roughness: 0.2, specular: white * 0.5 }],
            vec![lambertian, Term::Ggx { roughness: 0.2, f0: white * 0.5 }],
        ];
        for terms in brdfs {
            let brdf = Brdf { terms };
            let sampler = LobeSampler::new(&brdf);
            for theta in [0.0_f32, 0.5, 1.1, 1.4] {
                let normal = from_angles(0.7, 2.0);
                let (x, _) = normal.any_orthonormal_pair();
                let to = normal * theta.cos() + x * theta.sin();
                let weight = |k| sampler.sample(&brdf, normal, to, numbers(k)).map_or(0.0, |(_, weight)| weight.x);
                let mean = (0..SAMPLES).map(|k| f64::from(weight(k))).sum::<f64>() / SAMPLES as f64;
                let albedo = f64::from(brdf.directional_albedo(theta, 96).x);
                assert!((mean - albedo).abs() < 0.012 * albedo, "{brdf:?} at {theta}: {mean} instead of {albedo}");
            }
        }
    }

    #[test]
    fn walks_are_not_brightened_by_materials_that_create_energy() {
        let sampler = LobeSampler::new(&Brdf { terms: vec![Term::Lambertian { albedo: Vec3::new(0.8, 0.5, 0.0) }] });
        assert_eq!(sampler.color_of_walk(Vec3::new(1.2, 0.7, 1e3)), Vec3::new(1.2, 0.7, 1e3));
        let reflected = sampler.color_of_walk(Vec3::splat(1e3)) * Vec3::new(0.8, 0.5, 1e-3);
        assert!((reflected - Vec3::ONE).abs().max_element() < 1e-2, "{reflected}");
    }

    #[test]
    fn a_lambertian_surface_weighs_every_direction_by_its_albedo() {
        let brdf = Brdf { terms: vec![Term::Lambertian { albedo: Vec3::splat(0.9) }] };
        let sampler = LobeSampler::new(&brdf);
        for k in 0..1000 {
            let (_, weight) = sampler.sample(&brdf, Vec3::Z, from_angles(1.0, 0.3), numbers(k)).unwrap();
            assert!((weight - 0.9).abs().max_element() < 1e-5, "{weight}");
        }
    }
}
