//! Half vectors of the two virtual slabs, each rough on one side only, and their Jacobians (Dai et al. 2009, Eqs. 2 to 9).
//!
//! `i` points to the light above the slab, `o` to the viewer below it. Half vectors point up.

use glam::{DVec2, DVec3};

/// A ray through a slab that is rough on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfVector {
    /// Unit normal of the facet that refracts `i` to `o`; it points up.
    pub h: DVec3,
    /// Direction of travel inside the slab is along the negative of this vector for a rough bottom, and along it for a
    /// rough top; its length is η (`o_m` or `i_m`).
    pub inner: DVec3,
    /// Cosine at the facet outside the slab, positive.
    pub outer_cosine: f64,
    /// Cosine at the facet inside the slab times η, positive.
    pub inner_cosine: f64,
}

impl HalfVector {
    /// Slope of the facet: `h.xy / h.z`.
    pub fn slope(&self) -> DVec2 {
        self.h.truncate() / self.h.z
    }
}

fn valid(h: DVec3, inner: DVec3, outer_cosine: f64, inner_cosine: f64) -> Option<HalfVector> {
    let is_valid = h.z > 0.0 && outer_cosine > 0.0 && inner_cosine > 0.0;
    is_valid.then_some(HalfVector { h, inner, outer_cosine, inner_cosine })
}

/// The facet of a rough top over a level bottom (Eq. 4): `h_t = -(i + o_m)/|i + o_m|` with
/// `o_m = (x_o, y_o, -√(η² - x_o² - y_o²))`. `None` if no facet refracts `i` to `o`, or if η is 1.
pub fn of_top(i: DVec3, o: DVec3, eta: f64) -> Option<HalfVector> {
    let inner = DVec3::new(o.x, o.y, -(eta * eta - o.x * o.x - o.y * o.y).max(0.0).sqrt());
    let h = -(i + inner).try_normalize()?;
    valid(h, inner, i.dot(h), -inner.dot(h))
}

/// The facet of a rough bottom under a level top (Eqs. 7 and 8): `h_b = (i_m + o)/|i_m + o|` with
/// `i_m = (x_i, y_i, √(η² - x_i² - y_i²))`. `None` if no facet refracts `i` to `o`, or if η is 1.
pub fn of_bottom(i: DVec3, o: DVec3, eta: f64) -> Option<HalfVector> {
    let inner = DVec3::new(i.x, i.y, (eta * eta - i.x * i.x - i.y * i.y).max(0.0).sqrt());
    from_inside(inner, o)
}

/// The facet of the bottom face that refracts light from inside to `o`. `inner` is η times the direction towards the
/// light inside.
pub fn from_inside(inner: DVec3, o: DVec3) -> Option<HalfVector> {
    let h = (inner + o).try_normalize()?;
    valid(h, inner, -o.dot(h), inner.dot(h))
}

/// `|∂ω_h / ∂ω_o|` of a rough top. Eq. 5 prints `|o·o_m|/η²` where `|o·z|/|o_m·z|` is right.
pub fn jacobian_top(i: DVec3, o: DVec3, half: &HalfVector) -> f64 {
    half.inner_cosine / (i + half.inner).length_squared() * (o.z / half.inner.z).abs()
}

/// `|∂ω_h / ∂ω_o|` of a rough bottom (Eq. 9).
pub fn jacobian_bottom(o: DVec3, half: &HalfVector) -> f64 {
    half.outer_cosine / (half.inner + o).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polar(degrees: f64, azimuth: f64) -> DVec3 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (y, x) = azimuth.to_radians().sin_cos();
        DVec3::new(sin * x, sin * y, cos)
    }

    /// The solid angle that `h` covers per solid angle of `o`, by central differences.
    fn differences(o: DVec3, h: impl Fn(DVec3) -> DVec3) -> f64 {
        let step = 1e-5;
        let u = o.cross(DVec3::new(0.3, 0.5, 0.8)).normalize();
        let v = o.cross(u);
        let slope =
            |along: DVec3| (h((o + step * along).normalize()) - h((o - step * along).normalize())) / (2.0 * step);
        slope(u).cross(slope(v)).length()
    }

    #[test]
    fn both_jacobians_are_the_finite_differences_at_0_to_85_degrees() {
        for degrees in [0.0, 30.0, 45.0, 60.0, 75.0, 85.0] {
            let i = polar(degrees, 0.0);
            let o = polar((degrees + 2.0_f64).min(88.0), 187.0) * DVec3::new(1.0, 1.0, -1.0);
            let top = jacobian_top(i, o, &of_top(i, o, 1.5).unwrap());
            let truth = differences(o, |o| of_top(i, o, 1.5).unwrap().h);
            assert!((top / truth - 1.0).abs() < 1e-6, "top, {degrees}: {top} {truth}");
            let bottom = jacobian_bottom(o, &of_bottom(i, o, 1.5).unwrap());
            let truth = differences(o, |o| of_bottom(i, o, 1.5).unwrap().h);
            assert!((bottom / truth - 1.0).abs() < 1e-6, "bottom, {degrees}: {bottom} {truth}");
        }
    }

    #[test]
    fn the_printed_jacobian_of_eq_5_is_too_large_by_1_07_at_30_and_6_2_at_85_degrees() {
        for (degrees, expected) in [(0.0, 1.0), (30.0, 1.070), (60.0, 1.483), (75.0, 2.424), (85.0, 6.234)] {
            let i = polar(degrees, 0.0);
            let o = -i;
            let half = of_top(i, o, 1.5).unwrap();
            let printed = o.dot(half.inner).abs() * half.inner_cosine / (1.5 * 1.5 * (i + half.inner).length_squared());
            let ratio = printed / jacobian_top(i, o, &half);
            assert!((ratio - expected).abs() < 2e-3, "{degrees}: {ratio}");
        }
    }

    #[test]
    fn the_half_vectors_of_one_ray_have_nearly_opposite_slopes() {
        let (i, o) = (DVec3::Z, polar(5.0, 20.0) * DVec3::new(-1.0, -1.0, -1.0));
        let (top, bottom) = (of_top(i, o, 1.5).unwrap().slope(), of_bottom(i, o, 1.5).unwrap().slope());
        assert!((top + bottom).length() < 0.02 * top.length(), "{top} {bottom}");
    }

    #[test]
    fn each_facet_refracts_its_ray_by_snell() {
        let (i, o) = (polar(40.0, 10.0), polar(33.0, 200.0) * DVec3::new(1.0, 1.0, -1.0));
        let half = of_top(i, o, 1.5).unwrap();
        let inner = super::super::fresnel::refract(-i, half.h, 1.5).unwrap();
        assert!((inner - half.inner / 1.5).length() < 1e-14);
        let half = of_bottom(i, o, 1.5).unwrap();
        let out = super::super::fresnel::refract(-half.inner / 1.5, half.h, 1.0 / 1.5).unwrap();
        assert!((out - o).length() < 1e-14);
    }

    #[test]
    fn no_facet_exists_without_a_change_of_index_on_the_straight_ray() {
        let i = polar(30.0, 0.0);
        assert!(of_top(i, -i, 1.0).is_none() && of_bottom(i, -i, 1.0).is_none());
    }
}
