//! Reflection and refraction at a plane interface.

use glam::DVec3;

/// Unpolarised Fresnel reflectance at cosine `cosine` in `[0, 1]` on the side of the light; `eta` is the index behind the
/// interface over the index before it. 1 if all light is reflected.
pub fn reflectance(cosine: f64, eta: f64) -> f64 {
    let c = cosine.clamp(0.0, 1.0);
    let square = eta * eta - 1.0 + c * c;
    if square <= 0.0 {
        return 1.0;
    }
    let g = square.sqrt();
    // At grazing incidence without a change of index both terms are 0.
    let ratio = |a: f64, b: f64| if b > 0.0 { (a / b) * (a / b) } else { 0.0 };
    0.5 * (ratio(c - g, c + g) + ratio(eta * eta * c - g, eta * eta * c + g))
}

/// Refracts the direction of travel `d` at a facet whose unit normal `h` points to the side that the light comes from:
/// `d/η + (c/η - c_t) h` with the cosines `c` and `c_t` before and behind. `None` if all light is reflected, or if the
/// light comes from behind the facet.
pub fn refract(d: DVec3, h: DVec3, eta: f64) -> Option<DVec3> {
    let c = -d.dot(h);
    let square = 1.0 - (1.0 - c * c) / (eta * eta);
    if c <= 0.0 || square <= 0.0 {
        return None;
    }
    (d / eta + (c / eta - square.sqrt()) * h).try_normalize()
}

/// The direction inside a level slab of index `eta` of light that travels along `d` outside.
pub fn inside(d: DVec3, eta: f64) -> DVec3 {
    let (x, y) = (d.x / eta, d.y / eta);
    DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt().copysign(d.z))
}

/// The direction outside of light that travels along `d` inside a level slab; `None` if it is totally reflected.
pub fn outside(d: DVec3, eta: f64) -> Option<DVec3> {
    let (x, y) = (d.x * eta, d.y * eta);
    let square = 1.0 - x * x - y * y;
    (square > 0.0).then(|| DVec3::new(x, y, square.sqrt().copysign(d.z)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_reflectances_of_glass() {
        assert!((reflectance(1.0, 1.5) - 0.04).abs() < 1e-12);
        assert_eq!(reflectance(0.0, 1.5), 1.0);
        assert_eq!(reflectance(0.5, 1.0), 0.0);
        assert_eq!(reflectance(0.5, 1.0 / 1.5), 1.0);
        // At Brewster's angle only the s part is reflected: half of ((η² - 1) / (η² + 1))².
        let brewster = 1.5_f64.atan().cos();
        assert!((reflectance(brewster, 1.5) - 0.5 * (1.25_f64 / 3.25).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn reflectance_is_the_same_from_both_sides_of_a_ray() {
        for degrees in [1.0, 30.0, 60.0, 89.0_f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let inside = (1.0 - (sin / 1.5).powi(2)).sqrt();
            assert!((reflectance(cos, 1.5) - reflectance(inside, 1.0 / 1.5)).abs() < 1e-13);
        }
    }

    #[test]
    fn refraction_follows_snell_and_goes_back_the_same_way() {
        let d = DVec3::new(0.5, -0.2, -0.9).normalize();
        let h = DVec3::new(0.1, 0.3, 1.0).normalize();
        let inner = refract(d, h, 1.5).unwrap();
        assert!((d.cross(h).length() - 1.5 * inner.cross(h).length()).abs() < 1e-14);
        let back = refract(-inner, -h, 1.0 / 1.5).unwrap();
        assert!((back + d).length() < 1e-14);
        assert!((inside(d, 1.5) - refract(d, DVec3::Z, 1.5).unwrap()).length() < 1e-14);
        assert!((outside(inside(d, 1.5), 1.5).unwrap() - d).length() < 1e-14);
    }
}
