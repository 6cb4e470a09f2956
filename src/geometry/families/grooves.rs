//! Parallel grooves along any direction in which the tile repeats.

use std::f64::consts::PI;

use glam::{DVec2, Vec2};

use super::builder::MeshBuilder;
use crate::geometry::TileMesh;
use crate::scene::{GrooveProfile, Grooves};

const BOTTOM: u16 = 0;
const SIDES: u16 = 1;
/// Number of segments of the half ellipse of a U groove.
const ARC_SEGMENTS: usize = 24;

/// Grooves as a wave: `phase = m x / size.x + n y / size.y`, with one groove per unit of phase. Whole m and n make it
/// periodic.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    m: i64,
    n: i64,
    size: DVec2,
}

/// Maximum number of grooves that cross one side of the tile.
const MAX_WAVES: f64 = 2048.0;

impl Wave {
    /// The periodic wave nearest to `count` grooves across the tile, rotated by `rotation_deg` from the y axis.
    fn snapped(count: u32, rotation_deg: f32, size: Vec2) -> Self {
        let size = size.as_dvec2();
        let (sin, cos) = f64::from(rotation_deg).to_radians().sin_cos();
        let count = f64::from(count);
        // On a tile much longer than wide, the limit reduces the rotation instead of adding very many grooves.
        let limited = |waves: f64| waves.round().clamp(-MAX_WAVES, MAX_WAVES) as i64;
        let (m, n) = (limited(count * cos), limited(count * sin * size.y / size.x));
        Self { m: if (m, n) == (0, 0) { 1 } else { m }, n, size }
    }

    fn gradient(&self) -> DVec2 {
        DVec2::new(self.m as f64, self.n as f64) / self.size
    }

    /// Distance between grooves.
    fn pitch(&self) -> f64 {
        self.gradient().length_recip()
    }

    fn rotation_deg(&self) -> f64 {
        let gradient = self.gradient();
        gradient.y.atan2(gradient.x).to_degrees()
    }
}

/// A corner of the cross-section: phase within one period, height, and slot of the segment that follows.
type ProfilePoint = (f64, f64, u16);

/// The cross-section of grooves, for exports of the tile.
#[derive(Debug, Clone, PartialEq)]
pub struct GrooveCrossSection {
    /// Corners over one period, `(x, z)` in tile units, and the slot (`bottom` or `sides`) of the segment that follows.
    pub points: Vec<(DVec2, u16)>,
    /// Distance between grooves.
    pub pitch: f64,
    /// Number of grooves on the tile.
    pub count: usize,
    /// Length of each groove on the tile.
    pub length: f64,
}

impl GrooveCrossSection {
    /// The cross-section of the grooves as they fit the tile.
    pub fn of(spec: &Grooves, size: Vec2) -> Self {
        let wave = Wave::snapped(spec.count, spec.rotation_deg, size);
        let pitch = wave.pitch();
        let points =
            profile(spec, pitch).into_iter().map(|(phase, z, slot)| (DVec2::new(phase * pitch, z), slot)).collect();
        let count = wave.m.unsigned_abs().max(wave.n.unsigned_abs()).max(1) as usize;
        Self { points, pitch, count, length: wave.size.x * wave.size.y / (count as f64 * pitch) }
    }
}

pub fn build(spec: &Grooves, size: Vec2) -> TileMesh {
    let wave = Wave::snapped(spec.count, spec.rotation_deg, size);
    let mut builder = MeshBuilder::new(size, &["bottom", "sides"]);
    let rotation_error_deg = (wave.rotation_deg() - f64::from(spec.rotation_deg) + 180.0).rem_euclid(360.0) - 180.0;
    let straight_pitch = f64::from(size.x) / f64::from(spec.count);
    if rotation_error_deg.abs() > 0.05 || (wave.pitch() / straight_pitch - 1.0).abs() > 1e-3 {
        builder.note(format!(
            "grooves run at {:.2} degrees, {:.4} apart, so that the tile repeats (asked for: {} degrees)",
            wave.rotation_deg(),
            wave.pitch(),
            spec.rotation_deg
        ));
    }
    if let Some(angle) = steeper_side_deg(spec, wave.pitch()) {
        builder.note(format!(
            "the sides of the grooves stand at {angle:.1} degrees, because wider sides would overlap (asked for: {} degrees)",
            spec.side_angle_deg
        ));
    }
    extrude(&mut builder, &wave, &profile(spec, wave.pitch()));
    builder.finish()
}

/// The horizontal length of a side as its angle asks for, and the largest that fits, as fractions of the pitch; `None` for
/// profiles without such sides.
fn side_run(spec: &Grooves, pitch: f64) -> Option<[f64; 2]> {
    let bottom = match spec.profile {
        GrooveProfile::V => 0.0,
        GrooveProfile::Trapezoid => f64::from(spec.bottom_width),
        GrooveProfile::U | GrooveProfile::Rectangular => return None,
    };
    let angle = f64::from(spec.side_angle_deg);
    let run = if angle > 89.99 { 0.0 } else { f64::from(spec.depth) / angle.to_radians().tan() };
    Some([run / pitch, 0.5 * (1.0 - bottom)])
}

/// The angle of the sides if it exceeds `side_angle_deg` by a tenth of a degree or more.
fn steeper_side_deg(spec: &Grooves, pitch: f64) -> Option<f64> {
    let [asked, largest] = side_run(spec, pitch)?;
    let angle = (f64::from(spec.depth) / (asked.min(largest) * pitch)).atan().to_degrees();
    (asked > largest && angle - f64::from(spec.side_angle_deg) >= 0.1).then_some(angle)
}

/// The cross-section over one period, from phase 0 to phase 1. The groove is in the middle, with land at z = 0 on both
/// sides.
fn profile(spec: &Grooves, pitch: f64) -> Vec<ProfilePoint> {
    let depth = f64::from(spec.depth);
    let bottom = match spec.profile {
        GrooveProfile::V => 0.0,
        _ => f64::from(spec.bottom_width),
    };
    let run = side_run(spec, pitch).map_or(0.0, |[asked, largest]| asked.min(largest));
    let mut points = vec![(0.0, 0.0, SIDES)];
    if spec.profile == GrooveProfile::U {
        points.extend((0..=ARC_SEGMENTS).map(|k| {
            let angle = PI * k as f64 / ARC_SEGMENTS as f64;
            let slot = if (ARC_SEGMENTS / 4..ARC_SEGMENTS * 3 / 4).contains(&k) { BOTTOM } else { SIDES };
            // In floating point, sin π is not 0.
            let z = if k == ARC_SEGMENTS { 0.0 } else { -depth * angle.sin() };
            (0.5 - 0.5 * bottom * angle.cos(), z, slot)
        }));
    } else {
        let (inner, outer) = (0.5 * bottom, 0.5 * bottom + run);
        points.extend([
            (0.5 - outer, 0.0, SIDES),
            (0.5 - inner, -depth, BOTTOM),
            (0.5 + inner, -depth, SIDES),
            (0.5 + outer, 0.0, SIDES),
        ]);
    }
    points.push((1.0, 0.0, SIDES));
    points.dedup_by(|next, previous| {
        (next.0 - previous.0).abs() < 1e-12 && next.1 == previous.1 && {
            previous.2 = next.2;
            true
        }
    });
    points
}

/// Sweeps the cross-section along the grooves over one period of the plane, a parallelogram. The shortest period along
/// the grooves and one across them span it. It is cut into pieces, and their corners coincide with those of their
/// neighbours.
fn extrude(builder: &mut MeshBuilder, wave: &Wave, profile: &[ProfilePoint]) {
    let (grooves, a, b) = bezout(wave.m, wave.n);
    let mut along = DVec2::new((wave.n / grooves) as f64, -(wave.m / grooves) as f64) * wave.size;
    // A lattice vector over `grooves` units of phase. With `along`, it spans the area of one tile.
    let across = DVec2::new(a as f64, b as f64) * wave.size;
    if across.perp_dot(along) < 0.0 {
        along = -along;
    }
    let pieces = (along.length() / (0.25 * wave.size.min_element())).ceil().clamp(1.0, 4096.0);
    // A shear by whole pieces keeps corners on corners and makes the parallelogram nearly a rectangle.
    let skew = (across.dot(along) / along.length_squared() * pieces).round() / pieces;
    let across = (across - skew * along) / grooves as f64;
    for groove in 0..grooves {
        for corners in profile.windows(2) {
            let ((phase, z, slot), (next_phase, next_z, _)) = (corners[0], corners[1]);
            let at =
                |phase: f64, z: f64, piece: f64| ((groove as f64 + phase) * across + piece / pieces * along).extend(z);
            for piece in 0..pieces as usize {
                let (from, to) = (piece as f64, piece as f64 + 1.0);
                builder.polygon(
                    &[at(phase, z, from), at(next_phase, next_z, from), at(next_phase, next_z, to), at(phase, z, to)],
                    slot,
                );
            }
        }
    }
}

/// Returns `(g, a, b)` with `a m + b n = g` and the positive greatest common divisor g.
fn bezout(m: i64, n: i64) -> (i64, i64, i64) {
    let (mut old, mut new) = ((m, 1, 0), (n, 0, 1));
    while new.0 != 0 {
        let quotient = old.0 / new.0;
        (old, new) = (new, (old.0 - quotient * new.0, old.1 - quotient * new.1, old.2 - quotient * new.2));
    }
    if old.0 < 0 { (-old.0, -old.1, -old.2) } else { old }
}

#[cfg(test)]
#[path = "grooves_tests.rs"]
mod tests;
