//! Eq. 1 of Dai et al. 2009 as a sum: facets of one face, each followed by the exact lobe of the other.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};

use super::dual::leaving_bottom;
use super::fresnel::{reflectance, refract};
use super::ndf::{Ndf, normal};
use super::optics::Channel;
use crate::math::simd::{FacetColumns, Interior, RayColumns, enter};

/// The order of a sum: which face's facets are summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    Top,
    Bottom,
    /// The mean of both orders, for faces that are equally rough.
    Both,
}

/// Relative difference of variances up to which both faces count as equally rough.
const SAME_VARIANCE: f64 = 1e-9;

impl Order {
    /// Sums the facets of the face with fewer slopes: single ones, or those on a line. Of alike faces it sums those of the
    /// smoother one, because fewer of them are needed. The choice is the same for the slab turned over.
    pub fn of_faces(top: &Ndf, bottom: &Ndf) -> Self {
        match top.dimension().cmp(&bottom.dimension()) {
            Ordering::Less => Self::Top,
            Ordering::Greater => Self::Bottom,
            Ordering::Equal => Self::of_variances(top.rough_moments().1, bottom.rough_moments().1),
        }
    }

    fn of_variances(top: f64, bottom: f64) -> Self {
        if (top - bottom).abs() <= SAME_VARIANCE * (top + bottom) {
            return Self::Both;
        }
        if top < bottom { Self::Top } else { Self::Bottom }
    }
}

/// Facets of one face that are summed.
#[derive(Debug, Clone, PartialEq, Default)]
struct Facets {
    /// Slopes with their masses.
    list: Vec<(DVec2, f64)>,
    /// The same in single precision, as the side that light enters sees them.
    columns: FacetColumns,
}

impl Facets {
    /// `sign` is 1 for facets of the top, and -1 for those of the bottom, which light from below enters.
    fn new(list: Vec<(DVec2, f64)>, sign: f64) -> Self {
        let columns =
            FacetColumns::new(list.iter().map(|(slope, mass)| ((sign * *slope).as_vec2().to_array(), *mass as f32)));
        Self { list, columns }
    }

    fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

/// The summed facets of a slab's rough parts.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceSum {
    top: Facets,
    bottom: Facets,
}

impl FaceSum {
    /// `count` facets of the smoother face, or of each.
    pub fn new(top: &Ndf, bottom: &Ndf, count: usize) -> Self {
        if top.is_smooth() || bottom.is_smooth() {
            return Self { top: Facets::default(), bottom: Facets::default() };
        }
        let order = Order::of_faces(top, bottom);
        let of = |face: &Ndf, other: Order| if order == other { Vec::new() } else { face.facets(count) };
        Self { top: Facets::new(of(top, Order::Bottom), 1.0), bottom: Facets::new(of(bottom, Order::Top), -1.0) }
    }

    /// The same facets on the slab turned over.
    pub fn turned(&self) -> Self {
        let turned = |facets: &Facets, sign: f64| {
            Facets::new(facets.list.iter().map(|(slope, mass)| (-*slope, *mass)).collect(), sign)
        };
        Self { top: turned(&self.bottom, 1.0), bottom: turned(&self.top, -1.0) }
    }

    /// The sum for one direction `w`, above or below, and many on the other side.
    pub fn row<'a>(&'a self, top: &'a Ndf, bottom: &'a Ndf, w: DVec3, channel: Channel) -> SumRow<'a> {
        let passes = [
            Pass { first: top, second: bottom, facets: &self.top, sign: 1.0, channel },
            Pass { first: bottom, second: top, facets: &self.bottom, sign: -1.0, channel },
        ];
        let own = &passes[usize::from(w.z < 0.0)];
        let rays = own.is_single_precision().then(|| own.rays(from_above(w)));
        SumRow { passes, w, rays }
    }
}

/// The direction mirrored to the upper side: that of the slab turned over.
fn from_above(w: DVec3) -> DVec3 {
    w.with_z(w.z.abs())
}

/// The sum over facets for one direction and many others, for light that meets rough facets on both faces.
#[derive(Debug, Clone)]
pub struct SumRow<'a> {
    /// Light that enters at the top, and the slab turned over with light from the viewer.
    passes: [Pass<'a>; 2],
    w: DVec3,
    /// Rays from `w` inside; absent if single precision is too coarse.
    rays: Option<RayColumns>,
}

impl SumRow<'_> {
    /// BTDF [1/sr] for `w` and a direction on its other side, single pass. It is reciprocal.
    pub fn btdf(&self, other: DVec3) -> f64 {
        let is_pair = self.w.z * other.z < 0.0;
        let used = self.passes.iter().filter(|pass| !pass.facets.is_empty()).count();
        if !is_pair || used == 0 {
            return 0.0;
        }
        let (i, o) = if self.w.z > 0.0 { (self.w, other) } else { (other, self.w) };
        let down = |w: DVec3| w.with_z(-w.z.abs());
        let mut sum = 0.0;
        for (k, pass) in self.passes.iter().enumerate().filter(|(_, pass)| !pass.facets.is_empty()) {
            let (i, o) = if k == 0 { (i, o) } else { (from_above(o), down(i)) };
            let is_own = k == usize::from(self.w.z < 0.0);
            sum += match &self.rays {
                Some(rays) if is_own => pass.leaving(rays, i, o),
                _ => pass.btdf(i, o),
            };
        }
        sum / used as f64
    }
}

/// One order of the sum. Slopes of both faces are multiplied by `sign`.
#[derive(Debug, Clone)]
pub(super) struct Pass<'a> {
    first: &'a Ndf,
    second: &'a Ndf,
    facets: &'a Facets,
    sign: f64,
    channel: Channel,
}

/// Width of the narrowest lobe of a facet, `(η - 1)` times a deviation of slopes, down to which single precision resolves
/// it: it is wrong by some 1e-4 of this width.
const NARROWEST: f64 = 1e-3;

impl Pass<'_> {
    fn seen(&self, face: &Ndf, w: DVec3) -> f64 {
        face.seen(w * DVec3::new(self.sign, self.sign, 1.0))
    }

    fn is_single_precision(&self) -> bool {
        (self.channel.eta - 1.0) * self.second.narrowest() > NARROWEST
    }

    fn btdf(&self, i: DVec3, o: DVec3) -> f64 {
        if self.is_single_precision() { self.leaving(&self.rays(i), i, o) } else { self.in_double_precision(i, o) }
    }

    /// The rays of light from `i`, which points up, after each facet.
    fn rays(&self, i: DVec3) -> RayColumns {
        let mut rays = RayColumns::default();
        let Channel { eta, depth } = self.channel;
        let interior = Interior { eta: eta as f32, depth: depth as f32 };
        enter(&self.facets.columns, i.as_vec3().to_array(), interior, &mut rays);
        self.first.mask(self.sign, &mut rays);
        self.second.mask(self.sign, &mut rays);
        rays
    }

    /// BTDF [1/sr] of the rays of light from `i` towards `o`.
    fn leaving(&self, rays: &RayColumns, i: DVec3, o: DVec3) -> f64 {
        if !(i.z > 0.0 && o.z < 0.0) {
            return 0.0;
        }
        let square = (self.channel.eta * self.channel.eta) as f32;
        let sum = self.second.sum_leaving(self.sign, rays, o.as_vec3().to_array(), square);
        sum * self.seen(self.first, i) * self.seen(self.second, o) / (i.z * o.z.abs())
    }

    /// As [`Self::btdf`], for any width; the simple version.
    pub(super) fn in_double_precision(&self, i: DVec3, o: DVec3) -> f64 {
        if !(i.z > 0.0 && o.z < 0.0) {
            return 0.0;
        }
        let channel = self.channel;
        let outer = self.seen(self.first, i) * self.seen(self.second, o) / i.z;
        let mut sum = 0.0;
        for (slope, mass) in &self.facets.list {
            let h = normal(self.sign * *slope);
            let c = i.dot(h);
            let Some(d) = refract(-i, h, channel.eta).filter(|d| d.z < 0.0) else { continue };
            let Some(lobe) = leaving_bottom(d, o, channel.eta) else { continue };
            let density = self.second.density(self.sign * lobe.slope);
            if density <= 0.0 {
                continue;
            }
            let fresnel = 1.0 - reflectance(c, channel.eta);
            sum += mass * c / h.z
                * fresnel
                * self.seen(self.first, d)
                * self.seen(self.second, d)
                * channel.transmission(d)
                * lobe.factor
                * density;
        }
        sum * outer
    }
}

#[cfg(test)]
#[path = "faces_tests.rs"]
mod tests;
