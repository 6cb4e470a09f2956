//! A teapot: surfaces of revolution for body and lid, sweeps for spout and handle.

use glam::DVec2;

use super::curves::Spline;
use super::lathed::{lathe, sweep};
use super::parametric::{ObjectBuilder, evenly};
use crate::render::ObjectMesh;

/// Builds a teapot with the spout to the right. Its parts end inside each other, so that it is closed as viewed from
/// outside.
pub(super) fn teapot() -> ObjectMesh {
    let mut builder = ObjectBuilder::default();
    let profile = |spline: &Spline, v: f64| {
        let p = spline.at(v);
        DVec2::new(p.x.max(0.0), p.y)
    };

    let foot = Spline::through(&[
        [0.0, 0.035],
        [0.30, 0.035],
        [0.46, 0.03],
        [0.52, -0.015],
        [0.575, -0.01],
        [0.585, 0.04],
        [0.60, 0.12],
    ]);
    builder.add_patch(&evenly(96), &evenly(24), lathe(|v| profile(&foot, v)));
    let belly = Spline::through(&[
        [0.50, 0.03],
        [0.66, 0.09],
        [0.86, 0.24],
        [0.985, 0.46],
        [0.97, 0.70],
        [0.83, 0.90],
        [0.66, 1.01],
        [0.60, 1.045],
        [0.575, 1.085],
        [0.545, 1.085],
        [0.53, 1.03],
    ]);
    builder.add_patch(&evenly(112), &evenly(64), lathe(|v| profile(&belly, v)));
    let lid = Spline::through(&[
        [0.52, 1.01],
        [0.535, 1.075],
        [0.50, 1.105],
        [0.40, 1.165],
        [0.24, 1.225],
        [0.10, 1.26],
        [0.062, 1.30],
        [0.085, 1.345],
        [0.118, 1.395],
        [0.095, 1.45],
        [0.0, 1.472],
    ]);
    builder.add_patch(&evenly(96), &evenly(56), lathe(|v| profile(&lid, v)));

    let spout_path =
        Spline::through(&[[0.68, 0.36], [0.98, 0.44], [1.20, 0.62], [1.34, 0.85], [1.50, 1.03], [1.62, 1.10]]);
    // Path parameter and scale: up the outside, over the lip, and back down the inside.
    let spout_course = Spline::through(&[
        [0.0, 0.30],
        [0.20, 0.255],
        [0.45, 0.165],
        [0.70, 0.115],
        [0.90, 0.098],
        [0.985, 0.102],
        [1.005, 0.093],
        [0.985, 0.082],
        [0.85, 0.070],
        [0.60, 0.070],
    ]);
    let course = |v: f64| {
        let p = spout_course.at(v);
        DVec2::new(p.x, p.y)
    };
    builder.add_patch(&evenly(36), &evenly(64), sweep(&spout_path, [1.0, 0.88], course));

    let handle_path = Spline::through(&[
        [-0.70, 0.90],
        [-0.95, 0.955],
        [-1.22, 0.965],
        [-1.43, 0.86],
        [-1.49, 0.68],
        [-1.40, 0.49],
        [-1.20, 0.33],
        [-0.98, 0.25],
        [-0.78, 0.22],
    ]);
    let thickness = |v: f64| DVec2::new(v, 1.0 + 0.25 * (2.0 * v - 1.0).powi(4));
    builder.add_patch(&evenly(24), &evenly(56), sweep(&handle_path, [0.055, 0.085], thickness));
    builder.finish(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_teapot_is_wider_with_spout_and_handle_than_its_belly_and_stands_on_its_foot() {
        let mesh = teapot();
        let extent = |axis: fn(&glam::Vec3) -> f32| {
            let values = mesh.positions.iter().map(axis);
            (values.clone().fold(f32::INFINITY, f32::min), values.fold(f32::NEG_INFINITY, f32::max))
        };
        let (left, right) = extent(|p| p.x);
        let (back, front) = extent(|p| p.z);
        let (low, high) = extent(|p| p.y);
        assert!(right > 1.6 && left < -1.45, "{left} {right}");
        assert!((front - 0.99).abs() < 0.02 && (front + back).abs() < 1e-4, "{back} {front}");
        assert!((-0.05..0.0).contains(&low) && (1.4..1.55).contains(&high), "{low} {high}");
    }
}
