//! Radiance that is computed at the corners of squares of pixels, and interpolated inside them where that is close enough.
//!
//! The light of each source is interpolated without shadows, because it varies slowly then. Shadows keep the resolution of
//! the image. Where the light between the corners of a square is off in its middle or in the middle of a side, the square is
//! divided, down to single pixels. Where it is close, these five points are corners of four quarters, which are interpolated.

use glam::Vec3;
use rayon::prelude::*;

use super::shading::{Evaluator, Part, Shading};

/// Pixels per side of the block that one task shades.
const BLOCK: usize = 16;
/// A row of a block, and the first pixel of the next block, which is a corner of squares of this one.
const STRIDE: usize = BLOCK + 1;
/// Pixels per side of the largest squares.
const LARGEST: usize = 8;
/// Those of the smallest ones that are examined. Their quarters are interpolated, and so are smooth squares of half this size
/// for light that facets send to each other.
const SMALLEST: usize = 4;
/// Bounds the angles of normals and tangents to those in the middle of a square: the cosine of 4°.
const MIN_COSINE: f32 = 0.997_56;
/// Bounds the angles between points that share the light that facets send to each other: the cosine of 2°. The tables of this
/// light have steps of 5.6° and more.
const SHARED_COSINE: f32 = 0.999_39;
/// Cosine of the angle between a normal and the lowest source that another pixel of the square may see: 8° below the horizon.
const LOWEST_COSINE: f32 = -0.139_2;
/// The error allowed in a square, as a multiple of the tolerance. Its quarters have smaller errors.
const CHECK_FACTOR: f32 = 2.0;
/// The same of light that facets send to each other, which is a part of all light.
const BOUNCED_FACTOR: f32 = 20.0;
/// Stands for no point, and for no values.
const NONE: u32 = u32::MAX;

/// The radiance of each point of an image of this size. `tolerance` is the relative error that is aimed at.
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

/// A block of pixels, its points and their light. `points` and `known` have one entry per pixel, in rows of [`STRIDE`].
struct Block<'a> {
    shading: &'a Shading<'a>,
    evaluator: Evaluator<'a>,
    tolerance: f32,
    /// The point of each pixel that has only one.
    points: Vec<u32>,
    /// Points of pixels at edges, which have several.
    edges: Vec<u32>,
    /// Points that are not interpolated.
    rest: Vec<u32>,
    /// Where a pixel's part of `values` begins.
    known: Vec<u32>,
    /// Light of each source without shadows, which can end abruptly at the horizon. Sources little below it have the light of the
    /// horizon, so that pixels that see them are interpolated; lower ones have none.
    values: Vec<Option<Vec3>>,
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
            rest: Vec::new(),
            known: Vec::new(),
            values: Vec::new(),
            is_bounced_missing: false,
            out: Vec::new(),
        }
    }

    /// Adds a part of the light. Returns true if bounced light is missing in it.
    fn add(&mut self, part: Part) -> bool {
        self.known = vec![NONE; STRIDE * STRIDE];
        self.values.clear();
        self.is_bounced_missing = false;
        self.rest.clone_from(&self.edges);
        for y in (0..BLOCK).step_by(LARGEST) {
            for x in (0..BLOCK).step_by(LARGEST) {
                self.add_square(part, y * STRIDE + x, LARGEST);
            }
        }
        let all = std::mem::take(&mut self.rest);
        let mut rest = &all[..];
        while let Some((&first, others)) = rest.split_first() {
            let is_shared = |point: &&u32| part == Part::Bounced && self.are_alike(first, **point);
            let (points, remaining) = rest.split_at(1 + others.iter().take_while(is_shared).count());
            self.add_alike(part, points);
            rest = remaining;
        }
        self.rest = all;
        self.is_bounced_missing
    }

    /// Returns true if the light that facets send to each other differs at two points by their shadows alone.
    fn are_alike(&self, a: u32, b: u32) -> bool {
        let (a, b, points) = (a as usize, b as usize, self.shading.points);
        points.normals[a].dot(points.normals[b]) >= SHARED_COSINE
            && points.tangents[a].dot(points.tangents[b]) >= SHARED_COSINE
    }

    /// Adds the light of points that are alike.
    fn add_alike(&mut self, part: Part, points: &[u32]) {
        let Some((&first, others)) = points.split_first() else { return };
        let visibility = &self.shading.visibility;
        if others.iter().all(|point| visibility.is_same(first as usize, *point as usize)) {
            let light = self.lit(part, first);
            return self.out.extend(points.iter().map(|point| (*point, light)));
        }
        let values = self.values_at(part, first);
        for &point in points {
            let light = self.sum(values, point).unwrap_or_else(|| self.lit(part, point));
            self.out.push((point, light));
        }
    }

    /// Adds the light of a square, interpolated if that is close enough, else that of its quarters.
    fn add_square(&mut self, part: Part, first: usize, side: usize) {
        if side == 1 {
            let point = self.points[first];
            if self.known[first] != NONE {
                let light = self.at(part, first);
                self.out.push((point, light));
            } else if point != NONE {
                self.rest.push(point);
            }
            return;
        }
        let rows = (first..first + side * STRIDE).step_by(STRIDE);
        if rows.flat_map(|row| &self.points[row..row + side]).all(|point| *point == NONE) {
            return;
        }
        let begin = self.out.len();
        let is_filled = if side < SMALLEST {
            part == Part::Bounced && self.is_smooth(first, side) && self.fill(part, first, side)
        } else {
            self.is_close(part, first, side)
                && quarters(first, side).iter().all(|quarter| self.fill(part, *quarter, side / 2))
        };
        if !is_filled {
            self.out.truncate(begin);
            quarters(first, side).iter().for_each(|quarter| self.add_square(part, *quarter, side / 2));
        }
    }

    /// Returns true if a square is smooth, and the light between its corners is close to that in its middle and in the middles
    /// of its sides. All of them are then known with all sources, so that its quarters can be interpolated.
    fn is_close(&mut self, part: Part, first: usize, side: usize) -> bool {
        if !self.is_smooth(first, side) {
            return false;
        }
        let (corners, half) = (self.corners(part, first, side), side / 2);
        [[half, half], [half, 0], [0, half], [side, half], [half, side]].into_iter().all(|[x, y]| {
            let pixel = first + y * STRIDE + x;
            self.values_of(part, pixel);
            let Some(sums) = self.sums(corners, self.points[pixel]) else { return false };
            let light = self.at(part, pixel);
            let tolerance = self.tolerance * if part == Part::Bounced { BOUNCED_FACTOR } else { CHECK_FACTOR };
            let allowed = tolerance * light.max_element();
            (between(sums, [x, y], side) - light).abs().cmple(Vec3::splat(allowed)).all()
        })
    }

    /// Interpolates between the corners of a square. Returns false where a source has no light at a corner.
    fn fill(&mut self, part: Part, first: usize, side: usize) -> bool {
        let corners = self.corners(part, first, side);
        let mut last: Option<(u32, [Vec3; 4])> = None;
        for [x, y] in (0..side * side).map(|k| [k % side, k / side]) {
            let point = self.points[first + y * STRIDE + x];
            let known = last.filter(|(last, _)| self.shading.visibility.is_same(*last as usize, point as usize));
            let Some(sums) = known.map(|(_, sums)| sums).or_else(|| self.sums(corners, point)) else { return false };
            last = Some((point, sums));
            self.out.push((point, between(sums, [x, y], side)));
        }
        true
    }

    /// Where the values of the corners of a square begin.
    fn corners(&mut self, part: Part, first: usize, side: usize) -> [usize; 4] {
        let far = first + side * STRIDE;
        [first, first + side, far, far + side].map(|pixel| self.values_of(part, pixel))
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

    /// The same from the values of four corners.
    fn sums(&self, corners: [usize; 4], point: u32) -> Option<[Vec3; 4]> {
        let [a, b, c, d] = corners.map(|values| self.sum(values, point));
        Some([a?, b?, c?, d?])
    }

    /// The light of a pixel.
    fn at(&mut self, part: Part, pixel: usize) -> Vec3 {
        let (known, point) = (self.known[pixel], self.points[pixel]);
        let sum = if known == NONE { None } else { self.sum(known as usize, point) };
        sum.unwrap_or_else(|| self.lit(part, point))
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
            self.known[pixel] = self.values_at(part, self.points[pixel]) as u32;
        }
        self.known[pixel] as usize
    }

    /// Evaluates the sources near or above the horizon of a point. Returns where their values begin.
    fn values_at(&mut self, part: Part, point: u32) -> usize {
        let (point, lights, first) = (point as usize, self.shading.lights, self.values.len());
        let normal = self.shading.points.normals[point];
        let is_near = |k: usize| lights[k].direction.dot(normal) > LOWEST_COSINE;
        self.is_bounced_missing |= self.evaluator.eval(part, point, is_near);
        self.values.resize(first + lights.len(), None);
        for (k, value) in self.evaluator.terms() {
            self.values[first + k] = Some(value);
        }
        first
    }
}

/// The first pixels of the quarters of a square.
fn quarters(first: usize, side: usize) -> [usize; 4] {
    let half = side / 2;
    [first, first + half, first + half * STRIDE, first + half * STRIDE + half]
}

/// Interpolates linearly between the corners of a square.
fn between([a, b, c, d]: [Vec3; 4], at: [usize; 2], side: usize) -> Vec3 {
    let [s, t] = at.map(|step| step as f32 / side as f32);
    a.lerp(b, s).lerp(c.lerp(d, s), t)
}
