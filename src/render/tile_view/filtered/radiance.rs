//! The reflectance of what a pixel holds: masking and shadows of the rest of the relief, and the mean of BRDF and colour
//! over its slopes.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};

use super::surface::PixelContent;
use crate::brdf::{LobeAngles, Term};
use crate::color_map::heights::{Largest, lambda, lit_part, pair_exponent};
use crate::color_map::pixel::{NarrowSlopes, SlopeAxes};
use crate::color_map::slopes::{Slopes, cotangent};
use crate::color_map::{Normal, normal};
use crate::math::directions::half_vector;
use crate::render::tile_view::ShadedMaterials;

/// Smallest ν of masking: below it, the plane of the low-passed surface is seen from behind [deviations].
const LOWEST_NU: f64 = 0.03;
/// Largest Λ of a pixel.
const MOST_LAMBDA: f64 = 30.0;
/// Lobes count as this part wider than their Gaussian, so that the ratio of both falls away from the centre.
const WIDER: f64 = 1.15;

/// Materials with their lobes apart: narrow ones have nodes of their own.
#[derive(Debug)]
pub struct PixelMaterials<'a> {
    materials: ShadedMaterials<'a>,
    /// Distinct narrow lobes: width in slopes.
    narrow: Vec<f64>,
}

/// Width of a lobe in slopes, seen from above; `None` for lobes without a peak.
fn width_of(term: &Term) -> Option<f64> {
    let half = 0.5_f64.sqrt();
    match term {
        Term::Lambertian { .. } | Term::Measured(_) => None,
        Term::BlinnPhong { exponent, .. } => Some(1.0 / f64::from(exponent.max(1.0)).sqrt()),
        Term::CookTorrance { roughness, .. } | Term::Ward { roughness, .. } => Some(half * f64::from(*roughness)),
        // The tails of this lobe are longer than those of a Gaussian.
        Term::Ggx { roughness, .. } => Some(f64::from(*roughness)),
    }
}

impl<'a> PixelMaterials<'a> {
    pub fn new(materials: ShadedMaterials<'a>) -> Self {
        let mut narrow: Vec<f64> = Vec::new();
        for width in materials.materials.iter().flat_map(|material| &material.brdf.terms).filter_map(width_of) {
            if !narrow.contains(&width) {
                narrow.push(width);
            }
        }
        Self { materials, narrow }
    }

    /// `Σ f_r (n·i)+ (n·o)+` of the terms of one width, over the slots of a pixel.
    fn reflected(&self, tints: &[(u16, Vec3)], width: Option<f64>, angles: &LobeAngles) -> DVec3 {
        let of = |(slot, tint): &(u16, Vec3)| {
            let index = self.materials.material_of_slot.get(usize::from(*slot));
            let Some(material) = index.and_then(|index| self.materials.materials.get(*index)) else {
                return Vec3::ZERO;
            };
            let terms = material.brdf.terms.iter().filter(|term| width_of(term) == width);
            terms.map(|term| term.f_cos(angles)).sum::<Vec3>() * material.color * *tint
        };
        tints.iter().map(of).sum::<Vec3>().as_dvec3()
    }
}

/// A node of a quadrature over slopes: a part of the distribution that is narrow against the colour map.
struct Node {
    slopes: NarrowSlopes,
    weight: f64,
}

/// Nodes and weights of a standard normal distribution along one axis, and the variance left within each node.
struct Rule {
    nodes: &'static [(f64, f64)],
    within: f64,
}

/// The Gauss-Hermite rule of 5 nodes: enough where the colour does not depend on the slope.
const SMOOTH: Rule = Rule {
    nodes: &[
        (-2.856_970, 0.011_257),
        (-1.355_626, 0.222_076),
        (0.0, 0.533_334),
        (1.355_626, 0.222_076),
        (2.856_970, 0.011_257),
    ],
    within: 0.0,
};
/// Even nodes, each a normal distribution: where the colour depends on the slope.
const FINE: Rule = Rule {
    nodes: &[
        (-2.4, 0.010_809),
        (-1.8, 0.042_807),
        (-1.2, 0.114_412),
        (-0.6, 0.206_368),
        (0.0, 0.251_208),
        (0.6, 0.206_368),
        (1.2, 0.114_412),
        (1.8, 0.042_807),
        (2.4, 0.010_809),
    ],
    within: 0.12,
};

/// A normal distribution of slopes as nodes. `axes` are the directions in which the colour changes.
fn nodes_of(slopes: &Slopes, axes: SlopeAxes) -> Vec<Node> {
    let (axis, rules) = match axes {
        SlopeAxes::None => (DVec2::X, [&SMOOTH, &SMOOTH]),
        SlopeAxes::One(axis) => (axis, [&FINE, &SMOOTH]),
        SlopeAxes::All => (DVec2::X, [&FINE, &FINE]),
    };
    let side = axis.perp();
    let [xx, xy, yy] = slopes.covariance;
    let times = |t: DVec2| DVec2::new(xx * t.x + xy * t.y, xy * t.x + yy * t.y);
    let along = slopes.variance_along(axis).sqrt();
    let shear = if along > 0.0 { times(axis).dot(side) / along } else { 0.0 };
    let across = (slopes.variance_along(side) - shear * shear).max(0.0).sqrt();
    if along + across < 1e-9 {
        return vec![Node { slopes: NarrowSlopes { mean: slopes.mean, covariance: [0.0; 3] }, weight: 1.0 }];
    }
    let [first, second] = rules;
    // The covariance within a node, from its two independent parts.
    let (p, q) = ((axis * along + side * shear) * first.within.sqrt(), side * (across * second.within.sqrt()));
    let covariance = [p.x * p.x + q.x * q.x, p.x * p.y + q.x * q.y, p.y * p.y + q.y * q.y];
    let mut nodes = Vec::with_capacity(first.nodes.len() * second.nodes.len());
    for (x, weight) in first.nodes {
        for (y, other) in second.nodes {
            let mean = slopes.mean + axis * (along * x) + side * (shear * x + across * y);
            nodes.push(Node { slopes: NarrowSlopes { mean, covariance }, weight: weight * other });
        }
    }
    nodes
}

/// The reflectance of a pixel towards a viewer.
pub(super) struct PixelReflectance<'a> {
    content: &'a PixelContent<'a>,
    materials: &'a PixelMaterials<'a>,
    slopes: Slopes,
    o: DVec3,
    lambda_o: f64,
    /// Projected area of what is seen, per base area.
    seen: f64,
    axes: SlopeAxes,
    nodes: Vec<Node>,
    /// Factors of the terms at each node.
    colors: Vec<DVec3>,
    terms: usize,
}

impl<'a> PixelReflectance<'a> {
    pub fn new(
        content: &'a PixelContent<'a>,
        materials: &'a PixelMaterials<'a>,
        axes: SlopeAxes,
        terms: usize,
        o: DVec3,
    ) -> Self {
        let mut slopes = content.relief.slopes;
        let (cot, t) = cotangent(o);
        // A pixel that is seen shows a plane that faces the viewer.
        let deviation = slopes.variance_along(t).sqrt();
        let behind = slopes.mean.dot(t) - (cot - LOWEST_NU * deviation - 1e-3);
        if cot.is_finite() && behind > 0.0 {
            slopes.mean -= t * behind;
        }
        let nodes = nodes_of(&slopes, axes);
        let mut colors = vec![DVec3::ONE; nodes.len() * terms];
        for (node, colors) in nodes.iter().zip(colors.chunks_mut(terms)) {
            content.colors.by_slopes(&node.slopes, colors);
        }
        let sine = o.truncate().length();
        let seen = if sine > 0.0 && deviation > 0.0 {
            sine * deviation * normal::ramp((cot - slopes.mean.dot(t)) / deviation)
        } else {
            o.z - slopes.mean.dot(o.truncate())
        };
        let lambda_o = masking(&slopes, o);
        Self { content, materials, slopes, o, lambda_o, seen: seen.max(1e-9), axes, nodes, colors, terms }
    }

    /// `f̄` of the pixel [1/sr], the light's cosine included, apart from shadows of the low-passed surface.
    pub fn towards(&self, i: DVec3) -> DVec3 {
        let apart = i.y.atan2(i.x) - self.o.y.atan2(self.o.x);
        let exponent = pair_exponent(self.lambda_o, masking(&self.slopes, i), apart);
        let largest = Largest { exponent }.moments();
        let left = self.content.relief.heights;
        let heights =
            Normal { mean: left.mean + left.deviation * largest.mean, deviation: left.deviation * largest.deviation };
        let mut factors = vec![DVec3::ZERO; self.terms];
        self.content.colors.by_heights(&heights, &mut factors);
        let (i32, o32) = (i.as_vec3(), self.o.as_vec3());
        let h = half_vector(i32, o32);
        let colored = |node: &Node, colors: &[DVec3]| -> DVec3 {
            if self.content.colors.has_sums() {
                let mut colors = colors.to_vec();
                self.content.colors.times_sums(&heights, &node.slopes, &mut colors);
                return colors.iter().zip(&factors).map(|(color, factor)| *color * *factor).sum();
            }
            colors.iter().zip(&factors).map(|(color, factor)| *color * *factor).sum()
        };
        // `f_cos √(1+s²)` per base area.
        let reflected = |width: Option<f64>, s: DVec2| {
            let length = (1.0 + s.length_squared()).sqrt();
            let n = (DVec3::new(-s.x, -s.y, 1.0) / length).as_vec3();
            let angles = LobeAngles::new(n, i32, o32, h);
            if angles.above() {
                self.materials.reflected(&self.content.tints, width, &angles) * length
            } else {
                DVec3::ZERO
            }
        };
        let mut sum = DVec3::ZERO;
        for (node, colors) in self.nodes.iter().zip(self.colors.chunks(self.terms)) {
            let value = reflected(None, node.slopes.mean);
            if value != DVec3::ZERO {
                sum += value * colored(node, colors) * node.weight;
            }
        }
        for width in &self.materials.narrow {
            sum += self.lobe(*width, h.as_dvec3(), &|s| reflected(Some(*width), s), &colored);
        }
        sum * (lit_part(self.lambda_o, exponent) / self.seen)
    }

    /// The mean over the slopes of a narrow lobe: nodes of the product of both Gaussians.
    fn lobe(
        &self,
        width: f64,
        h: DVec3,
        reflected: &dyn Fn(DVec2) -> DVec3,
        colored: &dyn Fn(&Node, &[DVec3]) -> DVec3,
    ) -> DVec3 {
        if h.z <= 1e-3 {
            return DVec3::ZERO;
        }
        let centre = -h.truncate() / h.z;
        let variance = (WIDER * width).powi(2) * (1.0 + centre.length_squared());
        let product = self.slopes.times_normal(centre, variance);
        let density = |s: DVec2| (-0.5 * (s - centre).length_squared() / variance).exp() / (2.0 * PI * variance);
        let mut sum = DVec3::ZERO;
        let mut colors = vec![DVec3::ONE; self.terms];
        for node in nodes_of(&product.1, self.axes) {
            let value = reflected(node.slopes.mean);
            if value == DVec3::ZERO {
                continue;
            }
            self.content.colors.by_slopes(&node.slopes, &mut colors);
            sum += value * colored(&node, &colors) * (node.weight / density(node.slopes.mean).max(1e-300));
        }
        sum * product.0
    }
}

/// Λ of a direction in the plane of the slopes' mean.
fn masking(slopes: &Slopes, direction: DVec3) -> f64 {
    lambda(slopes.nu(direction).max(LOWEST_NU)).min(MOST_LAMBDA)
}
