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
#[path = "color_basis_tests.rs"]
mod tests;
