//! Polar grids with fewer azimuths near the pole. Interpolation is cubic, and crosses the pole.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::fmt;

use glam::Vec3;

use super::{PolarGrid, Tap, from_angles};
use crate::math::simd::{azimuth_and_polar_angle, cubic_weights};

/// Most rings, with the one at the horizon.
const MAX_RINGS: usize = 32;
/// Azimuths per ring of the grid. The steps along both angles are nearly equal near the horizon.
const AZIMUTHS_PER_RING: f32 = 4.8;
/// Fewest azimuths of a ring.
const MIN_AZIMUTHS: usize = 16;

/// A grid with `θ_a = (a+½)(π/2)/(rings)` for all rings but the last, which is at [`PolarGrid::HORIZON_DEG`]. The number
/// of azimuths of a ring grows with `tan θ`, because reflections at grazing angles are narrow in azimuth, and is
/// constant beyond 63°. The ring at the horizon has a quarter of them: its values matter beyond 89° alone.
///
/// Nodes are numbered ring by ring, with `φ_b = 2πb/azimuths` in each.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ReducedGrid {
    /// Number of rings without the one at the horizon.
    pub rings: usize,
    /// The first node of each ring, and the number of all nodes.
    starts: [u16; MAX_RINGS + 1],
}

/// Sixteen taps of a cubic: four consecutive azimuths on each of four rings.
#[derive(Debug, Clone, Copy)]
pub struct CubicTaps {
    pub rings: [RingTaps; 4],
}

/// Four consecutive azimuths of a ring.
#[derive(Debug, Clone, Copy, Default)]
pub struct RingTaps {
    pub ring: usize,
    /// The first azimuth. Azimuths after the last one of the ring continue at 0.
    pub first: usize,
    pub weights: [f32; 4],
}

impl ReducedGrid {
    pub fn new(rings: usize) -> Self {
        let rings = rings.clamp(2, MAX_RINGS - 1);
        let mut grid = Self { rings, starts: [0; MAX_RINGS + 1] };
        for ring in 0..=rings {
            let part = if ring < rings { (0.5 * grid.theta(ring).tan()).min(1.0) } else { 0.25 };
            // A multiple of eight, so that mirror images of nodes are nodes, and kinks of square tiles along their axes and
            // diagonals lie at nodes.
            let azimuths = 8 * (part * AZIMUTHS_PER_RING * rings as f32 / 8.0).ceil() as usize;
            grid.starts[ring + 1] = grid.starts[ring] + azimuths.max(MIN_AZIMUTHS) as u16;
        }
        grid
    }

    /// Rings including the one at the horizon.
    pub fn ring_count(&self) -> usize {
        self.rings + 1
    }

    /// Number of nodes.
    #[expect(clippy::len_without_is_empty, reason = "a grid has at least two rings")]
    pub fn len(&self) -> usize {
        self.first_node(self.ring_count())
    }

    /// The number of the first node of a ring.
    #[inline(always)]
    pub fn first_node(&self, ring: usize) -> usize {
        usize::from(self.starts[ring])
    }

    /// Number of azimuths of a ring.
    #[inline(always)]
    pub fn azimuths_of(&self, ring: usize) -> usize {
        self.first_node(ring + 1) - self.first_node(ring)
    }

    pub fn theta(&self, ring: usize) -> f32 {
        PolarGrid::theta_of(self.rings, ring)
    }

    /// The ring of a node, and its azimuth in this ring.
    pub fn ring_and_azimuth(&self, node: usize) -> (usize, usize) {
        let ring = self.starts[1..=self.rings].partition_point(|start| usize::from(*start) <= node);
        (ring, node - self.first_node(ring))
    }

    pub fn direction(&self, node: usize) -> Vec3 {
        let (ring, azimuth) = self.ring_and_azimuth(node);
        from_angles(self.theta(ring), TAU * azimuth as f32 / self.azimuths_of(ring) as f32)
    }

    pub fn directions(&self) -> Vec<Vec3> {
        (0..self.len()).map(|node| self.direction(node)).collect()
    }

    /// The taps of a cubic (Catmull and Rom 1974) in the elevation and in the azimuth; weights sum to one, and some are
    /// negative.
    pub fn cubic_taps(&self, direction: Vec3) -> CubicTaps {
        self.cubic_taps_at(azimuth_and_polar_angle(direction))
    }

    /// The taps of a direction with this azimuth in turns and polar angle.
    #[inline(always)]
    pub(crate) fn cubic_taps_at(&self, (turns, theta): (f32, f32)) -> CubicTaps {
        let step = FRAC_PI_2 / self.rings as f32;
        let at = (theta / step - 0.5).clamp(-0.5, self.rings as f32);
        let lower = (at.floor() as i32).min(self.rings as i32 - 1);
        let knots = [lower - 1, lower, lower + 1, lower + 2];
        let last = self.rings as i32;
        // All rings but the last have the same distance.
        let weights = if lower + 2 < last {
            cubic_weights(at - lower as f32)
        } else {
            let angle = |ring: i32| if ring < 0 { (ring as f32 + 0.5) * step } else { self.theta(ring as usize) };
            elevation_weights(knots.map(|ring| (ring <= last).then(|| angle(ring))), theta)
        };
        let mut rings = [RingTaps::default(); 4];
        for ((knot, weight), taps) in knots.into_iter().zip(weights).zip(&mut rings) {
            *taps = self.ring_taps(knot.min(last), turns, weight);
        }
        CubicTaps { rings }
    }

    /// The taps of a cubic along a ring at an azimuth in turns, times a weight. Ring -1 is ring 0, rotated by half a turn.
    #[inline(always)]
    pub fn ring_taps(&self, ring: i32, turns: f32, weight: f32) -> RingTaps {
        let (ring, turns) = if ring < 0 { ((-1 - ring) as usize, turns + 0.5) } else { (ring as usize, turns) };
        let count = self.azimuths_of(ring);
        let at = turns * count as f32;
        let second = at as usize;
        let weights = cubic_weights(at - second as f32).map(|of| weight * of);
        // Less than three turns; a division would take longer than the rest.
        let first = second + count - 1;
        let first = if first >= 2 * count { first - 2 * count } else { first };
        RingTaps { ring, first: if first >= count { first - count } else { first }, weights }
    }

    /// Four taps as nodes.
    pub fn nodes_of_ring(&self, taps: &RingTaps) -> [Tap; 4] {
        let count = self.azimuths_of(taps.ring);
        std::array::from_fn(|k| (self.first_node(taps.ring) + (taps.first + k) % count, taps.weights[k]))
    }

    /// Sixteen taps as nodes.
    pub fn nodes(&self, taps: &CubicTaps) -> [Tap; 16] {
        let of_rings = taps.rings.each_ref().map(|taps| self.nodes_of_ring(taps));
        std::array::from_fn(|k| of_rings[k / 4][k % 4])
    }
}

impl fmt::Debug for ReducedGrid {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("ReducedGrid").field("rings", &self.rings).finish_non_exhaustive()
    }
}

/// Weights of the values at four elevations for a cubic between the second and the third. Its slopes there are those of
/// parabolas through three values. Without a fourth elevation, the slope at the third is that of the line.
fn elevation_weights([a, b, c, d]: [Option<f32>; 4], theta: f32) -> [f32; 4] {
    let [Some(a), Some(b), Some(c)] = [a, b, c] else { return [0.0, 1.0, 0.0, 0.0] };
    let (before, width) = (b - a, c - b);
    let t = ((theta - b) / width).clamp(0.0, 1.0);
    let (t2, t3) = (t * t, t * t * t);
    // Hermite's cubic: the values at both ends, and the slopes times the width.
    let (at_c, slope_b, slope_c) = (3.0 * t2 - 2.0 * t3, t3 - 2.0 * t2 + t, t3 - t2);
    let mut weights = [0.0, 1.0 - at_c, at_c, 0.0];
    let mut add = |slope: f32, [left, right]: [f32; 2], first: usize| {
        // The slope times `width` of the parabola through three values, `left` and `right` apart, at the middle one.
        let scale = slope * width / (left + right);
        weights[first] -= scale * right / left;
        weights[first + 1] += scale * (right / left - left / right);
        weights[first + 2] += scale * left / right;
    };
    add(slope_b, [before, width], 0);
    match d {
        Some(d) => add(slope_c, [width, d - c], 1),
        None => {
            weights[1] -= slope_c;
            weights[2] += slope_c;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_near_the_pole_have_fewer_azimuths_and_mirror_images_of_nodes_are_nodes() {
        let grid = ReducedGrid::new(10);
        let counts: Vec<usize> = (0..grid.ring_count()).map(|ring| grid.azimuths_of(ring)).collect();
        assert_eq!(counts, [16, 16, 16, 16, 24, 32, 40, 48, 48, 48, 16]);
        assert_eq!(grid.len(), counts.iter().sum::<usize>());
        let directions = grid.directions();
        let is_node = |d: Vec3| directions.iter().any(|node| (*node - d).length() < 1e-5);
        assert!(directions.iter().all(|d| is_node(Vec3::new(-d.x, d.y, d.z)) && is_node(Vec3::new(d.x, -d.y, d.z))));
    }

    #[test]
    fn cubic_taps_reproduce_a_constant_the_nodes_and_smooth_functions() {
        let grid = ReducedGrid::new(12);
        for node in 0..grid.len() {
            let taps = grid.nodes(&grid.cubic_taps(grid.direction(node)));
            let weight: f32 = taps.iter().filter(|tap| tap.0 == node).map(|tap| tap.1).sum();
            assert!((weight - 1.0).abs() < 2e-3, "node {node}: {taps:?}");
        }
        let smooth = |d: Vec3| d.x + 2.0 * d.y + 0.3 * d.z * d.z + d.x * d.y;
        let values: Vec<f32> = grid.directions().into_iter().map(smooth).collect();
        for k in 0..2000 {
            let d = from_angles(k as f32 / 2000.0 * PolarGrid::HORIZON_DEG.to_radians(), k as f32 * 0.7);
            let taps = grid.nodes(&grid.cubic_taps(d));
            assert!((taps.iter().map(|tap| tap.1).sum::<f32>() - 1.0).abs() < 1e-5);
            let value: f32 = taps.iter().map(|tap| tap.1 * values[tap.0]).sum();
            // The ring at the horizon has steps of 22°.
            assert!((value - smooth(d)).abs() < 6e-3, "{d}: {value} instead of {}", smooth(d));
        }
    }
}
