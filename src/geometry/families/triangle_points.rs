//! Positions of systematic samples inside their triangles.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::rounded::rounded;
use crate::geometry::facets::MIN_ITEMS_PER_TASK;
use crate::geometry::tile_mesh::triangle_normal;

/// Points inside triangles, from one R2 sequence (Roberts 2018) per shape of triangle, which all copies of the shape
/// share.
///
/// One sequence through all triangles would correlate with the repetitions of a mesh: on rectangular grooves, strips
/// along the walls' upper edges could get too many facets or none.
pub(crate) struct TrianglePoints {
    shift: Vec2,
    /// Runs of consecutive facets on one triangle.
    runs: Vec<Run>,
    run_of_facet: Vec<u32>,
    normals: Vec<Vec3>,
}

struct Run {
    /// First facet of the run.
    facet: u32,
    /// Number of points of the shape's sequence that earlier runs use.
    used: u32,
    /// Start of the shape's sequence.
    start: Vec2,
}

/// Edges from a triangle's first corner, in ten-thousandths of the tile; equal for copies of a triangle.
type TriangleShape = [i32; 6];

impl TrianglePoints {
    /// Prepares the points of facets on these triangles, in this order. `corners` returns the corners of a triangle. The
    /// triangles may also be parts of the triangles of a mesh.
    pub fn new(size: Vec2, corners: impl Fn(u32) -> [Vec3; 3] + Sync, triangles: &[u32], shift: Vec2) -> Self {
        let mut firsts: Vec<u32> = Vec::new();
        let mut run_of_facet = Vec::with_capacity(triangles.len());
        for (facet, triangle) in triangles.iter().enumerate() {
            if facet == 0 || triangles[facet - 1] != *triangle {
                firsts.push(facet as u32);
            }
            run_of_facet.push(firsts.len() as u32 - 1);
        }
        let each = || firsts.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|facet| triangles[*facet as usize]);
        let shapes: Vec<TriangleShape> = each().map(|triangle| shape_of(size, corners(triangle))).collect();
        let normals = each().map(|triangle| triangle_normal(corners(triangle))).collect();
        let mut table = ShapeTable::new(&shapes);
        // Number of points that each shape has used, stored at the first run of the shape.
        let mut used_points = vec![0; firsts.len()];
        let ends = firsts.iter().skip(1).copied().chain([triangles.len() as u32]);
        let run = |(run, (facet, end)): (usize, (&u32, u32))| {
            let first = table.first_equal(run);
            let used = used_points[first];
            used_points[first] += end - facet;
            Run { facet: *facet, used, start: start_of(triangles[firsts[first] as usize]) }
        };
        let runs = firsts.iter().zip(ends).enumerate().map(run).collect();
        Self { shift, runs, run_of_facet, normals }
    }

    /// The point of a facet in the unit square.
    pub fn point(&self, facet: usize) -> Vec2 {
        let run = &self.runs[self.run_of_facet[facet] as usize];
        r2(run.used as usize + facet - run.facet as usize + 1, self.shift + run.start)
    }

    pub fn geometric_normal(&self, facet: usize) -> Vec3 {
        self.normals[self.run_of_facet[facet] as usize]
    }
}

/// Start of the sequence of a shape, from the index of its first triangle. The index is stable while a tile is edited.
fn start_of(triangle: u32) -> Vec2 {
    let bits = scrambled(u64::from(triangle));
    let part = |bits: u64| (bits & 0xff_ffff) as f32 / (1 << 24) as f32;
    Vec2::new(part(bits), part(bits >> 24))
}

fn shape_of(size: Vec2, [a, b, c]: [Vec3; 3]) -> TriangleShape {
    let unit = size.extend(size.max_element()) * 1e-4;
    let [b, c] = [b - a, c - a].map(|edge| edge / unit);
    [b.x, b.y, b.z, c.x, c.y, c.z].map(rounded)
}

/// A hash table of shapes by index. It uses much less memory than a `HashMap` of shapes, and the first access to memory
/// takes longer than the lookups.
struct ShapeTable<'a> {
    shapes: &'a [TriangleShape],
    table: Vec<u32>,
}

impl<'a> ShapeTable<'a> {
    const EMPTY: u32 = u32::MAX;

    fn new(shapes: &'a [TriangleShape]) -> Self {
        Self { shapes, table: vec![Self::EMPTY; (2 * shapes.len()).next_power_of_two()] }
    }

    /// The first of the shapes looked up so far that equals the shape `index`.
    fn first_equal(&mut self, index: usize) -> usize {
        let shape = &self.shapes[index];
        let hash = shape.iter().fold(0, |hash: u64, side| {
            (hash.rotate_left(23) ^ u64::from(side.cast_unsigned())).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        let mut at = scrambled(hash) as usize;
        loop {
            at &= self.table.len() - 1;
            match self.table[at] {
                Self::EMPTY => {
                    self.table[at] = index as u32;
                    return index;
                }
                other if self.shapes[other as usize] == *shape => return other as usize,
                _ => at += 1,
            }
        }
    }
}

/// Hashes a number (SplitMix64; Steele et al. 2014).
fn scrambled(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Computes point `index` of the R2 sequence, shifted on the unit torus.
fn r2(index: usize, shift: Vec2) -> Vec2 {
    // The steps are 1/g and 1/g² of the plastic number g.
    let at = |step: f64, shift: f32| {
        let along = f64::from(shift) + index as f64 * step;
        // `fract` would be a function call, because the baseline of x86-64 has no rounding instruction.
        (along - (along as i64) as f64) as f32
    };
    Vec2::new(at(0.754_877_666_246_692_8, shift.x), at(0.569_840_290_998_053_3, shift.y))
}

#[cfg(test)]
#[path = "triangle_points_tests.rs"]
mod tests;
