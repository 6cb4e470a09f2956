//! The BTDF of the two virtual slabs and their blend (Dai et al. 2009, Eqs. 6, 10 and 11), single pass.

use glam::{DVec2, DVec3};

use super::fresnel::reflectance;
use super::half_vectors::{HalfVector, from_inside, of_bottom, of_top};
use super::ndf::Ndf;
use super::optics::Channel;

/// A slab that is rough on one side only, at one pair: everything of Eq. 6 or 10 but G, D and absorption.
#[derive(Debug, Clone, Copy)]
pub struct Configuration {
    /// Jacobian, cosines, Fresnel factors and `1 / (n·h)⁴`: the BTDF is this times `p(slope)`.
    pub factor: f64,
    /// Slope of the rough facet.
    pub slope: DVec2,
    /// Unit direction of travel inside the slab.
    pub inner: DVec3,
}

/// Rough top over a level bottom (Eq. 6). `None` if no facet refracts `i` to `o`.
pub fn rough_top(i: DVec3, o: DVec3, eta: f64) -> Option<Configuration> {
    if !(i.z > 0.0 && o.z < 0.0) {
        return None;
    }
    let half = of_top(i, o, eta)?;
    let jacobian = half.inner_cosine / ((i + half.inner).length_squared() * half.inner.z.abs());
    let fresnel =
        (1.0 - reflectance(half.outer_cosine, eta)) * (1.0 - reflectance(half.inner.z.abs() / eta, 1.0 / eta));
    let factor = jacobian * half.outer_cosine * fresnel / (i.z * half.h.z.powi(4));
    configuration(factor, &half, half.inner / eta)
}

/// Rough bottom under a level top (Eq. 10). `None` if no facet refracts `i` to `o`.
pub fn rough_bottom(i: DVec3, o: DVec3, eta: f64) -> Option<Configuration> {
    if !(i.z > 0.0 && o.z < 0.0) {
        return None;
    }
    let half = of_bottom(i, o, eta)?;
    let factor = bottom_facet(o, eta, &half) * (1.0 - reflectance(i.z, eta)) / half.inner.z;
    configuration(factor, &half, -half.inner / eta)
}

/// Refraction of light that travels along `d` inside at the bottom face, towards `o`.
pub fn leaving_bottom(d: DVec3, o: DVec3, eta: f64) -> Option<Configuration> {
    if !(d.z < 0.0 && o.z < 0.0) {
        return None;
    }
    let half = from_inside(-eta * d, o)?;
    configuration(bottom_facet(o, eta, &half) / (eta * d.z.abs()), &half, d)
}

/// Jacobian (Eq. 9), cosines and Fresnel factor of a facet of the bottom face. The cosine of the light is left out.
fn bottom_facet(o: DVec3, eta: f64, half: &HalfVector) -> f64 {
    let jacobian = half.outer_cosine / (half.inner + o).length_squared();
    let fresnel = 1.0 - reflectance(half.inner_cosine / eta, 1.0 / eta);
    jacobian * half.inner_cosine * fresnel / (o.z.abs() * half.h.z.powi(4))
}

fn configuration(factor: f64, half: &HalfVector, inner: DVec3) -> Option<Configuration> {
    let slope = half.slope();
    (factor > 0.0 && factor.is_finite() && slope.is_finite()).then_some(Configuration { factor, slope, inner })
}

/// Smith's G of both faces along the directions that each really sees: the light and the direction inside at the top, and
/// the direction inside and the viewer at the bottom. The paper prints `G(i, o)` of one face.
pub fn masking(top: &Ndf, bottom: &Ndf, i: DVec3, inner: DVec3, o: DVec3) -> f64 {
    top.seen(i) * top.seen(inner) * bottom.seen(inner) * bottom.seen(o)
}

/// One rough face and one refraction (Walter et al. 2007, Eq. 21), with `o` as the direction inside: what Fig. 5 of Dai et
/// al. compares with. `face` is the density of the slopes, mass 1.
pub fn walter(face: &Ndf, i: DVec3, o: DVec3, eta: f64) -> f64 {
    let Some(h) = (-(i + eta * o)).try_normalize().filter(|h| h.z > 0.0) else { return 0.0 };
    let (outer, inner) = (i.dot(h), -o.dot(h));
    if outer <= 0.0 || inner <= 0.0 || i.z <= 0.0 || o.z >= 0.0 {
        return 0.0;
    }
    let slope = h.truncate() / h.z;
    let jacobian = eta * eta * inner / (i + eta * o).length_squared();
    let density = face.density(slope) / h.z.powi(4) * face.seen(i) * face.seen(o);
    (1.0 - reflectance(outer, eta)) * jacobian * outer * density / (i.z * o.z.abs())
}

/// Eq. 11: the two BTDFs blended in the logarithm. At the ends of `alpha` one of them stands alone, so that `0⁰` does not
/// arise.
pub fn blend(top: f64, bottom: f64, alpha: f64) -> f64 {
    if alpha >= 1.0 {
        return top;
    }
    if alpha <= 0.0 {
        return bottom;
    }
    if !(top > 0.0 && bottom > 0.0) {
        return 0.0;
    }
    (alpha * top.ln() + (1.0 - alpha) * bottom.ln()).exp()
}

/// The faces of a slab and the density of the differences of their rough slopes.
#[derive(Clone, Copy)]
pub struct DualFaces<'a, P: Fn(DVec2) -> f64> {
    pub top: &'a Ndf,
    pub bottom: &'a Ndf,
    /// Density of the virtual face, of mass 1. It is read at the slope of `h_t`, and at the opposite slope of `h_b`:
    /// one ray has nearly opposite slopes in the two configurations.
    pub virtual_density: P,
    pub alpha: f64,
}

impl<P: Fn(DVec2) -> f64> DualFaces<'_, P> {
    /// BTDF [1/sr] of the pair, single pass, without what only level facets transmit. Light that meets a level facet on
    /// one face sees the other face alone, for which Eq. 6 or 10 is exact; the rest is Eq. 11.
    pub fn btdf(&self, i: DVec3, o: DVec3, channel: Channel) -> f64 {
        let pair = Pair::new(i, o, channel);
        self.one_rough_at(&pair) + self.both_rough(&pair)
    }

    /// The light that meets a level facet on exactly one face.
    pub fn one_rough(&self, i: DVec3, o: DVec3, channel: Channel) -> f64 {
        let has_level = self.top.level() + self.bottom.level() > 0.0;
        if has_level { self.one_rough_at(&Pair::new(i, o, channel)) } else { 0.0 }
    }

    fn one_rough_at(&self, pair: &Pair) -> f64 {
        let Self { top, bottom, .. } = *self;
        let mut sum = 0.0;
        if let Some(at) = pair.top.as_ref().filter(|_| !top.is_smooth() && bottom.level() > 0.0) {
            sum += self.weight(pair, at, bottom.level() * top.density(at.slope));
        }
        if let Some(at) = pair.bottom.as_ref().filter(|_| !bottom.is_smooth() && top.level() > 0.0) {
            sum += self.weight(pair, at, top.level() * bottom.density(at.slope));
        }
        sum
    }

    /// Eq. 11 for the light that meets rough facets on both faces.
    fn both_rough(&self, pair: &Pair) -> f64 {
        let mass = self.top.rough() * self.bottom.rough();
        if mass <= 0.0 {
            return 0.0;
        }
        let value = |at: Option<&Configuration>, sign: f64| {
            at.map_or(0.0, |at| self.weight(pair, at, (self.virtual_density)(sign * at.slope)))
        };
        let top = if self.alpha > 0.0 { value(pair.top.as_ref(), 1.0) } else { 0.0 };
        // Eq. 11 is 0 where one of its factors is.
        let needs_bottom = self.alpha < 1.0 && (self.alpha <= 0.0 || top > 0.0);
        let bottom = if needs_bottom { value(pair.bottom.as_ref(), -1.0) } else { 0.0 };
        mass * blend(top, bottom, self.alpha)
    }

    /// The BTDF of a configuration whose rough facets have this density.
    fn weight(&self, pair: &Pair, at: &Configuration, density: f64) -> f64 {
        if density <= 0.0 {
            return 0.0;
        }
        let masking = masking(self.top, self.bottom, pair.i, at.inner, pair.o);
        density * masking * pair.channel.transmission(at.inner) * at.factor
    }
}

/// A pair of directions in both virtual slabs; `None` where no facet refracts `i` to `o`.
struct Pair {
    i: DVec3,
    o: DVec3,
    channel: Channel,
    top: Option<Configuration>,
    bottom: Option<Configuration>,
}

impl Pair {
    fn new(i: DVec3, o: DVec3, channel: Channel) -> Self {
        Self { i, o, channel, top: rough_top(i, o, channel.eta), bottom: rough_bottom(i, o, channel.eta) }
    }
}
