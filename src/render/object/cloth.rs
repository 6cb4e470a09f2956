//! Cloth objects: a pillow and a skirt.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3};

use super::parametric::{ObjectBuilder, evenly};
use crate::render::ObjectMesh;

/// Builds a pillow that leans back: two puffed panels with a common square seam, whose sides curve inwards and pucker.
/// Tile x and y run along the panel's sides.
pub(super) fn pillow() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let samples = evenly(96);
    builder.add_patch(&samples, &samples, panel);
    // The back is the front rotated by 180° about the vertical, so that tile x runs to the right of its viewer, too.
    builder.add_patch(&samples, &samples, |u, v| {
        let p = panel(u, v);
        DVec3::new(-p.x, p.y, -p.z)
    });
    builder.rotate(DQuat::from_rotation_x(-22f64.to_radians()));
    builder.finish(false)
}

/// Returns a point of the front panel for parameters in [0, 1]. A sine maps them to x and y in [-1, 1], so that the
/// steep rise of the panel at the seam is smooth in the parameters.
fn panel(u: f64, v: f64) -> DVec3 {
    let (s, t) = ((2.0 * u - 1.0) * FRAC_PI_2, (2.0 * v - 1.0) * FRAC_PI_2);
    let (x, y) = (s.sin(), t.sin());
    let puff = (s.cos().max(0.0) * t.cos().max(0.0)).powf(1.15) * ((1.0 + 0.6 * x * x) * (1.0 + 0.6 * y * y));
    let pucker = |along: f64, across: f64, phase: f64| {
        let waves =
            (9.0 * along + 1.3 * (3.0 * along + phase).sin() + phase).cos() + 0.5 * (17.0 * along + 2.0 * phase).cos();
        waves * across.powi(4) * (1.0 - along.powi(4))
    };
    let side = |value: f64, a: f64, b: f64| if value < 0.0 { a } else { b };
    let puckers = pucker(y, x, side(x, 0.4, 2.1)) + pucker(x, y, side(y, 1.2, 3.3));
    let drawn_in = |along: f64, across: f64| across * (1.0 - 0.11 * (1.0 - along * along) * across * across);
    DVec3::new(drawn_in(y, x), drawn_in(x, y), 0.44 * puff * (1.0 + 0.13 * puckers))
}

/// Number of folds around the skirt.
const FOLDS: f64 = 9.0;

/// Builds a skirt: a cone whose folds deepen downwards and bulge where they face outwards. It is one two-sided sheet,
/// open at the waist and the hem. Tile x runs around the axis, tile y upwards.
pub(super) fn skirt() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    builder.add_patch(&evenly(400), &evenly(64), drape);
    builder.finish(true)
}

fn drape(u: f64, v: f64) -> DVec3 {
    let angle = TAU * u;
    // 0 at the waist, 1 at the hem.
    let fall = 1.0 - v;
    let below_band = ((fall - 0.05) / 0.95).max(0.0);
    // Integer numbers of waves around, so that the sheet closes; the sines vary the spacing of the folds.
    let phase =
        FOLDS * angle + 0.75 * (2.0 * angle + 1.0).sin() + 0.6 * (3.0 * angle + 2.2).sin() + 0.35 * (5.0 * angle).cos();
    let depth = (0.125 + 0.035 * (2.0 * angle + 0.7).cos() + 0.03 * (5.0 * angle + 1.0).sin()) * below_band.powf(1.25);
    let cone = 0.27 + 0.27 * below_band.powf(1.1) + 0.09 * smooth_step(below_band / 0.4);
    let radius = cone + depth * phase.cos();
    let bulge = 0.45 * below_band.powf(0.8) * phase.sin() / FOLDS;
    let sway = 0.06 * below_band * below_band * (3.0 * angle + 0.4).sin();
    let height = 1.25 * v - 0.15 * depth * phase.cos() * below_band;
    let (sin, cos) = (angle + bulge + sway).sin_cos();
    DVec3::new(radius * sin, height, radius * cos)
}

fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (6.0 * x - 15.0) + 10.0)
}
