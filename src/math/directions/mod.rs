//! Directions of the upper hemisphere: angles, half vectors, and grids over directions and direction pairs. The frame
//! is the tile frame (z up), and angles are in radians.

mod half_difference;
mod hemisphere_pair_grid;
mod paraboloid;
mod polar_grid;
mod reduced_grid;

use glam::{DVec3, Vec3};

pub use half_difference::HalfDifferenceGrid;
pub use hemisphere_pair_grid::{GridCoordinates, HemispherePairGrid};
pub use paraboloid::{ParaboloidMap, ParaboloidSphere};
pub use polar_grid::{PolarGrid, Tap};
pub use reduced_grid::{CubicTaps, ReducedGrid, RingTaps};

/// The unit vector at `theta` from +z and `phi` from +x towards +y.
pub fn from_angles(theta: f32, phi: f32) -> Vec3 {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
}

/// The unit vector at `theta`, up to π from +z, and `phi` from +x towards +y, in double precision.
pub fn direction_of_angles(theta: f64, phi: f64) -> DVec3 {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    // The cosine of the nearest number to π/2 is not 0.
    let z = if cos_theta.abs() < 1e-15 { 0.0 } else { cos_theta };
    DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, z)
}

/// The inverse of [`direction_of_angles`], with `phi` in `[0, 2π)`.
pub fn angles_of_direction(direction: DVec3) -> (f64, f64) {
    let theta = direction.x.hypot(direction.y).atan2(direction.z);
    let phi = direction.y.atan2(direction.x);
    (theta, if phi < 0.0 { (phi + std::f64::consts::TAU).min(std::f64::consts::TAU.next_down()) } else { phi })
}

/// `(theta, phi)` of a unit vector, `phi` in `[0, 2π)`; accurate near the pole.
pub fn to_angles(direction: Vec3) -> (f32, f32) {
    let theta = direction.x.hypot(direction.y).atan2(direction.z);
    let phi = direction.y.atan2(direction.x);
    (theta, if phi < 0.0 { (phi + std::f32::consts::TAU).min(TAU_BELOW) } else { phi })
}

/// The largest f32 below 2π. It keeps an azimuth from being rounded up to a full turn.
const TAU_BELOW: f32 = std::f32::consts::TAU.next_down();

/// `(i+o)/|i+o|`; +z if the two are opposite.
pub fn half_vector(i: Vec3, o: Vec3) -> Vec3 {
    (i + o).try_normalize().unwrap_or(Vec3::Z)
}
