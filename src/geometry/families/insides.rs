//! Where on their triangles systematic samples lie.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::rounded::rounded;
use crate::geometry::TileMesh;
use crate::geometry::facets::A_THREAD;

/// Points inside triangles: an R2 sequence (Roberts 2018) for each shape of triangle, which its copies share in turn. One
/// sequence through all triangles falls in step with what repeats along a mesh: on rectangular grooves at draft it met every
/// second triangle of the walls at its 51st point, strips along their upper edges had twice their facets or none, and 80°
/// from the normal the projected area was 36 % off.
pub(crate) struct Insides {
    shift: Vec2,
    /// Facets that follow each other on one triangle.
    runs: Vec<Run>,
    run_of_facet: Vec<u32>,
    normals: Vec<Vec3>,
}

struct Run {
    /// The first facet.
    facet: u32,
    /// Points that the shape had before.
    used: u32,
    /// Where the sequence of the shape starts.
    start: Vec2,
}

/// The edges from a triangle's first corner in ten-thousandths of the tile: equal for copies of it.
type TriangleShape = [i32; 6];

impl Insides {
    /// For facets on these triangles, in this order.
    pub fn new(mesh: &TileMesh, triangles: &[u32], shift: Vec2) -> Self {
        let mut firsts: Vec<u32> = Vec::new();
        let mut run_of_facet = Vec::with_capacity(triangles.len());
        for (facet, triangle) in triangles.iter().enumerate() {
            if facet == 0 || triangles[facet - 1] != *triangle {
                firsts.push(facet as u32);
            }
            run_of_facet.push(firsts.len() as u32 - 1);
        }
        let each = || firsts.par_iter().with_min_len(A_THREAD).map(|facet| triangles[*facet as usize]);
        let shapes: Vec<TriangleShape> = each().map(|triangle| shape_of(mesh, triangle)).collect();
        let normals = each().map(|triangle| mesh.geometric_normal(triangle as usize)).collect();
        let mut known = Known::new(&shapes);
        // Points that each shape has had, kept with the first run of it.
        let mut had = vec![0; firsts.len()];
        let ends = firsts.iter().skip(1).copied().chain([triangles.len() as u32]);
        let run = |(run, (facet, end)): (usize, (&u32, u32))| {
            let first = known.first_like(run);
            let used = had[first];
            had[first] += end - facet;
            Run { facet: *facet, used, start: start_of(triangles[firsts[first] as usize]) }
        };
        let runs = firsts.iter().zip(ends).enumerate().map(run).collect();
        Self { shift, runs, run_of_facet, normals }
    }

    /// Where in the unit square a facet lies.
    pub fn point(&self, facet: usize) -> Vec2 {
        let run = &self.runs[self.run_of_facet[facet] as usize];
        r2(run.used as usize + facet - run.facet as usize + 1, self.shift + run.start)
    }

    pub fn geometric_normal(&self, facet: usize) -> Vec3 {
        self.normals[self.run_of_facet[facet] as usize]
    }
}

/// Where the shape of which this triangle is the first begins: of the triangle's number, which stays while a tile is edited.
fn start_of(triangle: u32) -> Vec2 {
    let bits = scrambled(u64::from(triangle));
    let part = |bits: u64| (bits & 0xff_ffff) as f32 / (1 << 24) as f32;
    Vec2::new(part(bits), part(bits >> 24))
}

fn shape_of(mesh: &TileMesh, triangle: u32) -> TriangleShape {
    let [a, b, c] = mesh.corners(triangle as usize);
    let unit = mesh.size.extend(mesh.size.max_element()) * 1e-4;
    let [b, c] = [b - a, c - a].map(|edge| edge / unit);
    [b.x, b.y, b.z, c.x, c.y, c.z].map(rounded)
}

/// Which shapes have been met: a hash table of places in a list, a tenth of the memory of a `HashMap` of shapes; what that
/// costs the first time it is touched is more than all that is looked up in it.
struct Known<'a> {
    shapes: &'a [TriangleShape],
    table: Vec<u32>,
}

impl<'a> Known<'a> {
    const NOTHING: u32 = u32::MAX;

    fn new(shapes: &'a [TriangleShape]) -> Self {
        Self { shapes, table: vec![Self::NOTHING; (2 * shapes.len()).next_power_of_two()] }
    }

    /// The first of the shapes asked for so far that equals this one.
    fn first_like(&mut self, asked: usize) -> usize {
        let shape = &self.shapes[asked];
        let hash = shape.iter().fold(0, |hash: u64, side| {
            (hash.rotate_left(23) ^ u64::from(side.cast_unsigned())).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        let mut at = scrambled(hash) as usize;
        loop {
            at &= self.table.len() - 1;
            match self.table[at] {
                Self::NOTHING => {
                    self.table[at] = asked as u32;
                    return asked;
                }
                other if self.shapes[other as usize] == *shape => return other as usize,
                _ => at += 1,
            }
        }
    }
}

/// A number whose bits have nothing to do with those of `x` (SplitMix64; Steele et al. 2014).
fn scrambled(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Point `index` of the R2 sequence, shifted on the unit torus.
fn r2(index: usize, shift: Vec2) -> Vec2 {
    // 1/g and 1/g² of the plastic number g.
    let at = |step: f64, shift: f32| {
        let along = f64::from(shift) + index as f64 * step;
        // `fract` is a call where the processor's baseline cannot round.
        (along - (along as i64) as f64) as f32
    };
    Vec2::new(at(0.754_877_666_246_692_8, shift.x), at(0.569_840_290_998_053_3, shift.y))
}

#[cfg(test)]
#[path = "insides_tests.rs"]
mod tests;
