//! Woven threads: endless tubes along x and y that pass over and under each other.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec2};

use super::builder::MeshBuilder;
use crate::geometry::TileMesh;
use crate::scene::{Backing, CrossSection, FloatPattern, Weave, WeavePattern};

const WARP: u16 = 0;
const WEFT: u16 = 1;
const BACKING: u16 = 2;
/// Number of segments of a thread between two crossings.
const STEPS: usize = 8;
/// Number of corners of a thread's cross-section.
const CORNERS: usize = 16;
/// Maximum number of threads in each direction.
const MAX_THREADS: usize = 24;

pub fn build(spec: &Weave, size: Vec2) -> TileMesh {
    let pattern = pattern(&spec.pattern);
    let warps = whole_repeats(spec.warp_count, pattern[0].len());
    let wefts = whole_repeats(spec.weft_count, pattern.len());
    let slots: &[&str] = if spec.backing == Backing::Own { &["warp", "weft", "backing"] } else { &["warp", "weft"] };
    let mut builder = MeshBuilder::new(size, slots);
    if (warps, wefts) != (spec.warp_count as usize, spec.weft_count as usize) {
        builder.note(format!(
            "{warps} warp and {wefts} weft threads make whole repeats of the pattern (asked for: {} and {})",
            spec.warp_count, spec.weft_count
        ));
    }
    let size = size.as_dvec2();
    let pitch = size / DVec2::new(warps as f64, wefts as f64);
    let (warp_height, weft_height) = (f64::from(spec.warp_height), f64::from(spec.weft_height));
    // The distance of the threads' centres at a crossing is half the sum of their heights, so the threads touch.
    let distance = 0.5 * (warp_height + weft_height);
    let (warp_rise, weft_rise) = (distance * f64::from(spec.crimp), distance * (1.0 - f64::from(spec.crimp)));
    let is_warp_on_top = |warp: usize, weft: usize| pattern[weft % pattern.len()][warp % pattern[0].len()];
    let warp_section = section(spec.cross_section, f64::from(spec.warp_width) * pitch.x, warp_height);
    for warp in 0..warps {
        let heights: Vec<f64> =
            (0..wefts).map(|weft| if is_warp_on_top(warp, weft) { warp_rise } else { -warp_rise }).collect();
        let at = |along: f64, z: f64, corner: DVec2| {
            DVec3::new((warp as f64 + 0.5) * pitch.x + corner.x, along * pitch.y, z + corner.y)
        };
        thread(&heights, &warp_section, |a, b, c, d| {
            builder.polygon(&[at(a.0, a.1, a.2), at(b.0, b.1, b.2), at(c.0, c.1, c.2), at(d.0, d.1, d.2)], WARP)
        });
    }
    let weft_section = section(spec.cross_section, f64::from(spec.weft_width) * pitch.y, weft_height);
    for weft in 0..wefts {
        let heights: Vec<f64> =
            (0..warps).map(|warp| if is_warp_on_top(warp, weft) { -weft_rise } else { weft_rise }).collect();
        let at = |along: f64, z: f64, corner: DVec2| {
            DVec3::new(along * pitch.x, (weft as f64 + 0.5) * pitch.y - corner.x, z + corner.y)
        };
        thread(&heights, &weft_section, |a, b, c, d| {
            builder.polygon(&[at(a.0, a.1, a.2), at(b.0, b.1, b.2), at(c.0, c.1, c.2), at(d.0, d.1, d.2)], WEFT)
        });
    }
    let backing_slot = match spec.backing {
        Backing::None => None,
        Backing::Warp => Some(WARP),
        Backing::Weft => Some(WEFT),
        Backing::Own => Some(BACKING),
    };
    match backing_slot {
        Some(slot) => {
            let lowest = -(warp_rise + 0.5 * warp_height).max(weft_rise + 0.5 * weft_height) - 0.02 * distance;
            let corner = |x: f64, y: f64| DVec3::new(x * size.x, y * size.y, lowest);
            builder.polygon(&[corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)], slot);
        }
        None => builder.leave_holes(),
    }
    builder.finish()
}

/// The pattern by `[weft][warp]` thread: true if the warp is on top.
fn pattern(pattern: &WeavePattern) -> Vec<Vec<bool>> {
    let repeat = |period: usize, is_warp_on_top: fn(usize, usize) -> bool| {
        (0..period).map(|weft| (0..period).map(|warp| is_warp_on_top(warp, weft)).collect()).collect()
    };
    match pattern {
        WeavePattern::Named(FloatPattern::Plain) => repeat(2, |warp, weft| (warp + weft) % 2 == 0),
        WeavePattern::Named(FloatPattern::Twill) => repeat(4, |warp, weft| (warp + 4 - weft) % 4 < 2),
        WeavePattern::Named(FloatPattern::Satin) => repeat(5, |warp, weft| (warp + 2 * weft) % 5 != 0),
        WeavePattern::Matrix(rows) if rows.first().is_some_and(|row| !row.is_empty()) => {
            let width = rows.iter().map(Vec::len).min().unwrap_or(1).max(1);
            rows.iter().map(|row| row.iter().take(width).map(|bit| *bit == 1).collect()).collect()
        }
        WeavePattern::Matrix(_) => vec![vec![true]],
    }
}

/// The multiple of `period` nearest to `count` threads, at least one repeat.
fn whole_repeats(count: u32, period: usize) -> usize {
    let repeats = (count as usize + period / 2) / period;
    repeats.clamp(1, (MAX_THREADS / period).max(1)) * period
}

/// Corners of a cross-section, with x to the side and y up, from the right edge over the top.
fn section(shape: CrossSection, width: f64, height: f64) -> Vec<DVec2> {
    let corner = |k: usize| {
        let (sin, cos) = (TAU * k as f64 / CORNERS as f64).sin_cos();
        let unit = match shape {
            CrossSection::Elliptic => DVec2::new(cos, sin),
            // A superellipse of exponent 5.
            CrossSection::Flat => DVec2::new(cos.abs().powf(0.4).copysign(cos), sin.abs().powf(0.4).copysign(sin)),
            CrossSection::Lens => {
                let x = 4.0 * (k as f64 / CORNERS as f64 - 0.5).abs() - 1.0;
                DVec2::new(x, (1.0 - x * x).copysign(sin))
            }
        };
        0.5 * unit * DVec2::new(width, height)
    };
    (0..CORNERS).map(corner).collect()
}

/// A corner of a thread's surface: coordinate along the thread in crossings, height of the centre, corner of the
/// cross-section.
type Corner = (f64, f64, DVec2);

/// Calls `quad` for each quad of one thread's surface. The `heights` are those of the thread's centre at the crossings,
/// in order.
fn thread(heights: &[f64], section: &[DVec2], mut quad: impl FnMut(Corner, Corner, Corner, Corner)) {
    let at = |step: usize| {
        let (crossing, t) = (step / STEPS, (step % STEPS) as f64 / STEPS as f64);
        let (from, to) = (heights[crossing % heights.len()], heights[(crossing + 1) % heights.len()]);
        // A crossing is at the centre of its cell.
        (step as f64 / STEPS as f64 + 0.5, from + (to - from) * 0.5 * (1.0 - (PI * t).cos()))
    };
    for step in 0..heights.len() * STEPS {
        let ((along, z), (next_along, next_z)) = (at(step), at(step + 1));
        for k in 0..section.len() {
            let (corner, next) = (section[k], section[(k + 1) % section.len()]);
            quad((along, z, corner), (next_along, next_z, corner), (next_along, next_z, next), (along, z, next));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closure::{assert_closes_plane, signed_projected_area};

    #[test]
    fn every_pattern_and_cross_section_closes_over_the_tiles_edge() {
        let matrix = WeavePattern::Matrix(vec![vec![1, 0, 0], vec![0, 1, 1]]);
        let named = [FloatPattern::Plain, FloatPattern::Twill, FloatPattern::Satin].map(WeavePattern::Named);
        for pattern in named.into_iter().chain([matrix]) {
            for cross_section in [CrossSection::Elliptic, CrossSection::Flat, CrossSection::Lens] {
                let spec = Weave { pattern: pattern.clone(), cross_section, warp_width: 0.6, ..Weave::default() };
                assert_closes_plane(&build(&spec, Vec2::new(1.0, 0.8)));
            }
        }
    }

    #[test]
    fn without_a_backing_the_holes_are_declared() {
        let mesh = build(&Weave { backing: Backing::None, ..Weave::default() }, Vec2::ONE);
        assert!(!mesh.closes_plane);
        assert!(signed_projected_area(&mesh).abs() < 1e-6);
    }

    #[test]
    fn satin_floats_the_warp_over_four_of_five_and_steps_by_two() {
        let rows = pattern(&WeavePattern::Named(FloatPattern::Satin));
        for row in &rows {
            assert_eq!(row.iter().filter(|on_top| **on_top).count(), 4);
        }
        for warp in 0..5 {
            assert_eq!(rows.iter().filter(|row| row[warp]).count(), 4);
        }
    }

    #[test]
    fn threads_touch_at_crossings() {
        let spec = Weave { warp_height: 0.1, weft_height: 0.06, crimp: 0.3, ..Weave::default() };
        let mesh = build(&spec, Vec2::ONE);
        // Warp 0 passes over weft 0 at (1/8, 1/8).
        let height_at_crossing = |slot: u16, top: bool| {
            let has_slot = |t: &usize| mesh.triangle_slot[*t] == slot;
            let heights = (0..mesh.triangles.len()).filter(has_slot).flat_map(|t| mesh.corners(t));
            let heights = heights.filter(|p| (p.x - 0.125).abs() < 1e-4 && (p.y - 0.125).abs() < 1e-4).map(|p| p.z);
            // The backing may share the weft's slot, but it is far below.
            heights.fold(if top { f32::MIN } else { f32::MAX }, |a, b| if top { a.max(b) } else { a.min(b) })
        };
        assert!(
            (height_at_crossing(WARP, false) - height_at_crossing(WEFT, true)).abs() < 1e-6,
            "{} {}",
            height_at_crossing(WARP, false),
            height_at_crossing(WEFT, true)
        );
    }
}
