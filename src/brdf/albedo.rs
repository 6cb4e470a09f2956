//! Directional albedo: the fraction of the light from one direction that a BRDF reflects, for health reports.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DVec3, Vec3};

use super::{Brdf, LobeAngles};

/// Range of `ln u/(1-u)`. `u` is the angle of the half vector divided by the angle at which `o` is at the horizon.
/// The range covers lobes as narrow as 1e-7 rad and ends 5e-5 (in `u`) before the horizon.
const LOGIT_RANGE: [f64; 2] = [-16.0, 10.0];

impl Brdf {
    /// `∫ f_r(i,o) (n·o)+ dω_o` for light from `theta` [rad], by a fixed quadrature with `samples²` lookups. With 96
    /// samples the error is 1e-3 for any roughness up to 85°. A BRDF with an albedo above 1 creates energy. The albedo
    /// is 0 at and below the horizon.
    ///
    /// The sum runs over half vectors, `dω_o = 4 (i·h) dω_h`. They are even on a scale that is logarithmic at both
    /// ends. On this scale a lobe of any width is a smooth bump, and the integrand is smooth at the horizon.
    pub fn directional_albedo(&self, theta: f32, samples: usize) -> Vec3 {
        albedo_of(|angles| self.f_cos(angles), theta, samples)
    }
}

/// The largest directional albedo of any channel from normal incidence to 80°.
pub(super) fn max_albedo(f_cos: impl Fn(&LobeAngles) -> Vec3) -> f32 {
    let angles = [0.0_f32, 20.0, 40.0, 60.0, 80.0];
    angles.iter().map(|degrees| albedo_of(&f_cos, degrees.to_radians(), 48).max_element()).fold(0.0, f32::max)
}

fn albedo_of(f_cos: impl Fn(&LobeAngles) -> Vec3, theta: f32, samples: usize) -> Vec3 {
    let (sin_i, cos_i) = f64::from(theta).sin_cos();
    if cos_i.is_nan() || cos_i < 1e-7 || samples == 0 {
        return Vec3::ZERO;
    }
    let step = (LOGIT_RANGE[1] - LOGIT_RANGE[0]) / samples as f64;
    let mut sum = DVec3::ZERO;
    for b in 0..samples {
        // Half of the azimuths: the other half mirrors them.
        let cos_phi = ((b as f64 + 0.5) * PI / samples as f64).cos();
        // At this angle, n·o = cosθ_i cos 2θ_h + sinθ_i cosφ sin 2θ_h is 0.
        let theta_h_max = FRAC_PI_4 + 0.5 * (sin_i * cos_phi).atan2(cos_i);
        for a in 0..samples {
            let u = 1.0 / (1.0 + (-(LOGIT_RANGE[0] + (a as f64 + 0.5) * step)).exp());
            let (sin_h, cos_h) = (u * theta_h_max).sin_cos();
            let i_dot_h = cos_i * cos_h + sin_i * sin_h * cos_phi;
            let angles = LobeAngles {
                n_dot_i: cos_i as f32,
                n_dot_o: (2.0 * i_dot_h * cos_h - cos_i) as f32,
                n_dot_h: cos_h as f32,
                sin2_theta_h: (sin_h * sin_h) as f32,
                i_dot_h: i_dot_h as f32,
            };
            if i_dot_h > 0.0 {
                sum += f_cos(&angles).as_dvec3() * (4.0 * i_dot_h * sin_h * theta_h_max * u * (1.0 - u));
            }
        }
    }
    (sum * (2.0 * step * PI / samples as f64 / cos_i)).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::super::Term;
    use super::*;

    fn albedo(term: Term, degrees: f32, samples: usize) -> f32 {
        Brdf { terms: vec![term] }.directional_albedo(degrees.to_radians(), samples).x
    }

    #[test]
    fn a_lambertian_reflects_its_albedo_at_every_angle() {
        for degrees in [0.0, 30.0, 60.0, 80.0, 85.0] {
            let found = albedo(Term::Lambertian { albedo: Vec3::splat(0.6) }, degrees, 96);
            assert!((found / 0.6 - 1.0).abs() < 1e-3, "{degrees}: {found}");
        }
    }

    #[test]
    fn blinn_phong_has_its_closed_form_at_normal_incidence() {
        // c = n·h, n·o = 2c²-1, dω_o = 4c dω_h: (e+8)/(8π) 2π ∫ c^e (2c²-1) 4c dc from cos 45° to 1.
        for e in [1.0_f64, 10.0, 100.0, 1000.0, 1e6] {
            let antiderivative = |c: f64| 2.0 * c.powf(e + 4.0) / (e + 4.0) - c.powf(e + 2.0) / (e + 2.0);
            let expected = (e + 8.0) * (antiderivative(1.0) - antiderivative(0.5_f64.sqrt()));
            let found = f64::from(albedo(Term::BlinnPhong { exponent: e as f32, specular: Vec3::ONE }, 0.0, 96));
            assert!((found / expected - 1.0).abs() < 1e-3, "{e}: {found} for {expected}");
        }
    }

    #[test]
    fn a_perfect_mirror_of_facets_never_gains_energy() {
        for roughness in [1e-4, 1e-3, 0.01, 0.1, 0.2, 0.5, 1.0] {
            for degrees in [0.0, 20.0, 40.0, 60.0, 75.0, 85.0, 89.0] {
                for term in [Term::CookTorrance { roughness, f0: Vec3::ONE }, Term::Ggx { roughness, f0: Vec3::ONE }] {
                    let found = albedo(term.clone(), degrees, 96);
                    assert!(found <= 1.002 && found > 0.2, "{term:?} {degrees}: {found}");
                    // A lobe far narrower than its distance to the horizon loses no energy.
                    if roughness <= 0.001 && degrees <= 85.0 {
                        assert!(found > 0.998, "{term:?} {degrees}: {found}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_horizon_and_below_reflect_nothing() {
        for degrees in [90.0, 120.0, f32::NAN] {
            assert_eq!(albedo(Term::Lambertian { albedo: Vec3::ONE }, degrees, 8), 0.0);
        }
    }
}
