//! Principal colours of a BRDF: orthonormal RGB directions in the order of decreasing energy.
//!
//! A sum over facets is evaluated once per colour direction. A BRDF with one hue for all direction pairs needs one, and
//! no BRDF needs more than three. (Wu et al. 2011, Sec. 3.7 use one.)

use glam::{DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};

use super::half_difference::{bin_angles, cosines};
use super::{Brdf, LobeAngles};

/// Bins in `θ_h`, `θ_d` and `φ_d` at which the BRDF is sampled: dense in `θ_h` for sharp lobes, and several `φ_d`.
const SAMPLED_BINS: [usize; 3] = [90, 30, 6];

/// `f(i,o) ≈ Σ_k directions[k] (directions[k] · f(i,o))` over the first `k` directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorBasis {
    /// Orthonormal directions; the sum of the components of each is not negative.
    pub directions: [Vec3; 3],
    /// Fractions of `∫∫ |f|² dω_i dω_o` (with both cosines) along each direction. They decrease and add up to 1; a
    /// black BRDF has zeros.
    pub energy: [f64; 3],
}

impl ColorBasis {
    /// Computes the basis of a BRDF by a fixed quadrature over half and difference angles. The directions are the
    /// eigenvectors of the 3x3 Gram matrix of the BRDF's colours.
    pub fn of(brdf: &Brdf) -> Self {
        let mut gram = Matrix3::zeros();
        for h in 0..SAMPLED_BINS[0] {
            for d in 0..SAMPLED_BINS[1] {
                for phi in 0..SAMPLED_BINS[2] {
                    let (angles, weight) = sample_point([h, d, phi]);
                    let f = brdf.f_cos(&angles).as_dvec3();
                    let f = nalgebra::Vector3::new(f.x, f.y, f.z);
                    gram += f * f.transpose() * weight;
                }
            }
        }
        Self::from_gram(gram)
    }

    /// Number of directions (1 to 3) that retain this fraction of the energy. Energy is squared: 0.9999 leaves an error
    /// of 1 %.
    pub fn count_for(&self, energy: f64) -> usize {
        // Ignore rounding errors of the Gram matrix.
        let wanted = energy - 1e-12;
        1 + usize::from(self.energy[0] < wanted) + usize::from(self.energy[0] + self.energy[1] < wanted)
    }

    /// Coordinates of a colour along each direction.
    pub fn project(&self, color: Vec3) -> [f32; 3] {
        self.directions.map(|direction| direction.dot(color))
    }

    fn from_gram(gram: Matrix3<f64>) -> Self {
        let black = Self { directions: [Vec3::X, Vec3::Y, Vec3::Z], energy: [0.0; 3] };
        let scale = gram.amax();
        if !(scale > 0.0 && scale.is_finite()) {
            return black;
        }
        let eigen = SymmetricEigen::new(gram / scale);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let values = order.map(|k| eigen.eigenvalues[k].max(0.0));
        let total: f64 = values.iter().sum();
        let directions = order.map(|k| {
            let column = eigen.eigenvectors.column(k);
            let direction = DVec3::new(column[0], column[1], column[2]);
            if direction.element_sum() < 0.0 { -direction.as_vec3() } else { direction.as_vec3() }
        });
        Self { directions, energy: values.map(|value| value / total) }
    }
}

/// Cosines at a bin's centre, and the bin's part of `dω_i dω_o = 4 (i·h) dω_h dω_d` up to a constant.
fn sample_point(bin: [usize; 3]) -> (LobeAngles, f64) {
    let angles = bin_angles(SAMPLED_BINS, bin.map(|k| k as f64));
    let (n_dot_i, n_dot_o) = cosines(angles);
    let [theta_h, theta_d, _] = angles;
    let weight = theta_h.sin() * theta_h.sqrt() * theta_d.sin() * theta_d.cos();
    let angles = LobeAngles {
        n_dot_i: n_dot_i as f32,
        n_dot_o: n_dot_o as f32,
        n_dot_h: theta_h.cos() as f32,
        sin2_theta_h: theta_h.sin().powi(2) as f32,
        i_dot_h: theta_d.cos() as f32,
    };
    (angles, weight)
}

#[cfg(test)]
mod tests {
    use super::super::Term;
    use super::*;

    fn basis(terms: Vec<Term>) -> ColorBasis {
        ColorBasis::of(&Brdf { terms })
    }

    fn assert_orthonormal(basis: &ColorBasis) {
        for a in 0..3 {
            for b in 0..3 {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((basis.directions[a].dot(basis.directions[b]) - expected).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn one_tint_is_one_direction_with_all_the_energy() {
        let color = Vec3::new(0.9, 0.3, 0.1);
        let found = basis(vec![Term::Ward { roughness: 0.2, specular: color }]);
        assert!(found.directions[0].dot(color.normalize()) > 1.0 - 1e-6);
        assert!(found.energy[0] > 1.0 - 1e-9 && found.count_for(1.0) == 1);
        assert_orthonormal(&found);
    }

    #[test]
    fn disjoint_colours_are_found_with_their_share_of_the_energy() {
        // The two colours share no channel, so the eigenvectors are the axes.
        let term = |specular| Term::Ward { roughness: 0.3, specular };
        let (red, green) = (term(Vec3::X * 2.0), Term::Lambertian { albedo: Vec3::Y });
        let alone = |term: &Term, c: usize| {
            let mut sum = 0.0;
            for h in 0..SAMPLED_BINS[0] {
                for d in 0..SAMPLED_BINS[1] {
                    for phi in 0..SAMPLED_BINS[2] {
                        let (angles, weight) = sample_point([h, d, phi]);
                        sum += f64::from(term.f_cos(&angles)[c]).powi(2) * weight;
                    }
                }
            }
            sum
        };
        let found = basis(vec![red.clone(), green.clone()]);
        let (r, g) = (alone(&red, 0), alone(&green, 1));
        assert!((found.energy[0] + found.energy[1] - 1.0).abs() < 1e-12 && found.energy[2] < 1e-12);
        // The two lobes overlap, so only the trace and the determinant are known.
        assert!((found.energy[0] * found.energy[1]) <= r * g / (r + g).powi(2) + 1e-12);
        assert!(found.directions[2].z.abs() > 1.0 - 1e-6 && found.count_for(0.9999) == 2);
        assert_orthonormal(&found);
    }

    #[test]
    fn three_lobes_of_three_colours_need_three_directions_and_rebuild_exactly() {
        let terms = vec![
            Term::Lambertian { albedo: Vec3::new(0.1, 0.2, 0.8) },
            Term::Ward { roughness: 0.1, specular: Vec3::new(0.9, 0.1, 0.1) },
            Term::BlinnPhong { exponent: 4.0, specular: Vec3::new(0.1, 0.9, 0.1) },
        ];
        let found = basis(terms);
        assert_eq!(found.count_for(1.0), 3);
        let color = Vec3::new(0.2, 0.7, 0.4);
        let rebuilt: Vec3 = found.project(color).iter().zip(found.directions).map(|(&c, d)| c * d).sum();
        assert!((rebuilt - color).length() < 1e-6);
    }

    #[test]
    fn the_sampled_energy_is_that_of_random_direction_pairs() {
        // ∫∫ (cosθ_i cosθ_o / π)² dω_i dω_o = (2/3)² for a Lambertian; the weights omit the factor 4 · 2π · 4 · bin
        // widths.
        let [bins_h, bins_d, bins_phi] = SAMPLED_BINS;
        let lambertian = Term::Lambertian { albedo: Vec3::X };
        let mut sum = 0.0;
        for bin in
            (0..bins_h * bins_d * bins_phi).map(|k| [k / (bins_d * bins_phi), k / bins_phi % bins_d, k % bins_phi])
        {
            let (angles, weight) = sample_point(bin);
            sum += f64::from(lambertian.f_cos(&angles).x).powi(2) * weight;
        }
        use std::f64::consts::{FRAC_PI_2, PI};
        // θ_h = (π/2) t², so dθ_h = 2 √(π/2) √θ_h dt. All φ_h give 2π, and φ_d covers four times [0, π/2].
        let widths = 2.0 * FRAC_PI_2.sqrt() / bins_h as f64 * FRAC_PI_2 / bins_d as f64 * FRAC_PI_2 / bins_phi as f64;
        let integral = sum * 4.0 * widths * 2.0 * PI * 4.0;
        assert!((integral / (4.0 / 9.0) - 1.0).abs() < 0.01, "{integral}");
    }

    #[test]
    fn a_black_brdf_has_no_energy_and_one_direction() {
        let found = basis(vec![Term::Lambertian { albedo: Vec3::ZERO }]);
        assert_eq!(found.energy, [0.0; 3]);
        assert!(basis(Vec::new()).directions[0].is_finite());
    }
}
