//! The backdrop of an object: an endless plane with an image, and the environment.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};

use super::pyramid::{Kernel, Pyramid};
use crate::render::lighting::environment::LatLongMap;

/// Everything that a viewer sees behind and around an object. Positions and directions are in the world frame.
#[derive(Debug, Clone)]
pub struct Backdrop {
    pub(super) plane: Option<Plane>,
    environment: SurroundingMap,
    /// Mean radiance over a hemisphere, weighted by the cosine, by the direction of its axis.
    even: SurroundingMap,
}

/// An endless glowing plane of constant z, seen from its side of larger z.
#[derive(Debug, Clone)]
pub struct Plane {
    pub z: f32,
    /// Texels per world unit; rows run downwards.
    pub scale: f32,
    /// Texel of the axis x = y = 0.
    pub origin: Vec2,
    pub pyramid: Pyramid,
}

/// Radiance by direction.
#[derive(Debug, Clone)]
struct SurroundingMap {
    pyramid: Pyramid,
    /// Rotation about the vertical axis [rad].
    rotation: f32,
}

/// Deviations of the position and the direction of a bundle of rays: two vectors each.
#[derive(Debug, Clone, Copy, Default)]
pub struct BackdropFootprint {
    pub position: [Vec3; 2],
    pub direction: [Vec3; 2],
}

/// The footprint of a bundle on the plane and on the environment.
#[derive(Debug, Clone, Copy)]
pub struct BackdropKernel {
    plane: Option<Kernel>,
    environment: Option<Kernel>,
    /// Deviation of the vertical component of the direction to the plane.
    tilt: f32,
}

/// Size of the map of even light [texels].
const EVEN_SIZE: [usize; 2] = [32, 16];
/// Cosines below which directions count as parallel to the plane, for the size of footprints.
const LEAST_COSINE: f32 = 0.02;

impl BackdropKernel {
    /// Ratio of the variance that is read to the one requested: for the plane if `below` is true, else for the environment.
    pub fn share(&self, below: bool) -> f32 {
        let plane = self.plane.as_ref().filter(|_| below);
        plane.or(self.environment.as_ref()).map_or(1.0, |kernel| kernel.share)
    }
}

impl BackdropFootprint {
    /// Deviation of the z of the direction.
    fn tilt(&self) -> f32 {
        let [u, v] = self.direction;
        (u.z * u.z + v.z * v.z).sqrt()
    }
}

impl SurroundingMap {
    fn texel_at(&self, d: Vec3) -> Vec2 {
        let [width, height] = self.pyramid.size();
        let theta = angle((d.x * d.x + d.z * d.z).sqrt(), d.y);
        let phi = angle(d.x, -d.z) + self.rotation;
        Vec2::new((phi / TAU + 0.5) * width as f32, theta / PI * height as f32)
    }

    fn covariance(&self, d: Vec3, turns: [Vec3; 2]) -> [f32; 3] {
        let [width, height] = self.pyramid.size().map(|side| side as f32);
        let sin = (d.x * d.x + d.z * d.z).sqrt().max(0.05);
        // Along growing azimuth and growing polar angle.
        let across = Vec3::new(-d.z, 0.0, d.x) / sin;
        let down = Vec3::new(d.x * d.y / sin, -sin, d.z * d.y / sin);
        let scale = Vec2::new(width / (TAU * sin), height / PI);
        covariance(turns.map(|turn| scale * Vec2::new(turn.dot(across), turn.dot(down))))
    }
}

/// The angle of the vector (x, y) from the x axis, to 1e-5 rad: a polynomial of the smaller ratio, which takes a third of the
/// time of `atan2`.
fn angle(y: f32, x: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let ratio = a.min(b) / a.max(b).max(f32::MIN_POSITIVE);
    let s = ratio * ratio;
    let c = [0.999_977_26, -0.332_623_47, 0.193_543_46, -0.116_432_87, 0.052_653_32, -0.011_721_2];
    let mut angle = ratio * c.iter().rev().fold(0.0, |sum: f32, c| sum * s + c);
    if b > a {
        angle = 0.5 * PI - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    angle.copysign(y)
}

fn covariance<const N: usize>(deviations: [Vec2; N]) -> [f32; 3] {
    deviations.iter().fold([0.0; 3], |[xx, xy, yy], d| [xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y])
}

impl Plane {
    fn texel_at(&self, position: Vec3, d: Vec3) -> Vec2 {
        let hit = position + d * ((self.z - position.z) / d.z);
        Vec2::new(hit.x, -hit.y) * self.scale + self.origin
    }

    fn covariance(&self, position: Vec3, d: Vec3, footprint: &BackdropFootprint) -> [f32; 3] {
        let d = d.with_z(d.z.min(-LEAST_COSINE));
        let distance = ((self.z - position.z) / d.z).max(0.0);
        let on_plane = |shift: Vec3| {
            let shift = shift - d * (shift.z / d.z);
            Vec2::new(shift.x, -shift.y) * self.scale
        };
        let [a, b] = footprint.position.map(on_plane);
        let [u, v] = footprint.direction.map(|turn| distance * on_plane(turn));
        covariance([a, b, u, v])
    }
}

impl Backdrop {
    /// A backdrop of an environment, which is rotated about the vertical axis by `rotation` [rad] and multiplied by
    /// `intensity`, and of a plane.
    pub fn new(map: &LatLongMap, rotation: f32, intensity: f32, plane: Option<Plane>) -> Self {
        let (size, texels) = if map.texels.is_empty() {
            ([1, 1], vec![Vec3::ZERO])
        } else {
            ([map.width, map.height], map.texels.iter().map(|texel| *texel * intensity).collect())
        };
        let environment = SurroundingMap { pyramid: Pyramid::new(size, texels, false), rotation };
        let even = SurroundingMap { pyramid: Pyramid::new([1, 1], vec![Vec3::ZERO], false), rotation: 0.0 };
        let mut backdrop = Self { plane, environment, even };
        backdrop.even.pyramid = backdrop.even_map();
        backdrop
    }

    /// The plane, and the maps of the environment and of even light with their rotations [rad].
    pub fn maps(&self) -> (Option<&Plane>, [(&Pyramid, f32); 2]) {
        (self.plane.as_ref(), [&self.environment, &self.even].map(|map| (&map.pyramid, map.rotation)))
    }

    /// The map of even light: cosine-weighted means of coarse radiances, in which the plane has its mean radiance.
    fn even_map(&self) -> Pyramid {
        let [width, height] = EVEN_SIZE;
        let grid = LatLongMap { width, height, texels: Vec::new() };
        let turn = (PI / height as f32) / 12f32.sqrt();
        let cells: Vec<(DVec3, f64, Vec3)> = (0..width * height)
            .map(|k| {
                let d = grid.direction((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
                (d, grid.solid_angle(k / width), self.far(d.as_vec3(), turn))
            })
            .collect();
        let mean = |axis: DVec3| {
            let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
            for (d, solid_angle, radiance) in &cells {
                let weight = axis.dot(*d).max(0.0) * solid_angle;
                sum += weight * radiance.as_dvec3();
                weights += weight;
            }
            (sum / weights).as_vec3()
        };
        let texels = cells.iter().map(|(axis, ..)| mean(*axis)).collect();
        Pyramid::new(EVEN_SIZE, texels, false)
    }

    /// The radiance from a direction, averaged over an angle; the plane has its mean radiance.
    fn far(&self, d: Vec3, turn: f32) -> Vec3 {
        match &self.plane {
            Some(plane) if d.z < 0.0 => plane.pyramid.mean(),
            _ => {
                let across = d.any_orthonormal_vector();
                let covariance = self.environment.covariance(d, [turn * across, turn * d.cross(across)]);
                let kernel = self.environment.pyramid.kernel(covariance);
                self.environment.pyramid.read(self.environment.texel_at(d), &kernel)
            }
        }
    }

    /// The mean radiance of the hemisphere around `axis`, weighted by the cosine.
    pub fn even(&self, axis: Vec3) -> Vec3 {
        self.even.pyramid.bilinear(0, self.even.texel_at(axis))
    }

    /// The footprint of rays from about `position` along about `d`.
    pub fn kernel(&self, position: Vec3, d: Vec3, footprint: &BackdropFootprint) -> BackdropKernel {
        let tilt = footprint.tilt();
        let below = if self.plane.is_some() { part_below(d.z, tilt) } else { 0.0 };
        let on_plane = |plane: &Plane| plane.pyramid.kernel(plane.covariance(position, d, footprint));
        let map = &self.environment;
        BackdropKernel {
            plane: self.plane.as_ref().filter(|_| below > 0.0).map(on_plane),
            environment: (below < 1.0).then(|| map.pyramid.kernel(map.covariance(d, footprint.direction))),
            tilt,
        }
    }

    /// The footprint of each of many rays along about `d`: one read per ray, at one resolution.
    pub fn narrow_kernel(&self, position: Vec3, d: Vec3, footprint: &BackdropFootprint) -> BackdropKernel {
        let on_plane = |plane: &Plane| plane.pyramid.narrow_kernel(plane.covariance(position, d, footprint));
        let map = &self.environment;
        BackdropKernel {
            plane: self.plane.as_ref().map(on_plane),
            environment: Some(map.pyramid.narrow_kernel(map.covariance(d, footprint.direction))),
            tilt: 0.0,
        }
    }

    /// The mean radiance that arrives at `position` against the directions around `d`.
    pub fn read(&self, position: Vec3, d: Vec3, kernel: &BackdropKernel) -> Vec3 {
        let to_plane = if self.plane.is_some() { part_below(d.z, kernel.tilt) } else { 0.0 };
        let mut sum = Vec3::ZERO;
        if let (Some(plane), Some(kernel)) = (&self.plane, &kernel.plane)
            && to_plane > 0.0
        {
            let at = plane.texel_at(position, d.with_z(d.z.min(-1e-4)));
            sum += to_plane * plane.pyramid.read(at, kernel);
        }
        let map = &self.environment;
        if let Some(kernel) = kernel.environment.as_ref().filter(|_| to_plane < 1.0) {
            sum += (1.0 - to_plane) * map.pyramid.read(map.texel_at(d), kernel);
        }
        sum
    }
}

/// The part of a bundle whose z is below 0, for the mean `z` and the deviation `tilt`. The distribution is close to normal.
fn part_below(z: f32, tilt: f32) -> f32 {
    if z.abs() >= 2.5 * tilt {
        return if z < 0.0 { 1.0 } else { 0.0 };
    }
    1.0 / (1.0 + (1.702 * z / tilt).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white_below(z: f32) -> Plane {
        Plane { z, scale: 10.0, origin: Vec2::ZERO, pyramid: Pyramid::new([8, 8], vec![Vec3::X; 64], true) }
    }

    #[test]
    fn rays_end_on_the_plane_below_the_horizon_and_on_the_environment_above() {
        let map = LatLongMap::from_fn(64, 32, |d| DVec3::new(0.0, 1.0 + d.y, 0.0));
        let backdrop = Backdrop::new(&map, 0.0, 2.0, Some(white_below(-1.0)));
        let read =
            |d: Vec3| backdrop.read(Vec3::ZERO, d, &backdrop.kernel(Vec3::ZERO, d, &BackdropFootprint::default()));
        assert_eq!(read(Vec3::NEG_Z), Vec3::X);
        assert!((read(Vec3::Y) - Vec3::new(0.0, 4.0, 0.0)).length() < 0.02);
        let d = Vec3::new(0.6, 0.3, 0.5).normalize();
        assert!((read(d).y - 2.0 * (1.0 + d.y)).abs() < 0.02);
        // Half of the hemisphere around +x sees the plane, the other half 2 (1 + y).
        assert!((backdrop.even(Vec3::X) - Vec3::new(0.5, 1.0, 0.0)).length() < 0.1, "{}", backdrop.even(Vec3::X));
    }

    #[test]
    fn the_environment_turns_as_its_lights_do() {
        let towards = DVec3::new(0.0, 0.0, 1.0);
        let map = LatLongMap::from_fn(64, 32, |d| DVec3::splat(d.dot(towards).max(0.0)));
        let rotation = 70f32.to_radians();
        let backdrop = Backdrop::new(&map, rotation, 1.0, None);
        let turned = glam::Quat::from_rotation_y(rotation) * Vec3::Z;
        let value =
            backdrop.read(Vec3::ZERO, turned, &backdrop.kernel(Vec3::ZERO, turned, &BackdropFootprint::default()));
        assert!((value.x - 1.0).abs() < 0.01, "{value}");
    }

    #[test]
    fn the_fast_angle_is_that_of_atan2() {
        for k in 0..1000 {
            let (y, x) = (k as f32 * 0.006_28).sin_cos();
            assert!((angle(y, x) - y.atan2(x)).abs() < 2e-5, "{x} {y}");
        }
        assert_eq!(angle(0.0, 0.0), 0.0);
    }
}
