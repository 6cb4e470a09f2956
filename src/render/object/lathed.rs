//! Surfaces of revolution, and sweeps for their handles. Tile x runs around the axis, tile y along the profile.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec2, DVec3};

use super::curves::{RoundedPolyline, Spline};
use super::parametric::{ObjectBuilder, evenly};
use crate::render::ObjectMesh;

/// Revolves `profile(v) = (radius, y)` about the y axis; u runs to the right as viewed from outside.
pub(super) fn lathe(profile: impl Fn(f64) -> DVec2) -> impl Fn(f64, f64) -> DVec3 {
    move |u, v| {
        let (sin, cos) = (TAU * u).sin_cos();
        let p = profile(v);
        DVec3::new(p.x * sin, p.y, p.x * cos)
    }
}

/// Sweeps an ellipse along a curve in the xy plane. `course(v)` returns the curve parameter and the scale of the
/// ellipse. `half_axes` are in the curve's plane and across it.
pub(super) fn sweep(path: &Spline, half_axes: [f64; 2], course: impl Fn(f64) -> DVec2) -> impl Fn(f64, f64) -> DVec3 {
    move |u, v| {
        let DVec2 { x: t, y: scale } = course(v);
        let side = DVec3::Z.cross(path.tangent(t));
        let (sin, cos) = (TAU * u).sin_cos();
        path.at(t) + (side * (half_axes[0] * cos) + DVec3::Z * (half_axes[1] * sin)) * scale
    }
}

/// Builds the unit sphere.
pub(super) fn sphere() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let meridian = |v: f64| DVec2::from_angle(PI * v - FRAC_PI_2);
    builder.add_patch(&evenly(96), &evenly(48), lathe(meridian));
    builder.finish(false)
}

/// Builds an upright closed cylinder of radius 0.6 and height 1.6 with rounded edges.
pub(super) fn cylinder() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let profile = RoundedPolyline::new(&[(0.0, -0.8, 0.0), (0.6, -0.8, 0.025), (0.6, 0.8, 0.025), (0.0, 0.8, 0.0)]);
    builder.add_patch(&evenly(128), &profile.parameters(0.2, 8), lathe(|v| profile.at(v)));
    builder.finish(false)
}

/// Builds a round plate that leans back on its edge: flat in the middle, with a raised brim and a foot ring behind.
/// Tile x runs to the right everywhere, not around the axis.
pub(super) fn plate() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let profile = RoundedPolyline::new(&[
        (0.0, -0.010, 0.0),
        (0.52, -0.010, 0.01),
        (0.55, -0.040, 0.008),
        (0.58, -0.040, 0.008),
        (0.60, -0.005, 0.03),
        (0.70, 0.085, 0.15),
        (0.995, 0.150, 0.015),
        (0.995, 0.185, 0.015),
        (0.70, 0.125, 0.15),
        (0.58, 0.035, 0.20),
        (0.0, 0.030, 0.0),
    ]);
    builder.add_patch(&evenly(128), &profile.parameters(0.2, 6), lathe(|v| profile.at(v)));
    builder.lay_tangents_along(DVec3::X);
    builder.rotate(DQuat::from_rotation_x(56f64.to_radians()));
    builder.finish(false)
}

/// Builds a mug with thin walls, a rounded lip, and a handle on its right.
pub(super) fn cup() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let profile = RoundedPolyline::new(&[
        (0.0, 0.02, 0.0),
        (0.34, 0.02, 0.015),
        (0.36, 0.0, 0.010),
        (0.43, 0.0, 0.06),
        (0.50, 1.02, 0.021),
        (0.455, 1.02, 0.021),
        (0.39, 0.06, 0.09),
        (0.0, 0.06, 0.0),
    ]);
    builder.add_patch(&evenly(112), &profile.parameters(0.25, 12), lathe(|v| profile.at(v)));
    let path = Spline::through(&[
        [0.455, 0.82],
        [0.62, 0.86],
        [0.79, 0.76],
        [0.83, 0.55],
        [0.75, 0.34],
        [0.61, 0.23],
        [0.43, 0.22],
    ]);
    builder.add_patch(&evenly(24), &evenly(48), sweep(&path, [0.040, 0.062], |v| DVec2::new(v, 1.0)));
    builder.finish(false)
}
