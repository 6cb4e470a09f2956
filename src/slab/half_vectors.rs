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
#[path = "half_vectors_tests.rs"]
mod tests;
