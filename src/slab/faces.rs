//! Eq. 1 of Dai et al. 2009 as a sum: facets of one face, each followed by the exact lobe of the other.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};

use super::dual::leaving_bottom;
use super::fresnel::{reflectance, refract};
use super::ndf::{Ndf, normal};
use super::optics::Channel;

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

/// The summed facets of a slab's rough parts.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceSum {
    top: Vec<(DVec2, f64)>,
    bottom: Vec<(DVec2, f64)>,
}

impl FaceSum {
    /// `count` facets of the smoother face, or of each.
    pub fn new(top: &Ndf, bottom: &Ndf, count: usize) -> Self {
        if top.is_smooth() || bottom.is_smooth() {
            return Self { top: Vec::new(), bottom: Vec::new() };
        }
        let order = Order::of_faces(top, bottom);
        let of = |face: &Ndf, other: Order| if order == other { Vec::new() } else { face.facets(count) };
        Self { top: of(top, Order::Bottom), bottom: of(bottom, Order::Top) }
    }

    /// The same facets on the slab turned over.
    pub fn turned(&self) -> Self {
        let turned = |facets: &[(DVec2, f64)]| facets.iter().map(|(slope, mass)| (-*slope, *mass)).collect();
        Self { top: turned(&self.bottom), bottom: turned(&self.top) }
    }

    /// BTDF [1/sr] of the light that meets rough facets on both faces, single pass.
    pub fn btdf(&self, top: &Ndf, bottom: &Ndf, i: DVec3, o: DVec3, channel: Channel) -> f64 {
        let over = DVec3::new(1.0, 1.0, -1.0);
        let mut orders = 0.0;
        let mut sum = 0.0;
        if !self.top.is_empty() {
            sum += Pass { first: top, second: bottom, facets: &self.top, sign: 1.0 }.btdf(i, o, channel);
            orders += 1.0;
        }
        if !self.bottom.is_empty() {
            // The slab turned over: its light comes from the viewer, and all slopes change sign.
            sum +=
                Pass { first: bottom, second: top, facets: &self.bottom, sign: -1.0 }.btdf(o * over, i * over, channel);
            orders += 1.0;
        }
        if orders > 0.0 { sum / orders } else { 0.0 }
    }
}

/// One order of the sum. Slopes of both faces are multiplied by `sign`.
struct Pass<'a> {
    first: &'a Ndf,
    second: &'a Ndf,
    facets: &'a [(DVec2, f64)],
    sign: f64,
}

impl Pass<'_> {
    fn btdf(&self, i: DVec3, o: DVec3, channel: Channel) -> f64 {
        if !(i.z > 0.0 && o.z < 0.0) {
            return 0.0;
        }
        let turned = DVec3::new(self.sign, self.sign, 1.0);
        let seen = |face: &Ndf, w: DVec3| face.seen(w * turned);
        let outer = seen(self.first, i) * seen(self.second, o) / i.z;
        let mut sum = 0.0;
        for (slope, mass) in self.facets {
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
                * seen(self.first, d)
                * seen(self.second, d)
                * channel.transmission(d)
                * lobe.factor
                * density;
        }
        sum * outer
    }
}
