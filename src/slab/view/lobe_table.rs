//! Mean and covariance of what a viewer receives, as a table over the direction of the viewer.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::Faces;
use crate::effective::{PathKind, ViewLobe, ViewLobes, Viewer};
use crate::slab::Slab;

/// Nodes per side of the square around the disc of stereographic coordinates, as in `seen_through.wgsl`.
const SIDE: usize = 33;
/// Paths per node.
const PATHS: usize = 256;
/// Largest distance of a node from the centre of the disc: 89°.
const RIM: f32 = 0.982_7;

/// Lobes by the direction of the viewer. The means are stored relative to the straight direction.
#[derive(Debug, Clone)]
pub(super) struct LobeTable {
    nodes: Vec<ViewLobes>,
}

/// Steps of the fit of a core and a tail.
const FIT_STEPS: usize = 6;

/// Directions of a bundle with their weights.
#[derive(Default)]
struct Bundle {
    part: Vec3,
    /// Tangential components relative to the straight direction, and weights.
    directions: Vec<(Vec2, f32)>,
}

impl Bundle {
    fn add(&mut self, direction: Vec3, from: Vec2, weight: Vec3) {
        self.part += weight;
        self.directions.push((direction.truncate() - from, weight.element_sum()));
    }

    /// Mean and covariance of the directions, each counted with a factor.
    fn moments(&self, factor: impl Fn(usize) -> f32) -> (Vec2, [f32; 3]) {
        let (mut weights, mut first) = (0.0, Vec2::ZERO);
        for (k, (at, weight)) in self.directions.iter().enumerate() {
            let weight = weight * factor(k);
            weights += weight;
            first += weight * *at;
        }
        let mean = if weights > 0.0 { first / weights } else { Vec2::ZERO };
        let mut second = [0.0; 3];
        for (k, (at, weight)) in self.directions.iter().enumerate() {
            let (d, weight) = (*at - mean, weight * factor(k));
            second.iter_mut().zip([d.x * d.x, d.x * d.y, d.y * d.y]).for_each(|(sum, value)| *sum += weight * value);
        }
        (mean, second)
    }

    /// Fits two Gaussians of one mean and one shape by expectation and maximisation. Tails would widen a single one.
    fn lobe(&self) -> ViewLobe {
        let total: f32 = self.directions.iter().map(|(_, weight)| weight).sum();
        if total <= 0.0 {
            return ViewLobe::default();
        }
        let (mut mean, second) = self.moments(|_| 1.0);
        let mut covariance = second.map(|sum| sum / total);
        let mut tail = 0.3;
        let mut in_tail = vec![0.0; self.directions.len()];
        for _ in 0..FIT_STEPS {
            let [xx, xy, yy] = covariance;
            let determinant = xx * yy - xy * xy;
            if determinant.is_nan() || determinant <= 1e-16 {
                break;
            }
            let mut weight_of_tail = 0.0;
            for (part, (at, weight)) in in_tail.iter_mut().zip(&self.directions) {
                let d = *at - mean;
                let square = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / determinant;
                let core = (1.0 - tail) * (-0.5 * square).exp();
                let far = tail / ViewLobe::TAIL * (-0.5 * square / ViewLobe::TAIL).exp();
                *part = if core + far > 0.0 { far / (core + far) } else { 1.0 };
                weight_of_tail += weight * *part;
            }
            tail = (weight_of_tail / total).clamp(1e-3, 0.9);
            // A direction of the tail says as much of the shape as one of the core at a smaller distance.
            let (center, second) = self.moments(|k| 1.0 - in_tail[k] * (1.0 - 1.0 / ViewLobe::TAIL));
            mean = center;
            covariance = second.map(|sum| sum / total);
        }
        ViewLobe { part: self.part, mean, covariance, tail }
    }
}

/// Steps from the middle of the disc to its rim, of slabs that are the same at every azimuth.
const RADII: usize = 65;
/// Paths per step.
const ROUND_PATHS: usize = 512;

/// Symmetries of the lobes of a slab.
enum Symmetry {
    None,
    /// Turned by 180°, the slab is the same.
    Opposite,
    /// Turned by any angle, the slab is the same.
    Round,
}

impl Symmetry {
    fn of(slab: &Slab) -> Self {
        let faces = [&slab.top, &slab.bottom];
        if faces.iter().all(|face| face.is_round()) {
            return Self::Round;
        }
        let is_opposite = faces.iter().all(|face| face.is_smooth() || face.only_ellipse().is_some());
        if is_opposite { Self::Opposite } else { Self::None }
    }
}

impl LobeTable {
    pub fn new(faces: &Faces, slab: &Slab) -> Self {
        let at = |k: usize| {
            let at = Vec2::new((k % SIDE) as f32, (k / SIDE) as f32) * (2.0 / (SIDE - 1) as f32) - 1.0;
            at.clamp_length_max(RIM)
        };
        let lobes_at = |at: Vec2, paths: usize| {
            let square = at.length_squared();
            let o = (2.0 * at / (1.0 + square)).extend((1.0 - square) / (1.0 + square));
            let straight = slab.straight(o.as_dvec3()).map(|part| part.as_vec3());
            lobes(faces, o, straight, paths)
        };
        let first = |count: usize| (0..count).into_par_iter().map(|k| lobes_at(at(k), PATHS)).collect::<Vec<_>>();
        let all = SIDE * SIDE;
        let nodes = match Symmetry::of(slab) {
            Symmetry::None => first(all),
            Symmetry::Opposite => {
                let half = first(all / 2 + 1);
                (0..all).map(|k| if k <= all / 2 { half[k] } else { turned(&half[all - 1 - k], Vec2::NEG_X) }).collect()
            }
            Symmetry::Round => {
                let radius = |k: usize| k as f32 * RIM / (RADII - 1) as f32;
                let radial: Vec<_> =
                    (0..RADII).into_par_iter().map(|k| lobes_at(Vec2::new(radius(k), 0.0), ROUND_PATHS)).collect();
                let node = |k: usize| {
                    let step = at(k).length() / RIM * (RADII - 1) as f32;
                    let low = (step as usize).min(RADII - 2);
                    let mut sum = ViewLobes::default();
                    add_all(&mut sum, &radial[low], 1.0 - (step - low as f32));
                    add_all(&mut sum, &radial[low + 1], step - low as f32);
                    turned(&sum, at(k).try_normalize().unwrap_or(Vec2::X))
                };
                (0..all).map(node).collect()
            }
        };
        Self { nodes }
    }

    pub fn nodes(&self) -> &[ViewLobes] {
        &self.nodes
    }

    /// The lobes of a viewer, interpolated.
    pub fn at(&self, o: Vec3) -> ViewLobes {
        let at = 0.5 * (o.truncate() / (1.0 + o.z.max(0.0)) + 1.0) * (SIDE - 1) as f32;
        let at = at.clamp(Vec2::ZERO, Vec2::splat((SIDE - 1) as f32 - 1e-3));
        let (x, y) = (at.x as usize, at.y as usize);
        let (s, t) = (at.x - x as f32, at.y - y as f32);
        let k = y * SIDE + x;
        let taps =
            [(k, (1.0 - s) * (1.0 - t)), (k + 1, s * (1.0 - t)), (k + SIDE, (1.0 - s) * t), (k + SIDE + 1, s * t)];
        let mut sum = ViewLobes::default();
        for (k, weight) in taps {
            add_all(&mut sum, &self.nodes[k], weight);
        }
        sum.transmitted.mean -= o.truncate();
        sum.reflected.mean -= o.truncate();
        sum
    }
}

/// The lobes turned about the normal, by the direction that the x axis becomes.
fn turned(lobes: &ViewLobes, axis: Vec2) -> ViewLobes {
    let turn = |lobe: &ViewLobe| {
        let [xx, xy, yy] = lobe.covariance;
        let (c, s) = (axis.x, axis.y);
        let covariance = [
            c * c * xx - 2.0 * c * s * xy + s * s * yy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            s * s * xx + 2.0 * c * s * xy + c * c * yy,
        ];
        ViewLobe { mean: axis.rotate(lobe.mean), covariance, ..*lobe }
    };
    ViewLobes { transmitted: turn(&lobes.transmitted), reflected: turn(&lobes.reflected), ..*lobes }
}

fn add_all(sum: &mut ViewLobes, lobes: &ViewLobes, weight: f32) {
    add(&mut sum.transmitted, &lobes.transmitted, weight);
    add(&mut sum.reflected, &lobes.reflected, weight);
    for side in 0..2 {
        sum.even[side] += weight * lobes.even[side];
        sum.straight[side] += weight * lobes.straight[side];
    }
}

fn add(sum: &mut ViewLobe, lobe: &ViewLobe, weight: f32) {
    sum.part += weight * lobe.part;
    sum.mean += weight * lobe.mean;
    sum.tail += weight * lobe.tail;
    sum.covariance.iter_mut().zip(lobe.covariance).for_each(|(sum, value)| *sum += weight * value);
}

/// The lobes of one viewer, from paths. Light from behind that was reflected inside counts as even.
fn lobes(faces: &Faces, o: Vec3, straight: [Vec3; 2], paths: usize) -> ViewLobes {
    let (mut transmitted, mut reflected, mut bounced) = (Bundle::default(), Bundle::default(), Vec3::ZERO);
    let viewer = Viewer { o, paths, seed: 0 };
    let from = -o.truncate();
    let mut even = faces.follow(&viewer, |end| match end.kind {
        PathKind::Transmitted => transmitted.add(end.direction, from, end.weight),
        PathKind::Bounced if end.direction.z < 0.0 => bounced += end.weight,
        _ => reflected.add(end.direction, from, end.weight),
    });
    even[0] += bounced;
    ViewLobes { transmitted: transmitted.lobe(), reflected: reflected.lobe(), even, straight }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec2;

    use super::*;
    use crate::slab::{Ndf, Optics, Profile, SlabView};

    #[test]
    fn symmetric_slabs_have_the_lobes_of_each_viewer() {
        let face = |x: f64, y: f64, angle: f64| Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::new(x, y), angle));
        let cases = [(face(0.2, 0.2, 0.0), face(0.1, 0.1, 0.0)), (face(0.1, 0.3, 0.5), Arc::new(Ndf::smooth()))];
        for (top, bottom) in cases {
            let slab = Arc::new(Slab::new(top, bottom, Optics::default(), 64));
            let view = SlabView::new(slab.clone());
            let super::super::Source::Faces { faces, lobes: table } = &view.source else { panic!("no faces") };
            // Nodes on all sides of the middle.
            for node in [8 * SIDE + 12, 12 * SIDE + 24, 22 * SIDE + 10, 25 * SIDE + 19] {
                let at = Vec2::new((node % SIDE) as f32, (node / SIDE) as f32) * (2.0 / (SIDE - 1) as f32) - 1.0;
                let at = at.clamp_length_max(RIM);
                let square = at.length_squared();
                let o = (2.0 * at / (1.0 + square)).extend((1.0 - square) / (1.0 + square));
                let (found, expected) = (table.nodes[node], lobes(faces, o, [Vec3::ZERO; 2], ROUND_PATHS));
                let (a, b) = (found.transmitted, expected.transmitted);
                let width = (b.covariance[0] + b.covariance[2]).sqrt();
                assert!((a.part - b.part).length() < 0.03, "{o}: {} {}", a.part, b.part);
                assert!((a.mean - b.mean).length() < 0.15 * width, "{o}: {} {} of {width}", a.mean, b.mean);
                for k in 0..3 {
                    assert!((a.covariance[k] - b.covariance[k]).abs() < 0.25 * width * width, "{o}: {a:?} {b:?}");
                }
            }
        }
    }
}
