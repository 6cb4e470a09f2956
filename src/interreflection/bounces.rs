//! The light that leaves the tile after one or more bounces, computed from the rays between elements.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use rayon::prelude::*;

use super::mirrored::MirroredNodes;
use super::transport::NO_HIT;
use super::{InterreflectionSettings, InterreflectionTable, Transport, mean_albedo};
use crate::base::{Cancel, Result};
use crate::brdf::{LobeAngles, Material, Term};
use crate::geometry::{Facets, TileMesh};
use crate::math::directions::half_vector;
use crate::math::linalg::gemm::multiply_transposed;
use crate::visibility::Visibility;

/// Number of rays per matrix product.
const BLOCK: usize = 256;
/// Number of parts of the elements. Their sums are added in order, so results do not depend on the number of threads.
const PARTS: usize = 16;
/// Lower limit of the cosine that a lobe is divided by; it bounds the contribution of rays along their own surface.
const MIN_COSINE: f32 = 1e-3;

/// Inputs of a bounce.
struct Exchange<'a> {
    facets: &'a Facets,
    transport: &'a Transport,
    /// Material, colour and diffuse albedo of each element.
    materials: Vec<&'a Material>,
    colors: Vec<Vec3>,
    albedos: Vec<Vec3>,
    /// Node directions, and the visibility of every element (row) along them.
    nodes: Vec<Vec3>,
    visibility: Vec<f32>,
    /// View nodes that are computed.
    mirrored: MirroredNodes,
    channels: usize,
}

/// Computes `G` of interreflection from rays and visibility.
///
/// With `E₁(i)` the irradiance of a facet after one bounce, `B` the operator of one more diffuse bounce, and `D = ΔA
/// ρ/π`: `G = 1/A [ Σ_rays ΔA π/K f_t f_s + E₁(o)ᵀ D (1 + B + B² + …) E₁(i) ]`. Each of the two `E₁` comes from half of
/// the rays, because the product of one estimate with itself would be biased by its variance.
///
/// # Errors
/// Returns [`crate::base::Error::Cancelled`] if `cancel` is set.
pub fn gather(
    mesh: &TileMesh,
    facets: &Facets,
    visibility: &Visibility,
    transport: &Transport,
    (material_of_slot, materials): (&[usize], &[Material]),
    settings: &InterreflectionSettings,
    cancel: &Cancel,
) -> Result<InterreflectionTable> {
    let exchange = Exchange::new(facets, visibility, transport, material_of_slot, materials, settings);
    let (count, nodes, channels) = (transport.facets.len(), exchange.nodes.len(), exchange.channels);
    let viewers = exchange.mirrored.computed.len();
    let mut g = vec![0.0_f64; channels * viewers * nodes];
    let mut halves = [vec![0.0_f32; count * nodes * channels], vec![0.0_f32; count * nodes * channels]];
    let [even, odd] = &mut halves;
    let part = count.div_ceil(PARTS).max(1);
    let sums: Vec<Vec<f64>> = even
        .par_chunks_mut(part * nodes * channels)
        .zip(odd.par_chunks_mut(part * nodes * channels))
        .enumerate()
        .map(|(k, (even, odd))| if cancel.is_set() { Vec::new() } else { exchange.one_bounce(k * part, [even, odd]) })
        .collect();
    cancel.check()?;
    for sum in &sums {
        g.iter_mut().zip(sum).for_each(|(g, sum)| *g += sum);
    }
    if settings.bounces > 1 {
        let mut incident = halves[1].clone();
        let mut arriving = incident.clone();
        for _ in 2..settings.bounces {
            cancel.check()?;
            arriving = exchange.diffuse_bounce(&arriving);
            incident.iter_mut().zip(&arriving).for_each(|(sum, new)| *sum += new);
        }
        exchange.add_reflected(&halves[0], &incident, &mut g);
    }
    cancel.check()?;
    let scale = 1.0 / f64::from(mesh.base_area());
    let at = |o: usize, i: usize, c: usize| {
        let (viewer, light) = exchange.mirrored.original_of(o, i);
        (g[(c.min(channels - 1) * viewers + viewer) * nodes + light] * scale) as f32
    };
    let pairs = (0..nodes * nodes).map(|pair| (pair / nodes, pair % nodes));
    let raw: Vec<Vec3> = pairs.map(|(o, i)| Vec3::new(at(o, i, 0), at(o, i, 1), at(o, i, 2))).collect();
    Ok(InterreflectionTable::new(settings.grid, &raw, transport.hit_fraction()))
}

impl<'a> Exchange<'a> {
    fn new(
        facets: &'a Facets,
        visibility: &Visibility,
        transport: &'a Transport,
        material_of_slot: &[usize],
        all: &'a [Material],
        settings: &InterreflectionSettings,
    ) -> Self {
        let nodes = settings.grid.directions();
        let elements = &transport.facets;
        let material = |s: &u32| &all[material_of_slot[usize::from(facets.slots[*s as usize])]];
        let materials: Vec<&Material> = elements.iter().map(material).collect();
        let colors: Vec<Vec3> =
            elements.iter().zip(&materials).map(|(s, material)| facets.colors[*s as usize] * material.color).collect();
        let material_albedos: Vec<Vec3> = all.iter().map(|material| mean_albedo(&material.brdf, 8, 24)).collect();
        let albedo = |s: &u32| material_albedos[material_of_slot[usize::from(facets.slots[*s as usize])]];
        let albedos: Vec<Vec3> =
            elements.iter().zip(&colors).map(|(s, color)| (albedo(s) * *color).min(Vec3::ONE)).collect();
        let rows: Vec<Vec<f32>> = nodes
            .par_iter()
            .map(|&node| {
                let mut all = vec![0.0; facets.len()];
                visibility.fill(node, 0..facets.len(), &mut all);
                elements.iter().map(|&s| all[s as usize]).collect()
            })
            .collect();
        let mut transposed = vec![0.0; elements.len() * nodes.len()];
        for (node, row) in rows.iter().enumerate() {
            for (element, v) in row.iter().enumerate() {
                transposed[element * nodes.len() + node] = *v;
            }
        }
        let achromatic =
            colors.iter().all(|color| has_no_hue(*color)) && materials.iter().all(|material| is_grey(material));
        let mirrored = MirroredNodes::new(settings.grid, settings.mirrors);
        let channels = if achromatic { 1 } else { 3 };
        Self { facets, transport, materials, colors, albedos, nodes, visibility: transposed, mirrored, channels }
    }

    /// `f(away, node) / (n·away) · V(node)` of an element for some nodes: the radiance that it sends along `away` per
    /// unit irradiance from a node or, for a viewer at the node, the weight of light that arrives along `-away`.
    fn lobe(&self, element: usize, away: Vec3, at: impl ExactSizeIterator<Item = usize>, out: &mut [f32]) {
        let normal = self.facets.normals[self.transport.facets[element] as usize];
        let cosine = normal.dot(away);
        let count = self.nodes.len();
        let visibility = &self.visibility[element * count..(element + 1) * count];
        let brdf = &self.materials[element].brdf;
        let scale = self.colors[element] / cosine.max(MIN_COSINE);
        let rows = at.len();
        for (row, node) in at.enumerate() {
            let to = self.nodes[node];
            let visible = cosine > 0.0 && visibility[node] > 0.0 && normal.dot(to) > 0.0;
            let value = if visible {
                brdf.f_cos(&LobeAngles::new(normal, away, to, half_vector(away, to))) * scale * visibility[node]
            } else {
                Vec3::ZERO
            };
            for c in 0..self.channels {
                out[(c * rows + row) * BLOCK] = value[c];
            }
        }
    }

    /// Sums the rays of the elements from `first` on. Returns `G` of one bounce, a matrix per channel, and writes the
    /// irradiance that each element receives through the even and the odd half of its rays.
    fn one_bounce(&self, first: usize, halves: [&mut [f32]; 2]) -> Vec<f64> {
        let (nodes, channels, rays) = (self.nodes.len(), self.channels, self.transport.rays);
        let viewers = self.mirrored.computed.len();
        let elements = halves[0].len() / (nodes * channels);
        let mut g = vec![0.0_f64; channels * viewers * nodes];
        // One column per ray.
        let mut to_viewer = vec![0.0_f32; channels * viewers * BLOCK];
        let mut from_light = vec![0.0_f32; channels * nodes * BLOCK];
        let mut product = vec![0.0_f32; viewers * nodes];
        let mut filled = 0;
        let mut flush = |to_viewer: &mut Vec<f32>, from_light: &mut Vec<f32>, filled: &mut usize| {
            for c in 0..channels {
                let (a, b) = (&to_viewer[c * viewers * BLOCK..], &from_light[c * nodes * BLOCK..]);
                multiply_transposed(viewers, BLOCK, nodes, a, b, &mut product);
                let sums = &mut g[c * viewers * nodes..(c + 1) * viewers * nodes];
                sums.iter_mut().zip(&product).for_each(|(sum, new)| *sum += f64::from(*new));
            }
            to_viewer.fill(0.0);
            from_light.fill(0.0);
            *filled = 0;
        };
        let half_weight = PI / (rays / 2).max(1) as f32;
        for element in 0..elements {
            let at = first + element;
            let weight = self.transport.areas[at] * PI / rays as f32;
            for k in 0..rays {
                let ray = at * rays + k;
                let hit = self.transport.hits[ray];
                if hit == NO_HIT || self.is_black(at) || self.is_black(hit as usize) {
                    continue;
                }
                let away = self.transport.directions[ray];
                self.lobe(at, away, self.mirrored.computed.iter().copied(), &mut to_viewer[filled..]);
                self.lobe(hit as usize, -away, 0..nodes, &mut from_light[filled..]);
                let half = &mut halves[k % 2][element * nodes * channels..(element + 1) * nodes * channels];
                for (slot, sum) in half.iter_mut().enumerate() {
                    *sum += half_weight * from_light[slot * BLOCK + filled];
                }
                for slot in 0..viewers * channels {
                    to_viewer[slot * BLOCK + filled] *= weight;
                }
                filled += 1;
                if filled == BLOCK {
                    flush(&mut to_viewer, &mut from_light, &mut filled);
                }
            }
        }
        if filled > 0 {
            flush(&mut to_viewer, &mut from_light, &mut filled);
        }
        g
    }

    fn is_black(&self, element: usize) -> bool {
        self.colors[element] == Vec3::ZERO
    }

    /// Irradiance after one more reflection by diffuse surfaces.
    fn diffuse_bounce(&self, arriving: &[f32]) -> Vec<f32> {
        let (width, nodes, rays) = (self.nodes.len() * self.channels, self.nodes.len(), self.transport.rays);
        let mut next = vec![0.0_f32; arriving.len()];
        next.par_chunks_mut(width).enumerate().for_each(|(element, next)| {
            for &hit in &self.transport.hits[element * rays..(element + 1) * rays] {
                if hit == NO_HIT {
                    continue;
                }
                let from = &arriving[hit as usize * width..(hit as usize + 1) * width];
                for (c, (next, from)) in next.chunks_mut(nodes).zip(from.chunks(nodes)).enumerate() {
                    let weight = self.albedos[hit as usize][c] / rays as f32;
                    next.iter_mut().zip(from).for_each(|(next, from)| *next += weight * from);
                }
            }
        });
        next
    }

    /// Adds `E₁(o)ᵀ D E(i)` to `g`.
    fn add_reflected(&self, to_viewer: &[f32], incident: &[f32], g: &mut [f64]) {
        let (nodes, width) = (self.nodes.len(), self.nodes.len() * self.channels);
        let (count, viewers) = (self.transport.facets.len(), self.mirrored.computed.len());
        let (mut a, mut b, mut product) =
            (vec![0.0_f32; viewers * count], vec![0.0_f32; nodes * count], vec![0.0_f32; viewers * nodes]);
        for c in 0..self.channels {
            for element in 0..count {
                let weight = self.transport.areas[element] * self.albedos[element][c] * FRAC_1_PI;
                let from = element * width + c * nodes;
                for (row, viewer) in self.mirrored.computed.iter().enumerate() {
                    a[row * count + element] = weight * to_viewer[from + viewer];
                }
                for node in 0..nodes {
                    b[node * count + element] = incident[from + node];
                }
            }
            multiply_transposed(viewers, count, nodes, &a, &b, &mut product);
            let sums = &mut g[c * viewers * nodes..(c + 1) * viewers * nodes];
            sums.iter_mut().zip(&product).for_each(|(sum, new)| *sum += f64::from(*new));
        }
    }
}

fn has_no_hue(color: Vec3) -> bool {
    color.max_element() - color.min_element() <= 1e-6 * color.max_element()
}

/// Returns true if a material reflects all channels alike. Measured BRDFs count as coloured.
pub fn is_grey(material: &Material) -> bool {
    has_no_hue(material.color)
        && material.brdf.terms.iter().all(|term| match term {
            Term::Measured(_) => false,
            _ => has_no_hue(term.tint(0.0)) && has_no_hue(term.tint(1.0)),
        })
}
