//! The low-passed height field of a tile, what its low-pass leaves out, and rays against it.

use std::sync::{Arc, Mutex};

use glam::{DMat2, DVec2, DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::calibration::Calibration;
use crate::color_map::layers::{LayeredMap, Relief};
use crate::color_map::pixel::{PixelColors, PixelMap};
use crate::color_map::slopes::Slopes;
use crate::color_map::statistics::{Footprint, LevelAt, Levels};
use crate::color_map::{Normal, normal};
use crate::geometry::ColorField;
use crate::geometry::relief::slope_of;
use crate::render::tile_view::TileScene;

/// Side of the samples of a tile whose mesh is no grid of heights, and the largest side.
const SAMPLES: u32 = 256;
const MAX_SAMPLES: u32 = 512;
/// Slopes beyond this count as this steep, because walls would hide all other slopes in the moments.
const STEEPEST: f64 = 8.0;
/// Structure below this part of its deviation on the whole tile is invisible: the tile counts as far away.
const INVISIBLE: f64 = 0.02;
/// Largest number of steps of a ray.
const MAX_STEPS: f64 = 400.0;

/// Channels of the relief's levels: moments of heights and slopes. The slopes' means are two channels from [`SLOPE`] on.
const HEIGHT: usize = 0;
const SLOPE: usize = 2;
const CHANNELS: usize = 7;

/// A tile under a colour map, ready for pixels of any width.
#[derive(Debug)]
pub struct FilteredTile {
    size: DVec2,
    /// Height from which the levels count [tile units].
    base: f64,
    relief: Levels<CHANNELS>,
    /// Heights between which each level lies.
    ranges: Vec<(f64, f64)>,
    /// Root mean square change of the slope per length at each level, and the part of the slopes' variance it leaves out.
    bends: Vec<f64>,
    left: Vec<f64>,
    /// Colours below the map times the part of the surface, for each slot in use.
    tints: Vec<(u16, Levels<3>)>,
    map: PixelMap,
    whole: ReliefLeft,
    /// Width of a pixel [tile units] from which the tile is far away.
    far: f64,
    /// True if the relief is that of an analytic surface, of which `f̄` knows nothing.
    pub(super) is_analytic: bool,
    /// Corrections of the widths that were needed so far.
    pub(super) calibration: Mutex<Calibration>,
}

/// Heights and slopes within a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ReliefLeft {
    /// Heights [tile units].
    pub heights: Normal,
    pub slopes: Slopes,
}

/// Everything within a pixel that its colour depends on.
#[derive(Debug)]
pub(super) struct PixelContent<'a> {
    pub relief: ReliefLeft,
    /// Colour of each slot, times its part of the pixel.
    pub tints: Vec<(u16, Vec3)>,
    pub colors: PixelColors<'a>,
}

impl FilteredTile {
    /// `None` if the tile has no colour map. The height field of a tile that overhangs is what is visible from straight
    /// above. An analytic surface lies within every pixel.
    pub fn new(tile: &TileScene) -> Option<Self> {
        let ColorField::Mapped { map, below } = &tile.mesh.color else { return None };
        let grid = tile.mesh.height_grid.as_ref().map_or(UVec2::splat(SAMPLES), |grid| grid.size);
        let mut samples = Samples::new(tile, grid.clamp(UVec2::ONE, UVec2::splat(MAX_SAMPLES)), below);
        if map.is_analytic {
            samples.replace_relief(&map.relief);
        }
        Some(Self::of_samples(map, tile.mesh.size.as_dvec2(), samples))
    }

    fn of_samples(map: &Arc<LayeredMap>, size: DVec2, samples: Samples) -> Self {
        let relief = Levels::new(size, samples.size, samples.relief);
        let tints = samples.tints.into_iter().map(|(slot, tints)| (slot, Levels::new(size, samples.size, tints)));
        let tints: Vec<_> = tints.collect();
        let (is_analytic, map) = (map.is_analytic, PixelMap::new(map));
        let all = |level: usize| LevelAt { finer: level, weight: 0.0 };
        let base = samples.base;
        let whole = ReliefLeft::of(relief.at(DVec2::ZERO, all(relief.count() - 1)), base);
        let mut tile = Self {
            size,
            base,
            relief,
            ranges: vec![],
            bends: vec![],
            left: vec![],
            tints,
            map,
            whole,
            far: 0.0,
            is_analytic,
            calibration: Mutex::default(),
        };
        let total = whole.slopes.covariance[0] + whole.slopes.covariance[2];
        for level in 0..tile.relief.count() {
            let (count, values) = tile.relief.values(level);
            let heights = values.iter().map(|value| f64::from(value[HEIGHT]));
            tile.ranges.push(heights.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h))));
            tile.bends.push(bend(count, values, size));
            let kept = structure(values, SLOPE) + structure(values, SLOPE + 1);
            // A flat tile fades as its longest wave does.
            let flat = || 1.0 - (-0.5 * (std::f64::consts::TAU * 0.3 * tile.relief.width(level)).powi(2)).exp();
            tile.left.push(if total > 0.0 { (1.0 - kept / total).clamp(0.0, 1.0) } else { flat() });
        }
        // No pixel of an analytic surface has `f̄`, which is that of the facets.
        tile.far = if is_analytic { f64::INFINITY } else { tile.far_width(total) };
        tile
    }

    /// The width of the first level without visible structure.
    fn far_width(&self, slopes: f64) -> f64 {
        let is_invisible = |level: usize| {
            let (_, values) = self.relief.values(level);
            let heights = structure(values, HEIGHT).sqrt();
            let kept = structure(values, SLOPE) + structure(values, SLOPE + 1);
            let width = self.relief.width(level);
            heights <= INVISIBLE * self.whole.heights.deviation
                && kept.sqrt() <= INVISIBLE * slopes.sqrt()
                && self.tints.iter().all(|(_, tint)| {
                    let values = tint.values(level.min(tint.count() - 1)).1;
                    (0..3).all(|c| structure(values, c).sqrt() <= INVISIBLE)
                })
                && self.map.place_variation(self.covariance(width)) <= INVISIBLE
        };
        let level = (0..self.relief.count()).find(|level| is_invisible(*level)).unwrap_or(self.relief.count());
        self.relief.width(level)
    }

    /// Width of a pixel [tile units] from which the tile has no visible structure.
    pub fn far(&self) -> f64 {
        self.far
    }

    /// Number of levels, the levels of a pixel of this width, and the width of a level's pixel [tile units].
    pub(super) fn levels(&self) -> usize {
        self.relief.count()
    }

    pub(super) fn level(&self, width: f64) -> LevelAt {
        self.relief.of_width(width)
    }

    pub(super) fn width(&self, level: usize) -> f64 {
        self.relief.width(level)
    }

    pub(super) fn map(&self) -> &PixelMap {
        &self.map
    }

    /// Size of the tile [tile units].
    pub fn size(&self) -> DVec2 {
        self.size
    }

    /// The part of the slopes' variance that pixels of this width filter away.
    pub(super) fn left(&self, width: f64) -> f64 {
        self.between(&self.left, self.relief.of_width(width))
    }

    fn between(&self, values: &[f64], at: LevelAt) -> f64 {
        let (a, b) = (values[at.finer], values[(at.finer + 1).min(values.len() - 1)]);
        a + f64::from(at.weight) * (b - a)
    }

    fn covariance(&self, width: f64) -> DMat2 {
        let side = width / self.size;
        DMat2::from_diagonal(side * side / 12.0)
    }

    /// The content of a pixel of this width at a place of the tile [tile units].
    pub(super) fn content(&self, at: DVec2, width: f64) -> PixelContent<'_> {
        let place = at / self.size;
        let tint = |(slot, tint): &(u16, Levels<3>)| (*slot, Vec3::from(tint.at(place, tint.of_width(width))));
        PixelContent {
            relief: self.relief_left(at, width),
            tints: self.tints.iter().map(tint).filter(|(_, tint)| *tint != Vec3::ZERO).collect(),
            colors: self.map.at(Some(&self.footprint(at, width))),
        }
    }

    /// Heights and slopes within a pixel of this width at a place [tile units].
    pub(super) fn relief_left(&self, at: DVec2, width: f64) -> ReliefLeft {
        ReliefLeft::of(self.relief.at(at / self.size, self.relief.of_width(width)), self.base)
    }

    /// The footprint of a pixel of this width at a place [tile units].
    pub(super) fn footprint(&self, at: DVec2, width: f64) -> Footprint {
        Footprint { centre: at / self.size, covariance: self.covariance(width) }
    }

    /// The content of a pixel far away.
    pub(super) fn whole(&self) -> PixelContent<'_> {
        let last = |tint: &Levels<3>| Vec3::from(tint.values(tint.count() - 1).1[0]);
        PixelContent {
            relief: self.whole,
            tints: self.tints.iter().map(|(slot, tint)| (*slot, last(tint))).collect(),
            colors: self.map.at(None),
        }
    }

    fn height(&self, at: DVec2, level: LevelAt) -> f64 {
        f64::from(self.relief.channel(HEIGHT, at / self.size, level))
    }

    /// Length of a step of rays [tile units].
    fn step(&self, level: LevelAt) -> f64 {
        (self.relief.step(level) * self.size).min_element() * 0.7
    }

    /// The place at which a viewer sees the surface through a point of the plane z = 0 [tile units], low-passed with
    /// pixels of this width.
    pub(super) fn seen_through(&self, point: DVec2, o: DVec3, width: f64) -> DVec2 {
        let level = self.relief.of_width(width);
        let (low, high) = self.range(level);
        let across = o.truncate() / o.z;
        let at = |z: f64| point + across * z;
        let reach = (high - low) * across.length();
        let steps = (reach / self.step(level)).ceil().clamp(1.0, MAX_STEPS);
        // The first crossing from above lies between the last step above the surface and the next.
        let above = |z: f64| z - self.height(at(z), level);
        let (mut outside, mut z_outside) = (above(high), high);
        for k in 1..=steps as usize {
            let z = high + (low - high) * k as f64 / steps;
            let inside = above(z);
            if inside <= 0.0 {
                return at(crossing(&above, (z_outside, outside), (z, inside)));
            }
            (outside, z_outside) = (inside, z);
        }
        at(low)
    }

    fn range(&self, level: LevelAt) -> (f64, f64) {
        let of = |k: usize| self.ranges[k.min(self.ranges.len() - 1)];
        let (a, b, f) = (of(level.finer), of(level.finer + 1), f64::from(level.weight));
        (a.0 + f * (b.0 - a.0), a.1 + f * (b.1 - a.1))
    }

    /// The lit part of a pixel at a place of the low-passed surface: 1 or 0, but for pixels across an edge of a shadow.
    pub(super) fn lit(&self, at: DVec2, i: DVec3, width: f64) -> f64 {
        let level = self.relief.of_width(width);
        let (_, high) = self.range(level);
        let sine = i.truncate().length();
        if i.z <= 0.0 {
            return 0.0;
        }
        let (start, cot) = (self.height(at, level), i.z / sine.max(1e-12));
        let (t, step) = (i.truncate() / sine.max(1e-12), self.step(level));
        let reach = ((high - start) / cot).max(0.0);
        let count = (reach / step).ceil().min(MAX_STEPS) as usize;
        let mut horizon = f64::NEG_INFINITY;
        for k in 1..=count {
            let distance = step * k as f64;
            let rise = self.height(at + t * distance, level) - start;
            horizon = horizon.max(rise / distance);
        }
        // Across a pixel the horizon changes as the slope does; a box has this deviation.
        let change = width / 12.0_f64.sqrt() * self.between(&self.bends, level);
        if cot - horizon >= 3.0 * change || horizon == f64::NEG_INFINITY {
            return 1.0;
        }
        normal::cdf((cot - horizon) / change.max(1e-9)).clamp(0.0, 1.0)
    }
}

/// The zero of a function between two values of different signs.
fn crossing(f: &impl Fn(f64) -> f64, mut outside: (f64, f64), mut inside: (f64, f64)) -> f64 {
    for _ in 0..4 {
        let t = outside.1 / (outside.1 - inside.1).max(1e-300);
        let z = outside.0 + t.clamp(0.05, 0.95) * (inside.0 - outside.0);
        let value = f(z);
        if value > 0.0 { outside = (z, value) } else { inside = (z, value) }
    }
    let t = outside.1 / (outside.1 - inside.1).max(1e-300);
    outside.0 + t.clamp(0.0, 1.0) * (inside.0 - outside.0)
}

/// Variance of a channel over a level.
fn structure<const C: usize>(values: &[[f32; C]], channel: usize) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().map(|value| f64::from(value[channel])).sum::<f64>() / count;
    values.iter().map(|value| (f64::from(value[channel]) - mean).powi(2)).sum::<f64>() / count
}

/// Root mean square change of the slope per length along x and y.
fn bend(count: UVec2, values: &[[f32; CHANNELS]], size: DVec2) -> f64 {
    let [width, height] = count.to_array().map(|count| count as usize);
    let texel = size / count.as_dvec2();
    let change = |a: &[f32; CHANNELS], b: &[f32; CHANNELS], length: f64| {
        (DVec2::new(f64::from(a[SLOPE] - b[SLOPE]), f64::from(a[SLOPE + 1] - b[SLOPE + 1])) / length).length_squared()
    };
    let of = |k: usize| {
        let (x, y) = (k % width, k / width);
        let (right, up) = (y * width + (x + 1) % width, (y + 1) % height * width + x);
        change(&values[right], &values[k], texel.x) + change(&values[up], &values[k], texel.y)
    };
    ((0..values.len()).map(of).sum::<f64>() / (2 * values.len()) as f64).sqrt()
}

/// A point of the surface, seen from above.
struct Sample {
    z: f64,
    slope: DVec2,
    slot: u16,
    color: Vec3,
}

/// Samples of a tile's surface: means over each texel.
struct Samples {
    size: UVec2,
    /// Height from which the samples count [tile units].
    base: f64,
    relief: Vec<[f32; CHANNELS]>,
    tints: Vec<(u16, Vec<[f32; 3]>)>,
}

impl Samples {
    fn new(tile: &TileScene, size: UVec2, below: &ColorField) -> Self {
        let mesh = &tile.mesh;
        let at = |place: Vec2| {
            let point = place / size.as_vec2() * mesh.size;
            let hit = tile.grid.nearest(point.extend(tile.grid.top()), Vec3::NEG_Z, tile.bottom)?;
            let (normal, _) = tile.normals(&hit, Vec3::Z);
            let slope = slope_of(normal).clamp_length_max(STEEPEST);
            let slot = mesh.slot_at(hit.triangle as usize, point);
            Some(Sample { z: f64::from(hit.position.z), slope, slot, color: below.at(hit.position, normal, mesh.size) })
        };
        // Samples lie where rays meet the insides of triangles and not their corners.
        let texel = |k: u32| -> Vec<Sample> {
            let corner = Vec2::new((k % size.x) as f32, (k / size.x) as f32);
            [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]]
                .iter()
                .filter_map(|part| at(corner + Vec2::from(*part)))
                .collect()
        };
        let texels: Vec<Vec<Sample>> = (0..size.x * size.y).into_par_iter().map(texel).collect();
        let found = || texels.iter().flatten();
        let base = found().map(|sample| sample.z).sum::<f64>() / found().count().max(1) as f64;
        let mean = |samples: &[Sample], value: &dyn Fn(&Sample) -> f64| {
            (samples.iter().map(value).sum::<f64>() / samples.len().max(1) as f64) as f32
        };
        let moments = |samples: &Vec<Sample>| {
            let of = |value: &dyn Fn(&Sample) -> f64| mean(samples, value);
            [
                of(&|s| s.z - base),
                of(&|s| (s.z - base).powi(2)),
                of(&|s| s.slope.x),
                of(&|s| s.slope.y),
                of(&|s| s.slope.x * s.slope.x),
                of(&|s| s.slope.x * s.slope.y),
                of(&|s| s.slope.y * s.slope.y),
            ]
        };
        let mut slots: Vec<u16> = found().map(|sample| sample.slot).collect();
        slots.sort_unstable();
        slots.dedup();
        let tint = |slot: u16| {
            let of = |samples: &Vec<Sample>| {
                let own = samples.iter().filter(|sample| sample.slot == slot);
                (own.map(|sample| sample.color).sum::<Vec3>() / samples.len().max(1) as f32).to_array()
            };
            (slot, texels.iter().map(of).collect())
        };
        let relief = texels.iter().map(moments).collect();
        Self { size, base, relief, tints: slots.into_iter().map(tint).collect() }
    }
}

impl Samples {
    /// Heights and slopes of an analytic surface at every place, in place of those of the tile.
    fn replace_relief(&mut self, relief: &Relief) {
        let Relief { height, slopes, .. } = relief;
        let (s, [xx, xy, yy]) = (slopes.mean, slopes.covariance);
        self.base = height.mean;
        let moments = [0.0, height.deviation.powi(2), s.x, s.y, xx + s.x * s.x, xy + s.x * s.y, yy + s.y * s.y];
        self.relief.fill(moments.map(|moment| moment as f32));
    }
}

impl ReliefLeft {
    fn of([h, hh, x, y, xx, xy, yy]: [f32; CHANNELS], base: f64) -> Self {
        let [h, hh, x, y, xx, xy, yy] = [h, hh, x, y, xx, xy, yy].map(f64::from);
        let (xx, yy) = ((xx - x * x).max(0.0), (yy - y * y).max(0.0));
        // Rounding must not make the covariance indefinite.
        let most = (xx * yy).sqrt();
        let covariance = [xx, (xy - x * y).clamp(-most, most), yy];
        Self {
            heights: Normal { mean: base + h, deviation: (hh - h * h).max(0.0).sqrt() },
            slopes: Slopes { mean: DVec2::new(x, y), covariance },
        }
    }
}
