//! Tapered rods on a floor, which may lean over the tile's edge.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::builder::MeshBuilder;
use crate::geometry::TileMesh;
use crate::scene::Rods;

const RODS: u16 = 0;
const FLOOR: u16 = 1;
/// Maximum number of rods on the tile.
const MAX_RODS: f64 = 4000.0;
/// Maximum angle between a rod and the normal, in degrees.
const MAX_LEAN_DEG: f64 = 85.0;

pub fn build(spec: &Rods, size: Vec2) -> TileMesh {
    let mut builder = MeshBuilder::new(size, &["rods", "floor"]);
    let size = size.as_dvec2();
    let wanted = spec.density.map_or(f64::from(spec.count), |density| (f64::from(density) * size.x * size.y).round());
    let count = wanted.clamp(1.0, MAX_RODS);
    if count != wanted {
        builder.note(format!("{count} rods stand on the tile (asked for: {wanted})"));
    }
    builder.polygon(&[DVec3::ZERO, DVec3::X * size.x, size.extend(0.0), DVec3::Y * size.y], FLOOR);
    let count = count as usize;
    let segments = if count > 500 { 8 } else { 12 };
    let mut random = ChaCha8Rng::seed_from_u64(spec.seed);
    for foot in feet(count, size, f64::from(spec.jitter), &mut random) {
        let axis = random_axis(spec, &mut random);
        let variation = f64::from(spec.length_variation) * (2.0 * random.random::<f64>() - 1.0);
        let length = f64::from(spec.length) * (1.0 + variation).max(0.05);
        add_rod(&mut builder, foot, axis, length, spec, segments);
    }
    builder.finish()
}

/// Feet of the rods, one in each cell of a lattice. Its rows share the rods evenly.
fn feet(count: usize, size: DVec2, jitter: f64, random: &mut ChaCha8Rng) -> Vec<DVec2> {
    let rows = ((count as f64 * size.y / size.x).sqrt().round() as usize).clamp(1, count);
    let mut feet = Vec::with_capacity(count);
    for row in 0..rows {
        let columns = (row + 1) * count / rows - row * count / rows;
        for column in 0..columns {
            let offset = DVec2::new(random.random(), random.random()) - 0.5;
            let cell = DVec2::new(column as f64, row as f64) + 0.5 + jitter * offset;
            feet.push(cell * size / DVec2::new(columns as f64, rows as f64));
        }
    }
    feet
}

/// The common axis, rotated by an angle of up to `spread_deg`, uniformly over the disc of angles.
fn random_axis(spec: &Rods, random: &mut ChaCha8Rng) -> DVec3 {
    let (lean, azimuth) = (f64::from(spec.lean_deg).to_radians(), f64::from(spec.lean_azimuth_deg).to_radians());
    let axis = from_angles(lean, azimuth);
    let (angle, around) =
        (f64::from(spec.spread_deg).to_radians() * random.random::<f64>().sqrt(), TAU * random.random::<f64>());
    let (across, other) = axis.any_orthonormal_pair();
    let moved = axis * angle.cos() + (across * around.cos() + other * around.sin()) * angle.sin();
    let theta = moved.truncate().length().atan2(moved.z);
    if theta > MAX_LEAN_DEG.to_radians() {
        from_angles(MAX_LEAN_DEG.to_radians(), moved.y.atan2(moved.x))
    } else {
        moved
    }
}

fn from_angles(theta: f64, phi: f64) -> DVec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// Adds the side and the tip of one rod. Each line of the side is extended along the axis to z = 0, so that no part of
/// a leaning rod floats above the floor and little is below it.
fn add_rod(builder: &mut MeshBuilder, foot: DVec2, axis: DVec3, length: f64, spec: &Rods, segments: usize) {
    let foot = foot.extend(0.0);
    let (across, other) = axis.any_orthonormal_pair();
    let ring = |radius: f64, along: f64, k: usize| {
        let angle = TAU * k as f64 / segments as f64;
        foot + axis * along + (across * angle.cos() + other * angle.sin()) * radius
    };
    let radius = f64::from(spec.radius);
    let tip_radius = radius * (1.0 - f64::from(spec.taper));
    let base: Vec<DVec3> = (0..segments)
        .map(|k| {
            let corner = ring(radius, 0.0, k);
            corner + axis * (-corner.z / axis.z).min(0.9 * length)
        })
        .collect();
    let tip: Vec<DVec3> = (0..segments).map(|k| ring(tip_radius, length, k)).collect();
    // `any_orthonormal_pair` is right-handed with the axis, so the ring is counter-clockwise seen from the tip.
    let is_pointed = tip_radius < 1e-3 * radius;
    for k in 0..segments {
        let next = (k + 1) % segments;
        if is_pointed {
            builder.polygon(&[base[k], base[next], foot + axis * length], RODS);
        } else {
            builder.polygon(&[base[k], base[next], tip[next], tip[k]], RODS);
        }
    }
    if !is_pointed {
        builder.polygon(&tip, RODS);
    }
}

#[cfg(test)]
#[path = "rods_tests.rs"]
mod tests;
