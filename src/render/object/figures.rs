//! Figures for materials with structure at several scales: a bear and a snake.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::parametric::{ObjectBuilder, evenly};
use crate::render::ObjectMesh;

/// The ellipsoids of the bear: centre and half axes. x is to its left, z is to the front.
const BEAR: [([f64; 3], [f64; 3]); 13] = [
    // Body, belly and head.
    ([0.0, -0.28, 0.0], [0.46, 0.52, 0.42]),
    ([0.0, -0.33, 0.14], [0.37, 0.40, 0.34]),
    ([0.0, 0.45, 0.06], [0.36, 0.33, 0.33]),
    // Muzzle and nose.
    ([0.0, 0.37, 0.35], [0.16, 0.13, 0.15]),
    ([0.0, 0.43, 0.49], [0.055, 0.04, 0.04]),
    // Ears.
    ([0.26, 0.74, 0.02], [0.13, 0.14, 0.07]),
    ([-0.26, 0.74, 0.02], [0.13, 0.14, 0.07]),
    // Arms and paws.
    ([0.47, -0.12, 0.12], [0.15, 0.32, 0.16]),
    ([-0.47, -0.12, 0.12], [0.15, 0.32, 0.16]),
    ([0.46, -0.36, 0.24], [0.14, 0.14, 0.15]),
    ([-0.46, -0.36, 0.24], [0.14, 0.14, 0.15]),
    // Legs, stretched to the front.
    ([0.29, -0.72, 0.34], [0.18, 0.17, 0.34]),
    ([-0.29, -0.72, 0.34], [0.18, 0.17, 0.34]),
];

/// Builds a sitting bear of ellipsoids. Tile x runs around each of them, tile y from bottom to top.
pub(super) fn bear() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    for (center, half_axes) in BEAR {
        let (center, half_axes) = (DVec3::from(center), DVec3::from(half_axes));
        // Small parts need fewer vertices for the same outline.
        let count = if half_axes.max_element() > 0.2 { 64 } else { 32 };
        builder.add_patch(&evenly(count), &evenly(count / 2), |u, v| {
            let ((sin, cos), (rise, out)) = ((TAU * u).sin_cos(), (PI * (v - 0.5)).sin_cos());
            center + half_axes * DVec3::new(out * sin, rise, out * cos)
        });
    }
    builder.finish(false)
}

/// Largest radius of the snake.
const THICKNESS: f64 = 0.17;
/// Turns of its body to one side and the other, and how far they reach: nowhere sharper than its radius.
const BENDS: f64 = 1.2;
const REACH: f64 = 0.2;

/// The middle of the snake's body, from the tail at 0 to the head at 1.
fn spine(v: f64) -> DVec3 {
    // The head is raised.
    let raised = ((v - 0.82) / 0.18).max(0.0);
    DVec3::new(1.9 * (v - 0.5), -0.35 + 0.3 * raised * raised, REACH * (TAU * BENDS * v).sin() * (1.0 - 0.6 * raised))
}

/// The radius of its body: round at both ends, thin at the tail, with a neck behind the head.
fn radius(v: f64) -> f64 {
    let ends = (1.0 - (2.0 * v - 1.0).powi(16)).max(0.0).sqrt();
    let tail = (v / 0.55).min(1.0).powf(0.8);
    let head = 0.25 * (-((v - 0.95) / 0.035).powi(2)).exp() - 0.28 * (-((v - 0.86) / 0.05).powi(2)).exp();
    THICKNESS * ends * (0.12 + 0.88 * tail) * (1.0 + head)
}

/// Builds a snake. Tile x runs around its body, tile y from the tail to the head.
pub(super) fn snake() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    // Rows are dense at the ends, which are round.
    let rows: Vec<f64> = evenly(240).iter().map(|t| 0.5 - 0.5 * (PI * t).cos()).collect();
    builder.add_patch(&evenly(48), &rows, |u, v| {
        const STEP: f64 = 1e-4;
        let along = spine(v + STEP) - spine(v - STEP);
        let side = DVec3::new(-along.z, 0.0, along.x).normalize_or(DVec3::Z);
        let up = side.cross(along).normalize_or(DVec3::Y);
        let (sin, cos) = (TAU * u).sin_cos();
        spine(v) + (side * cos - up * sin) * radius(v)
    });
    builder.finish(false)
}
