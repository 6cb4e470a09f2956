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
    has_measured: bool,
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
        let mut terms = materials.materials.iter().flat_map(|material| &material.brdf.terms);
        let has_measured = terms.any(|term| matches!(term, Term::Measured(_)));
        Self { materials, narrow, has_measured }
    }

    /// The sum of a function of a material's terms over the slots of a pixel, with their colours.
    fn sum(&self, tints: &[(u16, Vec3)], of_terms: impl Fn(&[Term]) -> Vec3) -> DVec3 {
        let of = |(slot, tint): &(u16, Vec3)| {
            let index = self.materials.material_of_slot.get(usize::from(*slot));
            let material = index.and_then(|index| self.materials.materials.get(*index));
            material.map_or(Vec3::ZERO, |material| of_terms(&material.brdf.terms) * material.color * *tint)
        };
        tints.iter().map(of).sum::<Vec3>().as_dvec3()
    }

    /// `f_r` of the matte terms.
    fn matte(&self, tints: &[(u16, Vec3)]) -> DVec3 {
        let albedo = |term: &Term| match term {
            Term::Lambertian { albedo } => *albedo / std::f32::consts::PI,
            _ => Vec3::ZERO,
        };
        self.sum(tints, |terms| terms.iter().map(albedo).sum())
    }

    /// `Σ f_r (n·i)+ (n·o)+` of the measured terms.
    fn measured(&self, tints: &[(u16, Vec3)], angles: &LobeAngles) -> DVec3 {
        let measured = |terms: &[Term]| {
            terms.iter().filter(|term| matches!(term, Term::Measured(_))).map(|term| term.f_cos(angles)).sum()
        };
        self.sum(tints, measured)
    }

    /// `Σ f_r (n·i)+ (n·o)+` of the narrow terms of one width.
    fn narrow(&self, tints: &[(u16, Vec3)], width: f64, angles: &LobeAngles) -> DVec3 {
        let narrow = |terms: &[Term]| {
            terms.iter().filter(|term| width_of(term) == Some(width)).map(|term| term.f_cos(angles)).sum()
        };
        self.sum(tints, narrow)
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

/// Visits the nodes of a normal distribution of slopes. `axes` are the directions in which the colour changes.
fn for_each_node(slopes: &Slopes, axes: SlopeAxes, mut visit: impl FnMut(Node)) {
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
        return visit(Node { slopes: NarrowSlopes { mean: slopes.mean, covariance: [0.0; 3] }, weight: 1.0 });
    }
    let [first, second] = rules;
    // The covariance within a node, from its two independent parts.
    let (p, q) = ((axis * along + side * shear) * first.within.sqrt(), side * (across * second.within.sqrt()));
    let covariance = [p.x * p.x + q.x * q.x, p.x * p.y + q.x * q.y, p.y * p.y + q.y * q.y];
    for (x, weight) in first.nodes {
        for (y, other) in second.nodes {
            let mean = slopes.mean + axis * (along * x) + side * (shear * x + across * y);
            visit(Node { slopes: NarrowSlopes { mean, covariance }, weight: weight * other });
        }
    }
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
    /// Azimuth of the viewer.
    azimuth: f64,
    nodes: Vec<Node>,
    /// `(m·o)+ / |m|` of each node, times its weight, with `m = (-s, 1)`: what a matte node reflects per `(m·i)+`.
    matte_weights: Vec<f64>,
    /// `f_r` of the matte terms.
    matte: DVec3,
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
        let mut nodes = Vec::new();
        for_each_node(&slopes, axes, |node| nodes.push(node));
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
        let matte_weight = |node: &Node| {
            let s = node.slopes.mean;
            node.weight * (o.z - s.dot(o.truncate())).max(0.0) / (1.0 + s.length_squared()).sqrt()
        };
        Self {
            lambda_o: masking(&slopes, o),
            seen: seen.max(1e-9),
            azimuth: o.y.atan2(o.x),
            matte_weights: nodes.iter().map(matte_weight).collect(),
            matte: materials.matte(&content.tints),
            content,
            materials,
            slopes,
            o,
            axes,
            nodes,
            colors,
            terms,
        }
    }

    /// `f̄` of the pixel [1/sr], the light's cosine included, apart from shadows of the low-passed surface.
    pub fn towards(&self, i: DVec3) -> DVec3 {
        let apart = i.y.atan2(i.x) - self.azimuth;
        let exponent = pair_exponent(self.lambda_o, masking(&self.slopes, i), apart);
        let largest = Largest { exponent }.moments();
        let left = self.content.relief.heights;
        let heights =
            Normal { mean: left.mean + left.deviation * largest.mean, deviation: left.deviation * largest.deviation };
        let mut factors = vec![DVec3::ZERO; self.terms];
        self.content.colors.by_heights(&heights, &mut factors);
        let light = PixelLight {
            i: i.as_vec3(),
            h: half_vector(i.as_vec3(), self.o.as_vec3()),
            one_color: self.has_one_color().then(|| factors.iter().sum()),
            factors,
            heights,
        };
        let mut sum = self.matte(&light);
        if self.materials.has_measured {
            sum += self.measured(&light);
        }
        for width in &self.materials.narrow {
            sum += self.lobe(*width, &light);
        }
        sum * (lit_part(self.lambda_o, exponent) / self.seen)
    }

    /// Returns true if the colour does not depend on the slope.
    fn has_one_color(&self) -> bool {
        matches!(self.axes, SlopeAxes::None) && !self.content.colors.has_sums()
    }

    /// The colour of a node under a light.
    fn color(&self, light: &PixelLight, node: &Node, colors: &[DVec3]) -> DVec3 {
        if let Some(color) = light.one_color {
            return color;
        }
        let of = |colors: &[DVec3]| colors.iter().zip(&light.factors).map(|(color, factor)| *color * *factor).sum();
        if self.content.colors.has_sums() {
            let mut colors = colors.to_vec();
            self.content.colors.times_sums(&light.heights, &node.slopes, &mut colors);
            return of(&colors);
        }
        of(colors)
    }

    /// The nodes with their colours by slope.
    fn colored_nodes(&self) -> impl Iterator<Item = (&Node, &[DVec3])> {
        self.nodes.iter().zip(self.colors.chunks(self.terms))
    }

    /// The matte terms: in closed form at each node.
    fn matte(&self, light: &PixelLight) -> DVec3 {
        if self.matte == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let i = light.i.as_dvec3();
        let part = |node: &Node, weight: &f64| (i.z - node.slopes.mean.dot(i.truncate())).max(0.0) * weight;
        let sum = match light.one_color {
            Some(color) => color * self.nodes.iter().zip(&self.matte_weights).map(|(n, w)| part(n, w)).sum::<f64>(),
            None => self
                .colored_nodes()
                .zip(&self.matte_weights)
                .map(|((node, colors), weight)| (node, colors, part(node, weight)))
                .filter(|(_, _, part)| *part > 0.0)
                .map(|(node, colors, part)| self.color(light, node, colors) * part)
                .sum(),
        };
        sum * self.matte
    }

    /// The measured terms.
    fn measured(&self, light: &PixelLight) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (node, colors) in self.colored_nodes() {
            let reflected = self
                .per_base_area(light, node.slopes.mean, |angles| self.materials.measured(&self.content.tints, angles));
            if reflected != DVec3::ZERO {
                sum += reflected * self.color(light, node, colors) * node.weight;
            }
        }
        sum
    }

    /// `f_cos √(1+s²)` of a slope, per base area.
    fn per_base_area(&self, light: &PixelLight, s: DVec2, f_cos: impl Fn(&LobeAngles) -> DVec3) -> DVec3 {
        let length = (1.0 + s.length_squared()).sqrt();
        let n = (DVec3::new(-s.x, -s.y, 1.0) / length).as_vec3();
        let angles = LobeAngles::new(n, light.i, self.o.as_vec3(), light.h);
        if angles.above() { f_cos(&angles) * length } else { DVec3::ZERO }
    }

    /// The mean over the slopes of a narrow lobe: nodes of the product of both Gaussians.
    fn lobe(&self, width: f64, light: &PixelLight) -> DVec3 {
        let h = light.h.as_dvec3();
        if h.z <= 1e-3 {
            return DVec3::ZERO;
        }
        let centre = -h.truncate() / h.z;
        let variance = (WIDER * width).powi(2) * (1.0 + centre.length_squared());
        let product = self.slopes.times_normal(centre, variance);
        let density = |s: DVec2| (-0.5 * (s - centre).length_squared() / variance).exp() / (2.0 * PI * variance);
        let mut sum = DVec3::ZERO;
        let mut colors = vec![DVec3::ONE; self.terms];
        for_each_node(&product.1, self.axes, |node| {
            let reflected = self.per_base_area(light, node.slopes.mean, |angles| {
                self.materials.narrow(&self.content.tints, width, angles)
            });
            if reflected == DVec3::ZERO {
                return;
            }
            if light.one_color.is_none() {
                self.content.colors.by_slopes(&node.slopes, &mut colors);
            }
            sum +=
                reflected * self.color(light, &node, &colors) * (node.weight / density(node.slopes.mean).max(1e-300));
        });
        sum * product.0
    }
}

/// A light of a pixel.
struct PixelLight {
    i: Vec3,
    h: Vec3,
    /// Heights that are seen and lit.
    heights: Normal,
    /// Factors of the terms that depend on heights.
    factors: Vec<DVec3>,
    /// The colour, if it does not depend on the slope.
    one_color: Option<DVec3>,
}

/// Λ of a direction in the plane of the slopes' mean.
fn masking(slopes: &Slopes, direction: DVec3) -> f64 {
    lambda(slopes.nu(direction).max(LOWEST_NU)).min(MOST_LAMBDA)
}
