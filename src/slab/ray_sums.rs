//! Masking and lobes of a face for many rays inside the slab at once, in single precision.

use glam::{DMat2, DVec2, DVec3};

use super::ellipse::{Ellipse, Profile};
use super::ndf::Ndf;
use super::spread::Spread;
use crate::math::simd::{self, BECKMANN, GGX, LeavingColumns, RayColumns};

impl Ndf {
    /// The analytic slopes, if they are the whole rough part.
    pub(super) fn only_ellipse(&self) -> Option<&Ellipse> {
        match self.only_spread() {
            Some(Spread::Analytic(ellipse)) => Some(ellipse),
            _ => None,
        }
    }

    /// Multiplies the weights of rays inside, which travel against their vectors, by the masking of the face. `sign` is -1 for
    /// slopes turned by 180°.
    pub(super) fn mask(&self, sign: f64, rays: &mut RayColumns) {
        if self.is_smooth() {
            return;
        }
        if let Some(ellipse) = self.only_ellipse() {
            let (squares, mass) = (symmetric(ellipse.squares), self.rough() as f32);
            match ellipse.profile {
                Profile::Beckmann => simd::mask::<BECKMANN>(squares, mass, rays),
                Profile::Ggx => simd::mask::<GGX>(squares, mass, rays),
            }
            return;
        }
        for (k, weight) in rays.weight.iter_mut().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let d = DVec3::new(-sign * f64::from(rays.x[k]), -sign * f64::from(rays.y[k]), -f64::from(rays.z[k]));
            *weight *= self.seen(d) as f32;
        }
    }

    /// Sum over rays inside of the lobe of this face towards `o`, without masking and `1 / |o.z|`; `square` is η².
    pub(super) fn sum_leaving(&self, sign: f64, rays: &RayColumns, o: [f32; 3], square: f32) -> f64 {
        if let Some(ellipse) = self.only_ellipse() {
            let inverse = symmetric(ellipse.inverse);
            let sum = match ellipse.profile {
                Profile::Beckmann => simd::leave::<BECKMANN>(rays, o, square, inverse),
                Profile::Ggx => simd::leave::<GGX>(rays, o, square, inverse),
            };
            return sum * self.rough() * ellipse.density(DVec2::ZERO);
        }
        let mut facets = LeavingColumns::default();
        simd::leaving_facets(rays, o, square, &mut facets);
        let slopes = facets.slope_x.iter().zip(&facets.slope_y);
        let values = facets.factor.iter().zip(slopes).filter(|(factor, _)| **factor > 0.0);
        values
            .map(|(factor, (x, y))| f64::from(*factor) * self.density(sign * DVec2::new((*x).into(), (*y).into())))
            .sum()
    }
}

/// The elements xx, xy and yy of a symmetric matrix.
pub(super) fn symmetric(matrix: DMat2) -> [f32; 3] {
    [matrix.x_axis.x as f32, matrix.x_axis.y as f32, matrix.y_axis.y as f32]
}
