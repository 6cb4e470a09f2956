//! Paraboloid maps: a hemisphere on a square image whose non-empty pixels are numbered (Brabec et al. 2002; Wu et al.
//! 2011, Sec. 3.7).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::Tap;

/// Marker of a pixel whose centre is outside the unit disc.
const EMPTY: u32 = u32::MAX;

/// The upper hemisphere on a square image: `(x, y) / (1 + z)` fills the unit disc. Pixels whose centres are in the disc
/// are the nodes, numbered row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct ParaboloidMap {
    /// Pixels along a side of the image.
    pub side: usize,
    node_of_pixel: Vec<u32>,
    directions: Vec<Vec3>,
    solid_angles: Vec<f32>,
}

impl ParaboloidMap {
    /// Makes a map with 2 to 256 pixels per side.
    pub fn new(side: usize) -> Self {
        let side = side.clamp(2, 256);
        let mut map =
            Self { side, node_of_pixel: vec![EMPTY; side * side], directions: Vec::new(), solid_angles: Vec::new() };
        for pixel in 0..side * side {
            let centre = map.centre(pixel % side, pixel / side);
            let r2 = centre.length_squared();
            if r2 <= 1.0 {
                map.node_of_pixel[pixel] = map.directions.len() as u32;
                map.directions.push((2.0 * centre).extend(1.0 - r2) / (1.0 + r2));
                map.solid_angles.push(4.0 / (1.0 + r2).powi(2));
            }
        }
        // Pixels at the rim are cut by the disc's edge, so all solid angles are scaled to sum to the hemisphere.
        let total: f32 = map.solid_angles.iter().sum();
        map.solid_angles.iter_mut().for_each(|omega| *omega *= TAU / total);
        map
    }

    /// Makes the map whose number of nodes is nearest to `count`: 137 (13 pixels per side) for the paper's 132
    /// directions.
    pub fn nearest_to(count: usize) -> Self {
        // A map of side n has about n² π/4 nodes.
        let around = (count as f64 * 4.0 / std::f64::consts::PI).sqrt() as usize;
        let nodes = |side: usize| {
            let half = 0.5 * (side as f64 - 1.0);
            let row =
                |y: usize| (0..side).filter(|&x| (x as f64 - half).hypot(y as f64 - half) <= 0.5 * side as f64).count();
            (0..side).map(row).sum::<usize>()
        };
        let candidates = around.min(256).saturating_sub(2).max(2)..=around.min(254) + 2;
        Self::new(candidates.min_by_key(|&side| nodes(side).abs_diff(count)).unwrap_or(2))
    }

    /// Number of nodes.
    #[expect(clippy::len_without_is_empty, reason = "a map has at least four nodes")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    pub fn directions(&self) -> &[Vec3] {
        &self.directions
    }

    /// Solid angle [sr] that a node represents, which follows the map's distortion; the sum over all nodes is 2π.
    pub fn solid_angle(&self, node: usize) -> f32 {
        self.solid_angles[node]
    }

    /// Bilinear taps of a direction of the upper hemisphere; weights are in `[0,1]` and sum to one. The weights of
    /// empty pixels at the rim are distributed over the others.
    pub fn taps(&self, direction: Vec3) -> [Tap; 4] {
        let at = self.to_pixels(direction);
        let base = at.floor();
        let f = at - base;
        let last = self.side as i32 - 1;
        let (x, y) = (base.x as i32, base.y as i32);
        let mut taps = [(0, 0.0); 4];
        let mut sum = 0.0;
        let mut innermost = (f32::INFINITY, 0);
        for (k, tap) in taps.iter_mut().enumerate() {
            let (right, down) = (k as i32 & 1, k as i32 >> 1);
            let (column, row) = ((x + right).clamp(0, last) as usize, (y + down).clamp(0, last) as usize);
            let node = self.node_of_pixel[row * self.side + column];
            if node != EMPTY {
                let weight = (if right == 1 { f.x } else { 1.0 - f.x }) * if down == 1 { f.y } else { 1.0 - f.y };
                *tap = (node as usize, weight);
                sum += weight;
                let radius = self.centre(column, row).length_squared();
                if radius < innermost.0 {
                    innermost = (radius, node as usize);
                }
            }
        }
        if sum > 1e-6 {
            taps.iter_mut().for_each(|tap| tap.1 /= sum);
        } else {
            taps = [(innermost.1, 1.0), (innermost.1, 0.0), (innermost.1, 0.0), (innermost.1, 0.0)];
        }
        taps
    }

    /// Centre of a pixel in the plane of the disc.
    fn centre(&self, column: usize, row: usize) -> Vec2 {
        let along = |pixel: usize| (2 * pixel + 1) as f32 / self.side as f32 - 1.0;
        Vec2::new(along(column), along(row))
    }

    /// Position on the image in pixels; pixel centres have integer coordinates.
    fn to_pixels(&self, direction: Vec3) -> Vec2 {
        let disc = direction.truncate() / (1.0 + direction.z.max(0.0));
        (disc.clamp_length_max(1.0) + 1.0) * (0.5 * self.side as f32) - 0.5
    }

    /// The node nearest to a direction among those within two pixels of it, with the cosine between them.
    fn nearest(&self, direction: Vec3) -> (usize, f32) {
        let at = self.to_pixels(direction).round().as_ivec2();
        let last = self.side as i32 - 1;
        let mut best = (0, f32::NEG_INFINITY);
        for row in (at.y - 2).max(0)..=(at.y + 2).min(last) {
            for column in (at.x - 2).max(0)..=(at.x + 2).min(last) {
                let node = self.node_of_pixel[row as usize * self.side + column as usize];
                if node != EMPTY {
                    let cosine = self.directions[node as usize].dot(direction);
                    if cosine > best.1 {
                        best = (node as usize, cosine);
                    }
                }
            }
        }
        best
    }
}

/// The whole sphere, for normals, as two paraboloid maps back to back. Nodes of the lower half follow those of the
/// upper half.
#[derive(Debug, Clone, PartialEq)]
pub struct ParaboloidSphere {
    half: ParaboloidMap,
}

impl ParaboloidSphere {
    /// Makes a sphere from the map of one half.
    pub fn new(half: ParaboloidMap) -> Self {
        Self { half }
    }

    #[expect(clippy::len_without_is_empty, reason = "a map has at least four nodes")]
    pub fn len(&self) -> usize {
        2 * self.half.len()
    }

    pub fn direction(&self, node: usize) -> Vec3 {
        let count = self.half.len();
        if node < count {
            self.half.directions[node]
        } else {
            self.half.directions[node - count] * Vec3::new(1.0, 1.0, -1.0)
        }
    }

    /// Solid angle [sr] of a node; the sum over all nodes is 4π.
    pub fn solid_angle(&self, node: usize) -> f32 {
        self.half.solid_angle(node % self.half.len())
    }

    /// The node nearest to a direction.
    pub fn nearest(&self, direction: Vec3) -> usize {
        let (upper, upper_cosine) = self.half.nearest(direction);
        let (lower, lower_cosine) = self.half.nearest(direction * Vec3::new(1.0, 1.0, -1.0));
        if lower_cosine > upper_cosine { self.half.len() + lower } else { upper }
    }
}

#[cfg(test)]
#[path = "paraboloid_tests.rs"]
mod tests;
