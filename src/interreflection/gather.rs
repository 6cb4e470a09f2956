//! The light that leaves the tile after it was reflected by two facets or more.

use std::ops::Range;

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::mirrored::{MOST_IMAGES, MirroredNodes, draw_image};
use super::sampler::LobeSampler;
use super::transport::{Ray, Vertex, first_density};
use super::viewer_weights::ViewerWeights;
use super::{InterreflectionSettings, InterreflectionTable, Transport};
use crate::base::{Cancel, Result};
use crate::brdf::{LobeAngles, Material, Term, analytic_lobe};
use crate::geometry::{Facets, TileMesh};
use crate::math::directions::half_vector;
use crate::math::linalg::gemm::add_outer_products;
use crate::math::simd::{Lobe, add_lobes_around, masked_sum};
use crate::visibility::Visibility;

/// Groups of rays per matrix product.
const BLOCK: usize = 512;
/// Number of groups that are walked a second time to estimate the variance, and the largest number of groups that one of
/// them stands for.
const EXAMINED: usize = 1024;
const MOST_PER_EXAMINED: usize = 8;
/// Variance of the stratified rays relative to independent ones, on many tiles.
const STRATIFIED: f64 = 0.6;
/// Elements whose visibility is computed at once.
const TOGETHER: usize = 64;
/// Lower limit of the cosine that a lobe is divided by. It bounds the contribution of rays along their own surface.
const MIN_COSINE: f32 = 1e-3;
/// Walks whose weight is below this are continued at random, with a weight of this.
const MIN_WEIGHT: f32 = 0.5;
/// The same at hidden elements, as between the threads of a weave: few walks return from there.
const MIN_HIDDEN_WEIGHT: f32 = 4.0;
/// Openness below which an element counts as hidden.
const HIDDEN: f32 = 0.05;

/// Inputs of the walks.
struct Exchange<'a> {
    facets: &'a Facets,
    transport: &'a Transport,
    /// Material and colour of each element.
    materials: Vec<&'a Reflector<'a>>,
    colors: Vec<Vec3>,
    /// Components of the node directions, and the visibility of every element (row) along them.
    nodes: [Vec<f32>; 3],
    visibility: Vec<f32>,
    /// Mean visibility of each element over the nodes.
    openness: Vec<f32>,
    /// The nodes that are viewers, and their images.
    mirrored: &'a MirroredNodes,
    channels: usize,
    bounces: usize,
}

/// A material with what walks need.
struct Reflector<'a> {
    material: &'a Material,
    lobes: Vec<Option<Lobe>>,
    sampler: &'a LobeSampler,
    /// All terms are Lambertian, so that a ray does not depend on where its light came from.
    is_matte: bool,
}

/// Computes `G` of interreflection by walks over the surface.
///
/// Ray `r` starts at a facet `x` along `ω` with density `p` and meets the surface at `y`. With `L(y, i)` the radiance
/// that `y` sends back to `x` per unit irradiance from the light `i`, `G(o, i) = 1/A Σ_r ΔA/(K p) f(x; ω, o) V(x, o)
/// L(y, i)`, where `f` includes both cosines. A random walk from `y` estimates `L` for all lights at once: each vertex
/// `z`, reached against the direction `ω_z`, adds its weight times `f(z; ω_z, i) / (n·ω_z) V(z, i)`. The steps of a walk
/// follow the BRDF of each facet ([`LobeSampler`]). A vertex has the visibility of the nearest element.
///
/// If `n` reflections `M` map the tile to itself, `G(o, i)` is computed for one `o` of each set of mirror images. A glossy
/// ray then adds `f(x; ω, M o) V(x, M o) L(y, M i) / (n p)` for one `M`, drawn with the probability `p`.
///
/// # Errors
/// Returns [`crate::base::Error::Cancelled`] if `cancel` is set.
pub fn gather(
    mesh: &TileMesh,
    facets: &Facets,
    visibility: &Visibility,
    transport: &Transport,
    (material_of_slot, materials, samplers): (&[usize], &[Material], &[LobeSampler]),
    settings: &InterreflectionSettings,
    cancel: &Cancel,
) -> Result<InterreflectionTable> {
    let mirrored = MirroredNodes::new(settings.grid, settings.mirrors);
    let reflectors: Vec<Reflector> = materials.iter().zip(samplers).map(Reflector::new).collect();
    let directions = (&settings.grid.directions()[..], &mirrored);
    let surface = (facets, visibility, transport);
    let exchange = Exchange::new(surface, (material_of_slot, &reflectors), directions, settings.bounces);
    let (nodes, viewers, channels) = (exchange.nodes[0].len(), mirrored.computed.len(), exchange.channels);
    let (g, variance) = exchange.sum(&ViewerWeights::new(settings.grid, &mirrored), cancel)?;
    let scale = 1.0 / f64::from(mesh.base_area());
    let at = |pair: usize| {
        let (viewer, light) = mirrored.original_of(pair / nodes, pair % nodes);
        let of = |c: usize| (g[(c.min(channels - 1) * nodes + light) * viewers + viewer] * scale) as f32;
        Vec3::new(of(0), of(1), of(2))
    };
    let raw: Vec<Vec3> = (0..nodes * nodes).into_par_iter().map(at).collect();
    let noise = variance.sqrt() * scale;
    Ok(InterreflectionTable::new(settings.grid, &raw, noise))
}

impl<'a> Reflector<'a> {
    fn new((material, sampler): (&'a Material, &'a LobeSampler)) -> Self {
        let is_matte = material.brdf.terms.iter().all(|term| matches!(term, Term::Lambertian { .. }));
        Self { material, lobes: material.brdf.terms.iter().map(analytic_lobe).collect(), sampler, is_matte }
    }
}

impl<'a> Exchange<'a> {
    fn new(
        (facets, visibility, transport): (&'a Facets, &Visibility, &'a Transport),
        (material_of_slot, all): (&[usize], &'a [Reflector<'a>]),
        (nodes, mirrored): (&[Vec3], &'a MirroredNodes),
        bounces: usize,
    ) -> Self {
        let elements = &transport.facets;
        let materials: Vec<&Reflector<'_>> =
            elements.iter().map(|s| &all[material_of_slot[usize::from(facets.slots[*s as usize])]]).collect();
        let colors: Vec<Vec3> =
            elements.iter().zip(&materials).map(|(s, of)| facets.colors[*s as usize] * of.material.color).collect();
        let achromatic =
            colors.iter().all(|color| has_no_hue(*color)) && materials.iter().all(|of| is_grey(of.material));
        let visibility = visible_from(visibility, elements, nodes);
        Self {
            facets,
            transport,
            materials,
            colors,
            openness: visibility
                .par_chunks(nodes.len())
                .map(|row| row.iter().sum::<f32>() / nodes.len() as f32)
                .collect(),
            visibility,
            nodes: [0, 1, 2].map(|axis| nodes.iter().map(|node| node[axis]).collect()),
            mirrored,
            channels: if achromatic { 1 } else { 3 },
            bounces,
        }
    }

    /// The sums over all rays, a matrix of lights and viewers per channel, and the sum of the variances of all pairs and
    /// three channels, weighted.
    fn sum(&self, weights: &ViewerWeights, cancel: &Cancel) -> Result<(Vec<f64>, f64)> {
        let (nodes, viewers, channels) = (self.nodes[0].len(), self.mirrored.computed.len(), self.channels);
        let groups: Vec<(usize, Range<usize>)> = self.groups().into_iter().enumerate().collect();
        let mut g = vec![0.0_f64; channels * viewers * nodes];
        let rows = groups.len().min(BLOCK);
        let mut to_viewer = vec![0.0_f32; rows * channels * viewers];
        let mut from_light = vec![0.0_f32; rows * channels * nodes];
        let per_examined = (groups.len() / EXAMINED).clamp(1, MOST_PER_EXAMINED);
        let (mut examined, mut variance) = (0, 0.0);
        // At least two tasks per channel, so that few threads end together. Their number changes no bit of the products.
        let tasks = rayon::current_num_threads().div_ceil(channels).max(2);
        for block in groups.chunks(BLOCK) {
            cancel.check()?;
            let of_groups: Vec<Option<f64>> = to_viewer
                .par_chunks_mut(channels * viewers)
                .zip(from_light.par_chunks_mut(channels * nodes))
                .zip(block)
                .map(|((to_viewer, from_light), (number, group))| {
                    self.fill((*number, group), weights, [&mut *to_viewer, &mut *from_light]);
                    is_examined(group, per_examined).then(|| self.variance(group, weights, [to_viewer, from_light]))
                })
                .collect();
            examined += of_groups.iter().flatten().count();
            variance += of_groups.iter().flatten().sum::<f64>();
            let rows = nodes.div_ceil(tasks);
            g.par_chunks_mut(viewers * nodes).enumerate().for_each(|(c, sums)| {
                sums.par_chunks_mut(rows * viewers).enumerate().for_each(|(task, sums)| {
                    let a = &from_light[c * nodes + task * rows..];
                    let b = &to_viewer[c * viewers..];
                    let strides = [channels * nodes, channels * viewers];
                    add_outer_products(block.len(), [sums.len() / viewers, viewers], [a, b], strides, sums);
                });
            });
        }
        let per_pair = STRATIFIED * 3.0 / channels as f64 * groups.len() as f64 / examined.max(1) as f64;
        Ok((g, variance * per_pair))
    }

    /// Rays that carry light, in groups whose light reaches all viewers in the same proportions: the rays of a matte
    /// element are one group, every other ray is a group of its own.
    fn groups(&self) -> Vec<Range<usize>> {
        let rays = &self.transport.rays;
        let is_useful = |ray: &usize| rays[*ray].hit.is_some_and(|hit| !self.is_black(hit.element as usize));
        let mut groups = Vec::new();
        let mut start = 0;
        for of_element in rays.chunk_by(|a, b| a.element == b.element) {
            let all = start..start + of_element.len();
            start = all.end;
            let element = of_element[0].element as usize;
            if self.is_black(element) || self.openness[element] <= 0.0 {
                continue;
            }
            if !self.materials[element].is_matte {
                groups.extend(all.filter(is_useful).map(|ray| ray..ray + 1));
            } else if all.clone().any(|ray| is_useful(&ray)) {
                groups.push(all);
            }
        }
        groups
    }

    /// Writes what a mirror image of a numbered group of rays sends to each viewer, and what it carries from each light.
    /// Matte elements stay as they are: all images send nearly as much, and all rays of an element would share one image.
    fn fill(&self, (number, group): (usize, &Range<usize>), weights: &ViewerWeights, rows: [&mut [f32]; 2]) {
        let [to_viewer, from_light] = rows;
        let Ray { element, direction, .. } = self.transport.rays[group.start];
        let element = element as usize;
        let normal = self.facets.normals[self.transport.facets[element] as usize];
        let away = if self.materials[element].is_matte { normal } else { direction };
        let nodes = self.nodes[0].len();
        let mut to_node = vec![0.0; self.channels * nodes];
        self.add_lobe(element, [normal, away], Vec3::ONE, (&self.nodes, self.visible(element)), &mut to_node);
        to_viewer.fill(0.0);
        from_light.fill(0.0);
        let drawn = match self.materials[element].is_matte || self.mirrored.images.len() == 1 {
            true => Some((0, 1.0)),
            false => self.drawn_image(number, &to_node, weights),
        };
        let Some((reflection, scale)) = drawn else { return };
        let image = &self.mirrored.images[reflection];
        for (to_viewer, to_node) in to_viewer.chunks_mut(self.mirrored.computed.len()).zip(to_node.chunks(nodes)) {
            let of_viewers = to_viewer.iter_mut().zip(&self.mirrored.computed);
            of_viewers.for_each(|(value, node)| *value = scale * to_node[image[*node]]);
        }
        group.clone().for_each(|ray| self.walk(ray, from_light));
        self.reflect(reflection, from_light);
    }

    /// The mirror image that stands for a numbered group, which sends `to_node` itself, and its weight.
    fn drawn_image(&self, number: usize, to_node: &[f32], weights: &ViewerWeights) -> Option<(usize, f32)> {
        let of_images = weights.of_images.each_ref().map(Vec::as_slice);
        let mut powers = [0.0; MOST_IMAGES];
        for values in to_node.chunks(self.nodes[0].len()) {
            powers.iter_mut().zip(masked_sum(of_images, values, values)).for_each(|(sum, power)| *sum += power);
        }
        // Fractional parts of multiples of an irrational number are evenly distributed, also over neighbouring groups,
        // which are alike. It is not that of `is_examined`, so that the examined groups draw all images.
        let number = ((number as f64 + 0.5) * std::f64::consts::SQRT_2).fract();
        draw_image(&powers[..self.mirrored.images.len()], number)
    }

    /// Moves the values of all nodes to their images.
    fn reflect(&self, reflection: usize, values: &mut [f32]) {
        if reflection > 0 {
            for values in values.chunks_mut(self.nodes[0].len()) {
                let before = values.to_vec();
                let images = &self.mirrored.images[reflection];
                values.iter_mut().zip(images).for_each(|(value, node)| *value = before[*node]);
            }
        }
    }

    /// The part of the weighted variance of all pairs that is due to a group of many independent rays. A ray contributes
    /// `a(o) b(i)`, and the values of swapped pairs are averaged: with `|a|²` and `a·b` weighted as viewers (`v`) or lights
    /// (`l`), `Σ ((a(o) b(i) + a(i) b(o))/2)² = (|a|²_v |b|²_l + |a|²_l |b|²_v + 2 (a·b)_v (a·b)_l)/4`.
    fn variance(&self, group: &Range<usize>, weights: &ViewerWeights, [to_viewer, from_light]: [&[f32]; 2]) -> f64 {
        let (viewers, nodes) = (self.mirrored.computed.len(), self.nodes[0].len());
        let of_viewers = [&weights.viewers[..], &weights.lights];
        let of_all = [&weights.all_viewers[..], &weights.all_lights];
        let of_ray = |from_light: &[f32]| {
            let of_channel = |(a, b): (&[f32], &[f32])| {
                let b_of_viewers: Vec<f32> = self.mirrored.computed.iter().map(|node| b[*node]).collect();
                let [a_v, a_l] = masked_sum(of_viewers, a, a);
                let [b_v, b_l] = masked_sum(of_all, b, b);
                let [ab_v, ab_l] = masked_sum(of_viewers, a, &b_of_viewers);
                0.25 * (a_v * b_l + a_l * b_v + 2.0 * ab_v * ab_l)
            };
            to_viewer.chunks(viewers).zip(from_light.chunks(nodes)).map(of_channel).sum::<f64>()
        };
        if group.len() == 1 {
            return of_ray(from_light);
        }
        let of_number = |ray: usize| {
            let mut from_light = vec![0.0; self.channels * nodes];
            self.walk(ray, &mut from_light);
            of_ray(&from_light)
        };
        group.clone().map(of_number).sum()
    }

    /// Follows a ray over the surface and adds the light from each node that returns along it, times the area over the
    /// density of the ray.
    fn walk(&self, number: usize, from_light: &mut [f32]) {
        let Ray { element, area, direction, hit } = self.transport.rays[number];
        let Some(mut at) = hit else { return };
        let facet = self.transport.facets[element as usize] as usize;
        let cosine = self.facets.normals[facet].dot(direction).max(MIN_COSINE);
        // `add_lobe` divides what is sent to the viewers by this cosine.
        let scale = area * cosine / first_density(cosine);
        let mut rng = ChaCha8Rng::seed_from_u64(number as u64);
        let (mut towards, mut weight) = (-direction, Vec3::ONE);
        for bounce in 1..=self.bounces {
            let element = at.element as usize;
            let lights = (&self.nodes, self.visible(element));
            if self.openness[element] > 0.0 {
                self.add_lobe(element, [at.normal, towards], weight * scale, lights, from_light);
            }
            if bounce < self.bounces {
                let Some(next) = self.step(&at, towards, &mut weight, &mut rng) else { break };
                (at, towards) = next;
            }
        }
    }

    /// The visibility of an element along each node.
    fn visible(&self, element: usize) -> &[f32] {
        let nodes = self.nodes[0].len();
        &self.visibility[element * nodes..(element + 1) * nodes]
    }

    /// One step of a walk: the next point, and the direction back from it. Multiplies the weight of the walk.
    fn step(&self, at: &Vertex, towards: Vec3, weight: &mut Vec3, rng: &mut ChaCha8Rng) -> Option<(Vertex, Vec3)> {
        let Reflector { material, sampler, .. } = self.materials[at.element as usize];
        let numbers = [rng.random(), rng.random(), rng.random()];
        let (direction, factor) = sampler.sample(&material.brdf, at.normal, towards, numbers)?;
        *weight *= factor * sampler.color_of_walk(self.colors[at.element as usize]);
        let is_hidden = self.openness[at.element as usize] < HIDDEN;
        let survival = weight.max_element() / if is_hidden { MIN_HIDDEN_WEIGHT } else { MIN_WEIGHT };
        if survival < 1.0 {
            if rng.random::<f32>() >= survival {
                return None;
            }
            *weight /= survival;
        }
        if direction.dot(at.geometric_normal) <= 0.0 {
            return None;
        }
        let next = self.transport.tracer.trace(at.origin, direction, at.triangle)?;
        (next.normal.dot(direction) < 0.0).then_some((next, -direction))
    }

    /// Adds `weight · f(away, node)/(n·away) · V(node)` of an element for some nodes: the radiance that it sends along
    /// `away` per unit irradiance from a node or, for a viewer at the node, the weight of light that arrives along
    /// `-away`.
    fn add_lobe(
        &self,
        element: usize,
        [normal, away]: [Vec3; 2],
        weight: Vec3,
        (nodes, visibility): (&[Vec<f32>; 3], &[f32]),
        out: &mut [f32],
    ) {
        let cosine = normal.dot(away);
        if cosine <= 0.0 {
            return;
        }
        let Reflector { material, lobes, .. } = self.materials[element];
        let scale = weight * self.colors[element] / cosine.max(MIN_COSINE);
        let count = visibility.len();
        for (term, lobe) in material.brdf.terms.iter().zip(lobes) {
            if let Some(lobe) = lobe {
                let [below, at_grazing] = [term.tint(1.0) * scale, term.tint(0.0) * scale];
                let to = nodes.each_ref().map(Vec::as_slice);
                if self.channels == 1 {
                    let tints = [[below.x, at_grazing.x]];
                    add_lobes_around::<1>(*lobe, [normal, away], to, visibility, tints, out);
                } else {
                    let tints = [0, 1, 2].map(|c| [below[c], at_grazing[c]]);
                    add_lobes_around::<3>(*lobe, [normal, away], to, visibility, tints, out);
                }
                continue;
            }
            for (k, v) in visibility.iter().enumerate().filter(|(_, v)| **v > 0.0) {
                let to = Vec3::new(nodes[0][k], nodes[1][k], nodes[2][k]);
                if normal.dot(to) > 0.0 {
                    let f = term.f_cos(&LobeAngles::new(normal, away, to, half_vector(away, to))) * scale * *v;
                    for c in 0..self.channels {
                        out[c * count + k] += f[c];
                    }
                }
            }
        }
    }

    fn is_black(&self, element: usize) -> bool {
        self.colors[element] == Vec3::ZERO
    }
}

/// Returns true for one of `of` groups, whatever the sequence of their rays.
fn is_examined(group: &Range<usize>, of: usize) -> bool {
    (group.start as u32).wrapping_mul(0x9e37_79b9) >> 16 < (1 << 16) / of as u32
}

/// The visibility of each element (row) along each node.
fn visible_from(visibility: &Visibility, elements: &[u32], nodes: &[Vec3]) -> Vec<f32> {
    let chosen: Vec<usize> = elements.iter().map(|s| *s as usize).collect();
    let subset = visibility.subset(&chosen);
    let fill = |node: Vec3, range: Range<usize>, out: &mut [f32]| {
        if let Some(subset) = &subset {
            return subset.fill(node, range, out);
        }
        // Bit maps have no subset, and are read faster in runs.
        let of_block = &chosen[range];
        let (Some(first), Some(last)) = (of_block.first(), of_block.last()) else { return };
        let mut run = vec![0.0; last + 1 - first];
        visibility.fill(node, *first..last + 1, &mut run);
        of_block.iter().zip(out).for_each(|(s, out)| *out = run[s - first]);
    };
    let mut rows = vec![0.0; elements.len() * nodes.len()];
    let blocks = rows.par_chunks_mut(TOGETHER * nodes.len()).enumerate();
    blocks.for_each_init(Vec::new, |values, (block, rows)| {
        let first = block * TOGETHER;
        let count = rows.len() / nodes.len();
        values.resize(count, 0.0);
        for (k, node) in nodes.iter().enumerate() {
            fill(*node, first..first + count, values);
            rows[k..].iter_mut().step_by(nodes.len()).zip(&*values).for_each(|(to, value)| *to = *value);
        }
    });
    rows
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
