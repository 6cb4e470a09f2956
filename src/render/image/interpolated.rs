//! Radiance that is computed at the corners of squares of pixels, and interpolated inside them where that is close enough.
//!
//! What is interpolated is the light of each source without shadows, because it varies slowly. Shadows keep the resolution
//! of the image. A square whose middle differs from the mean of its corners is divided, down to single pixels.

use glam::Vec3;
use rayon::prelude::*;

use super::shading::{Evaluator, Part, Shading};

/// Pixels per side of the block that one task shades.
const BLOCK: usize = 32;
/// A row of a block, and the first pixel of the next block, which is a corner of squares of this one.
const STRIDE: usize = BLOCK + 1;
/// Pixels per side of the largest squares.
const LARGEST: usize = 8;
/// Bounds the angles of normals and tangents to those in the middle of a square: the cosine of 4°. The tables of
/// interreflection have steps of 5.6° and more.
const MIN_COSINE: f32 = 0.997_56;
/// Stands for no point, and for no values.
const NONE: u32 = u32::MAX;

/// The radiance of each point of an image of this size. In the middle of each square, direct light differs by at most
/// `tolerance` times itself. Light that facets send to each other is smooth enough to be interpolated without a check.
pub(super) fn radiance(shading: &Shading, [width, height]: [usize; 2], tolerance: f32) -> Vec<Vec3> {
    let pixels = &shading.points.pixels;
    let rows: Vec<usize> = (0..=height).map(|row| pixels.partition_point(|p| (*p as usize) < row * width)).collect();
    let across = width.div_ceil(BLOCK);
    let of_blocks: Vec<_> = (0..across * height.div_ceil(BLOCK))
        .into_par_iter()
        .map(|k| {
            let mut block = Block::new(shading, width, &rows, [k % across * BLOCK, k / across * BLOCK], tolerance);
            if block.add(Part::Direct) {
                block.add(Part::Bounced);
            }
            block.out
        })
        .collect();
    let mut radiance = vec![Vec3::ZERO; shading.points.len()];
    for (point, value) in of_blocks.into_iter().flatten() {
        radiance[point as usize] += value;
    }
    radiance
}

/// The points of a block of pixels. `points`, `known` and `exact` have one entry per pixel, in rows of [`STRIDE`].
struct Block<'a> {
    shading: &'a Shading<'a>,
    evaluator: Evaluator<'a>,
    tolerance: f32,
    /// The point of each pixel that has only one.
    points: Vec<u32>,
    /// Points of pixels at edges, which have several.
    edges: Vec<u32>,
    /// Where a pixel's part of `values` begins.
    known: Vec<u32>,
    /// Light of each source without shadows. A pixel at which a source without a value counts is not interpolated, because
    /// light can end abruptly at the horizon.
    values: Vec<Option<Vec3>>,
    /// The light of the sources that reach a pixel, if it was computed.
    exact: Vec<Option<Vec3>>,
    is_bounced_missing: bool,
    /// Points and parts of their radiance.
    out: Vec<(u32, Vec3)>,
}

impl<'a> Block<'a> {
    /// `rows` has the first point of each row of pixels, and `corner` the first pixel of the block.
    fn new(shading: &'a Shading<'a>, width: usize, rows: &[usize], corner: [usize; 2], tolerance: f32) -> Self {
        let [x0, y0] = corner;
        let (mut points, mut edges) = (vec![NONE; STRIDE * STRIDE], Vec::new());
        for (y, of_row) in rows[y0..].windows(2).take(STRIDE).enumerate() {
            let pixels = &shading.points.pixels[of_row[0]..of_row[1]];
            let first_pixel = (y0 + y) * width + x0;
            let first = of_row[0] + pixels.partition_point(|pixel| (*pixel as usize) < first_pixel);
            for point in first..of_row[1] {
                let x = shading.points.pixels[point] as usize - first_pixel;
                if x >= STRIDE {
                    break;
                }
                if shading.points.weights[point] == 1.0 {
                    points[y * STRIDE + x] = point as u32;
                } else if x < BLOCK && y < BLOCK {
                    edges.push(point as u32);
                }
            }
        }
        Self {
            shading,
            evaluator: Evaluator::new(shading),
            tolerance,
            points,
            edges,
            known: Vec::new(),
            values: Vec::new(),
            exact: Vec::new(),
            is_bounced_missing: false,
            out: Vec::new(),
        }
    }

    /// Adds a part of the light. Returns true if bounced light is missing in it.
    fn add(&mut self, part: Part) -> bool {
        self.known = vec![NONE; STRIDE * STRIDE];
        self.values.clear();
        self.exact = vec![None; STRIDE * STRIDE];
        self.is_bounced_missing = false;
        for k in 0..self.edges.len() {
            let point = self.edges[k];
            let value = self.lit(part, point);
            self.out.push((point, value));
        }
        for y in (0..BLOCK).step_by(LARGEST) {
            for x in (0..BLOCK).step_by(LARGEST) {
                self.add_square(part, y * STRIDE + x, LARGEST);
            }
        }
        self.is_bounced_missing
    }

    fn add_square(&mut self, part: Part, first: usize, side: usize) {
        if side == 1 {
            let point = self.points[first];
            if point != NONE {
                let value = self.at(part, first);
                self.out.push((point, value));
            }
            return;
        }
        let rows = (first..first + side * STRIDE).step_by(STRIDE);
        if rows.flat_map(|row| &self.points[row..row + side]).all(|point| *point == NONE) {
            return;
        }
        if !self.interpolate(part, first, side) {
            let half = side / 2;
            for quarter in [first, first + half, first + half * STRIDE, first + half * STRIDE + half] {
                self.add_square(part, quarter, half);
            }
        }
    }

    /// Interpolates between the corners of a square. Returns false, and adds nothing, if that is not close enough.
    fn interpolate(&mut self, part: Part, first: usize, side: usize) -> bool {
        if !self.is_smooth(first, side) {
            return false;
        }
        let corners = [first, first + side, first + side * STRIDE, first + side * STRIDE + side];
        let corners = corners.map(|pixel| self.values_of(part, pixel));
        let sums_at = |block: &Self, point: u32| -> Option<[Vec3; 4]> {
            let [a, b, c, d] = corners.map(|values| block.sum(values, point));
            Some([a?, b?, c?, d?])
        };
        let middle = first + side / 2 * STRIDE + side / 2;
        if part == Part::Direct {
            let Some(sums) = sums_at(self, self.points[middle]) else { return false };
            let exact = self.at(part, middle);
            let error = (sums.iter().sum::<Vec3>() * 0.25 - exact).abs().max_element();
            if error > self.tolerance * exact.max_element() {
                return false;
            }
        }
        let begin = self.out.len();
        let mut last: Option<(u32, [Vec3; 4])> = None;
        for y in 0..side {
            for x in 0..side {
                let point = self.points[first + y * STRIDE + x];
                let known = last.filter(|(last, _)| self.shading.visibility.is_same(*last as usize, point as usize));
                let Some(sums) = known.map(|(_, sums)| sums).or_else(|| sums_at(self, point)) else {
                    self.out.truncate(begin);
                    return false;
                };
                last = Some((point, sums));
                let [s, t] = [x, y].map(|step| step as f32 / side as f32);
                self.out.push((point, sums[0].lerp(sums[1], s).lerp(sums[2].lerp(sums[3], s), t)));
            }
        }
        true
    }

    /// Returns true if each pixel of a square and of its far sides has one point, with similar normals and tangents.
    fn is_smooth(&self, first: usize, side: usize) -> bool {
        let (normals, tangents) = (&self.shading.points.normals, &self.shading.points.tangents);
        let middle = self.points[first + side / 2 * STRIDE + side / 2];
        if middle == NONE {
            return false;
        }
        let [normal, tangent] = [normals, tangents].map(|of| of[middle as usize]);
        let rows = (first..=first + side * STRIDE).step_by(STRIDE);
        rows.flat_map(|row| &self.points[row..=row + side]).all(|point| {
            *point != NONE
                && normals[*point as usize].dot(normal) >= MIN_COSINE
                && tangents[*point as usize].dot(tangent) >= MIN_COSINE
        })
    }

    /// Sums the light of the sources that reach a point, from values that begin at `first`. `None` if such a source has none.
    fn sum(&self, first: usize, point: u32) -> Option<Vec3> {
        let values = &self.values[first..first + self.shading.lights.len()];
        let lit = values.iter().enumerate().filter(|(k, _)| self.shading.visibility.is_lit(point as usize, *k));
        lit.map(|(_, value)| *value).sum()
    }

    /// The light of a pixel. Only pixels with even coordinates can be corners, so that only they need all sources.
    fn at(&mut self, part: Part, pixel: usize) -> Vec3 {
        if let Some(known) = self.exact[pixel] {
            return known;
        }
        let (x, y, point) = (pixel % STRIDE, pixel / STRIDE, self.points[pixel]);
        let light = if x % 2 == 0 && y % 2 == 0 {
            let values = self.values_of(part, pixel);
            self.sum(values, point).unwrap_or_default()
        } else {
            self.lit(part, point)
        };
        self.exact[pixel] = Some(light);
        light
    }

    /// The light of the sources that reach a point.
    fn lit(&mut self, part: Part, point: u32) -> Vec3 {
        let (point, visibility) = (point as usize, &self.shading.visibility);
        self.is_bounced_missing |= self.evaluator.eval(part, point, |k| visibility.is_lit(point, k));
        self.evaluator.terms().map(|(_, value)| value).sum()
    }

    /// Returns where the values of a pixel begin.
    fn values_of(&mut self, part: Part, pixel: usize) -> usize {
        if self.known[pixel] == NONE {
            let (point, lights, first) = (self.points[pixel] as usize, self.shading.lights, self.values.len());
            let normal = self.shading.points.normals[point];
            self.is_bounced_missing |= self.evaluator.eval(part, point, |k| lights[k].direction.dot(normal) > 0.0);
            // Light that facets send to each other is faint near the horizon, so that it may be interpolated towards none.
            let below_horizon = (part == Part::Bounced).then_some(Vec3::ZERO);
            self.values.resize(first + lights.len(), below_horizon);
            for (k, value) in self.evaluator.terms() {
                self.values[first + k] = Some(value);
            }
            self.known[pixel] = first as u32;
        }
        self.known[pixel] as usize
    }
}
