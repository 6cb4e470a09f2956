//! Paths from a viewer above the slab. They are those of [`ChannelSlab`](crate::slab::ChannelSlab) in single precision, with slopes
//! drawn in advance.

use glam::{Vec2, Vec3};

use super::face_samples::{FaceSamples, SLOPES};
use super::{ChannelGroup, Faces};
use crate::effective::{PathEnd, PathKind, Viewer};
use crate::math::simd::{LANES, RayLane, enter_lane, facing_sum, leave_lane, mask_lane};
use crate::slab::{Channel, Straight, straight};

/// One path in this many also follows the light that the top reflects. At grazing views each path does, because the
/// reflected part then differs from facet to facet.
const REFLECTED_EVERY: usize = 2;
/// Light that the bottom reflects in steps of this weight is followed: facets that reflect little stand for others.
const BOUNCED_STEP: f32 = 0.25;
/// Cosine of the viewer below which a view is grazing.
const GRAZING: f32 = 0.6;
/// Number of candidate facets, of which light inside meets one, chosen by their areas as the light sees them. The variance of the area of a
/// single facet of GGX is infinite.
const CANDIDATES: usize = 16;
/// Cosine below which light inside is so steep that it meets one of several candidates.
const STEEP: f32 = 0.7;
/// Largest number of reflections inside, and weight below which a path ends.
const MAX_BOUNCES: usize = 64;
const LEAST_WEIGHT: f32 = 5e-3;
/// Part of the light below which nothing but straight light is expected.
const LEAST_REST: f64 = 1e-6;

/// Fresnel reflectance and the cosine behind the facet, for the cosine `c` before it; `eta` is the index behind over that
/// before. The cosine is 0 if all light is reflected.
fn fresnel(c: f32, eta: f32) -> (f32, f32) {
    let square = 1.0 - (1.0 - c * c) / (eta * eta);
    if square <= 0.0 {
        return (1.0, 0.0);
    }
    let behind = square.sqrt();
    let s = (c - eta * behind) / (c + eta * behind);
    let p = (eta * c - behind) / (eta * c + behind);
    (0.5 * (s * s + p * p), behind)
}

/// Light that travels along a direction with a weight.
#[derive(Clone, Copy)]
struct Ray {
    d: Vec3,
    weight: f32,
}

/// A facet that light meets; `None` if it faces away.
struct Met {
    /// Unit normal on the side of the light.
    h: Vec3,
    cosine: f32,
    /// Weight of the light on the facet.
    weight: f32,
    reflectance: f32,
    behind: f32,
    eta: f32,
    is_level: bool,
}

impl Met {
    /// `seen` is [`FaceSamples::facing`] of the direction of the light, `eta` the index behind over that before.
    fn new(ray: Ray, slope: Vec2, seen: f32, eta: f32) -> Option<Self> {
        let side = if ray.d.z < 0.0 { 1.0 } else { -1.0 };
        let up = slope.extend(1.0) * side;
        let facing = -ray.d.dot(up);
        if facing <= 0.0 {
            return None;
        }
        let z = 1.0 / (1.0 + slope.length_squared()).sqrt();
        let cosine = (facing * z).min(1.0);
        let (reflectance, behind) = fresnel(cosine, eta);
        let weight = ray.weight * facing / seen;
        Some(Self { h: up * z, cosine, weight, reflectance, behind, eta, is_level: slope == Vec2::ZERO })
    }

    fn reflected(&self, d: Vec3) -> Ray {
        Ray { d: d + 2.0 * self.cosine * self.h, weight: self.weight * self.reflectance }
    }

    fn refracted(&self, d: Vec3) -> Ray {
        let d = d / self.eta + (self.cosine / self.eta - self.behind) * self.h;
        Ray { d, weight: self.weight * (1.0 - self.reflectance) }
    }
}

/// The light of a ray that its face lets leave to the side `is_down`; the rest is added to `masked`.
fn leave(face: &FaceSamples, ray: Ray, is_down: bool, masked: &mut f32) -> Option<Ray> {
    if (ray.d.z < 0.0) != is_down || ray.d.z == 0.0 {
        *masked += ray.weight;
        return None;
    }
    let seen = face.seen(ray.d);
    *masked += ray.weight * (1.0 - seen);
    Some(Ray { weight: ray.weight * seen, ..ray }).filter(|ray| ray.weight > 0.0)
}

/// A well mixed number of a path and a step.
pub(super) fn mixed(seed: u64, step: u64) -> u64 {
    let mut x = seed ^ step.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The ends of light that entered the slab, or that the top turned back.
#[derive(Default)]
struct Account {
    /// Light that masking takes, less the part that is absorbed.
    masked: f64,
    /// All light, as if nothing were absorbed. It differs from the light that set out by the noise of the facets' areas
    /// and of roulette.
    all: f64,
    /// The part of `all` that met level facets alone; it is not among the ends.
    straight: f64,
    ends: Vec<PathEnd>,
}

impl Account {
    /// Adds masked light, of which a part is not absorbed.
    fn mask(&mut self, weight: f32, part: f32) {
        self.masked += f64::from(weight * part);
        self.all += f64::from(weight);
    }

    /// Adds light that left; `end` is absent if it met level facets alone.
    fn leave(&mut self, weight: f32, end: Option<PathEnd>) {
        self.all += f64::from(weight);
        match end {
            Some(end) => self.ends.push(end),
            None => self.straight += f64::from(weight),
        }
    }

    /// The factor for which all light adds up to what set out. The bias of such a ratio falls with the number of paths.
    fn scale(&self, set_out: f64) -> f64 {
        if self.all > 0.0 { set_out / self.all } else { 1.0 }
    }

    /// Reports the ends with their weights times a factor; returns the masked part.
    fn report(self, scale: f64, end: &mut impl FnMut(PathEnd)) -> f32 {
        self.ends.into_iter().for_each(|found| end(PathEnd { weight: scale as f32 * found.weight, ..found }));
        (scale * self.masked) as f32
    }
}

impl Faces {
    /// Reports the ends of all paths of a viewer, with weights for which all light adds up to what reaches the top;
    /// returns the parts of the even light below and above.
    pub fn follow(&self, viewer: &Viewer, mut end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        let mut masked = Vec3::ZERO;
        let scale = (Vec3::ONE - self.diffuse) / viewer.paths.max(1) as f32;
        if let Some(start) = Some(viewer).filter(|viewer| viewer.o.z > 0.0).and_then(|viewer| Start::new(viewer, self))
        {
            let mut scaled = |found: PathEnd| end(PathEnd { weight: scale * found.weight, ..found });
            for group in &self.groups {
                let (inside, entered) = self.inside(group, &start);
                let above = self.above(group, &start);
                let paths = viewer.paths as f64;
                let scales = [inside.scale(entered), above.scale((paths - entered).max(0.0))];
                // Straight light has a closed form, from which the paths differ by the number of level facets.
                let rest = paths - scales[0] * inside.straight - scales[1] * above.straight;
                let exact = paths * (1.0 - self.straight(group, viewer.o));
                let of_rest = if rest > LEAST_REST * paths { exact / rest } else { 1.0 };
                let [inside_scale, above_scale] = scales.map(|scale| scale * of_rest);
                let lost = inside.report(inside_scale, &mut scaled) + above.report(above_scale, &mut scaled);
                masked += group.mask * lost;
            }
        }
        let half = if self.bounces { 0.5 * masked * scale } else { Vec3::ZERO };
        [half + self.diffuse, half]
    }

    /// Follows the light that enters the slab, and returns how much enters.
    fn inside(&self, group: &ChannelGroup, start: &Start) -> (Account, f64) {
        let (mut account, mut entered) = (Account::default(), 0.0);
        // The sum of all weights decides, so that their total is kept but for one step.
        let mut bounced = (start.seed >> 40) as f32 / (1 << 24) as f32 * BOUNCED_STEP;
        for first in (0..start.paths).step_by(LANES) {
            let crossing = self.through_both(group, start, first, &mut account);
            entered += f64::from(crossing.entered);
            if self.bounces {
                self.bounced(group, start, &crossing, &mut bounced, &mut account);
            } else {
                account.mask(crossing.reflected.iter().sum(), 0.0);
            }
        }
        (account, entered)
    }

    /// Follows the light that the top turns back, of some of the paths.
    fn above(&self, group: &ChannelGroup, start: &Start) -> Account {
        let mut account = Account::default();
        for path in (0..start.paths).step_by(start.every) {
            self.reflected(group, start, path, &mut account);
        }
        account
    }

    /// The part of light that meets level facets alone, as if nothing were absorbed.
    fn straight(&self, group: &ChannelGroup, o: Vec3) -> f64 {
        let [top, bottom] = &self.normals;
        if top.level() <= 0.0 {
            return 0.0;
        }
        let channel = Channel { eta: group.eta.into(), depth: 0.0 };
        let Straight { transmitted, reflected } = straight(top, bottom, o.as_dvec3(), channel, self.bounces);
        transmitted + reflected
    }

    /// Follows the light of a lane of paths that is refracted at both faces.
    fn through_both(&self, group: &ChannelGroup, start: &Start, first: usize, account: &mut Account) -> Crossing {
        let count = (start.paths - first).min(LANES);
        let (mut inner, mut out, mut areas) = (RayLane::EMPTY, RayLane::EMPTY, [1.0; LANES]);
        let [top_x, top_y] = self.top.lane(start.top + first);
        enter_lane(top_x, top_y, start.ray.d.to_array(), 1.0 / start.facing, group.eta, &mut inner);
        inner.weight[count..].fill(0.0);
        inner.lost[count..].fill(0.0);
        let entered = inner.weight.iter().sum::<f32>() + inner.lost.iter().sum::<f32>();
        self.top.facing_of(&inner, &mut areas);
        mask_lane(&areas, &mut inner);
        account.mask(inner.lost.iter().sum(), 1.0);
        let [mut slope_x, mut slope_y] = self.bottom.lane(start.below(first)).map(|column| *column);
        self.bottom.facing_of(&inner, &mut areas);
        for l in (0..count).filter(|l| inner.z[*l] > -STEEP) {
            let d = Vec3::new(inner.x[l], inner.y[l], inner.z[l]);
            match candidate(&self.bottom, d, start.numbers_below(first + l)) {
                Some((slope, area)) => {
                    (slope_x[l], slope_y[l]) = (slope.x, slope.y);
                    areas[l] *= area;
                }
                None => inner.weight[l] = 0.0,
            }
        }
        let mut reflected = [0.0; LANES];
        leave_lane([&slope_x, &slope_y], &areas, group.eta, &inner, &mut out, &mut reflected);
        self.bottom.facing_of(&out, &mut areas);
        mask_lane(&areas, &mut out);
        for l in 0..count {
            let part = self.arriving(group, inner.z[l]);
            account.mask(out.lost[l], grey(group, part));
            let is_straight = [top_x[l], top_y[l], slope_x[l], slope_y[l]] == [0.0; 4];
            if out.weight[l] > 0.0 {
                let direction = Vec3::new(out.x[l], out.y[l], out.z[l]);
                let end = PathEnd { kind: PathKind::Transmitted, direction, weight: part * out.weight[l] };
                account.leave(out.weight[l], (!is_straight).then_some(end));
            }
        }
        Crossing { first, count, entered, inner, slopes: [slope_x, slope_y], reflected }
    }

    /// Follows some of the light that the bottom reflects when it first arrives, in steps of one weight; `sum` is the light
    /// since the last step.
    fn bounced(&self, group: &ChannelGroup, start: &Start, crossing: &Crossing, sum: &mut f32, account: &mut Account) {
        let Crossing { first, count, inner, slopes: [slope_x, slope_y], reflected, .. } = crossing;
        for l in 0..*count {
            *sum += reflected[l];
            if *sum < BOUNCED_STEP {
                continue;
            }
            let weight = (*sum / BOUNCED_STEP).floor() * BOUNCED_STEP;
            *sum -= weight;
            let path = first + l;
            let d = Vec3::new(inner.x[l], inner.y[l], inner.z[l]);
            let slope = Vec2::new(slope_x[l], slope_y[l]);
            let h = slope.extend(1.0) / (1.0 + slope.length_squared()).sqrt();
            let ray = Ray { d: d - 2.0 * d.dot(h) * h, weight };
            let part = self.arriving(group, d.z);
            let mut lost = 0.0;
            if let Some(ray) = leave(&self.bottom, ray, false, &mut lost) {
                let is_straight = self.top.slope(start.top + path) == Vec2::ZERO && slope == Vec2::ZERO;
                self.follow_up(group, Bounced { ray, part, is_straight, seed: start.numbers(path) }, account);
            }
            account.mask(lost, grey(group, part));
        }
    }

    /// Follows the light of a path that the top reflects.
    fn reflected(&self, group: &ChannelGroup, start: &Start, path: usize, account: &mut Account) {
        let slope = self.top.slope(start.top + path);
        let Some(met) = Met::new(start.ray, slope, start.facing, group.eta) else { return };
        let mut lost = 0.0;
        if let Some(out) = leave(&self.top, met.reflected(start.ray.d), false, &mut lost) {
            let end = PathEnd { kind: PathKind::Reflected, direction: out.d, weight: group.mask * out.weight };
            account.leave(out.weight, (!met.is_level).then_some(end));
        }
        account.mask(lost, 1.0);
    }

    /// The channels of a group, with the part of light along a direction of vertical component `z` that arrives at the other
    /// face.
    fn arriving(&self, group: &ChannelGroup, z: f32) -> Vec3 {
        if self.depth == Vec3::ZERO { group.mask } else { group.mask * (-self.depth / z.abs().max(1e-6)).exp() }
    }

    /// Follows light that the bottom reflected.
    fn follow_up(&self, group: &ChannelGroup, bounced: Bounced, account: &mut Account) {
        let Bounced { mut ray, mut part, mut is_straight, seed } = bounced;
        for step in 0..MAX_BOUNCES {
            part *= self.arriving(group, ray.d.z);
            if ray.weight * grey(group, part) < LEAST_WEIGHT {
                break;
            }
            let is_down = ray.d.z < 0.0;
            let face = if is_down { &self.bottom } else { &self.top };
            let numbers = mixed(seed, step as u64);
            let chosen = if ray.d.z.abs() < STEEP {
                candidate(face, ray.d, numbers)
            } else {
                Some((face.slope(numbers as usize), 1.0))
            };
            let Some((slope, area)) = chosen else { return };
            let Some(met) = Met::new(ray, slope, face.facing(ray.d) * area, 1.0 / group.eta) else { return };
            is_straight &= met.is_level;
            let mut lost = 0.0;
            if met.reflectance < 1.0
                && let Some(out) = leave(face, met.refracted(ray.d), is_down, &mut lost)
            {
                let end = PathEnd { kind: PathKind::Bounced, direction: out.d, weight: part * out.weight };
                account.leave(out.weight, (!is_straight).then_some(end));
            }
            let next = leave(face, met.reflected(ray.d), !is_down, &mut lost);
            account.mask(lost, grey(group, part));
            match next {
                Some(next) => ray = next,
                None => return,
            }
        }
        match is_straight {
            // Light between level facets has a closed form, which leaves nothing.
            true => account.leave(ray.weight, None),
            false => account.mask(ray.weight, grey(group, part)),
        }
    }
}

/// Mean of a group's channels.
fn grey(group: &ChannelGroup, part: Vec3) -> f32 {
    part.dot(group.mask) / group.mask.dot(group.mask)
}

/// One of several facets, chosen by its area as light along `d` sees it, and this area over the mean of all candidates.
fn candidate(face: &FaceSamples, d: Vec3, numbers: u64) -> Option<(Vec2, f32)> {
    let side = if d.z < 0.0 { 1.0 } else { -1.0 };
    let first = numbers as usize % SLOPES;
    let slopes: [Vec2; CANDIDATES] = std::array::from_fn(|k| face.slope(first + k));
    let areas = slopes.map(|slope| (-d.dot(slope.extend(1.0)) * side).max(0.0));
    let sum: f32 = areas.iter().sum();
    let mut left = sum * ((numbers >> 40) as f32 / (1u64 << 24) as f32);
    let chosen = areas.iter().position(|area| {
        left -= area;
        left < 0.0
    })?;
    Some((slopes[chosen], areas[chosen] * CANDIDATES as f32 / sum))
}

/// A lane of paths at the bottom: the rays inside, the slopes that they meet, and the light that these reflect.
struct Crossing {
    first: usize,
    count: usize,
    /// Light that the top lets in.
    entered: f32,
    inner: RayLane,
    slopes: [[f32; LANES]; 2],
    reflected: [f32; LANES],
}

/// Light on its way up inside.
struct Bounced {
    ray: Ray,
    part: Vec3,
    is_straight: bool,
    seed: u64,
}

/// The start of the paths of a viewer.
struct Start {
    ray: Ray,
    paths: usize,
    /// Mean over the paths of the first facets' areas, projected towards the viewer. Weights over this mean add up to 1
    /// exactly, whatever the number of paths.
    facing: f32,
    /// Every so many paths, one follows the light that the top reflects.
    every: usize,
    /// Numbers of the first slopes.
    top: usize,
    bottom: usize,
    seed: u64,
}

impl Start {
    /// `None` if no path meets a facet.
    fn new(viewer: &Viewer, faces: &Faces) -> Option<Self> {
        let numbers = mixed(viewer.seed, 0);
        let (top, bottom) = (numbers as usize % SLOPES, (numbers >> 32) as usize % SLOPES);
        let all: f32 = (0..viewer.paths)
            .step_by(LANES)
            .map(|first| {
                let [x, y] = faces.top.slopes(top + first, (viewer.paths - first).min(LANES));
                facing_sum(x, y, viewer.o.to_array())
            })
            .sum();
        let every = if viewer.o.z < GRAZING { 1 } else { REFLECTED_EVERY };
        let facing = all / viewer.paths as f32;
        (facing > 0.0).then(|| Self {
            ray: Ray { d: -viewer.o, weight: 1.0 },
            paths: viewer.paths,
            facing,
            every,
            top,
            bottom,
            seed: viewer.seed,
        })
    }

    /// Number of the slope of the bottom that a path meets. Paths beyond the number of slopes pair them anew.
    fn below(&self, path: usize) -> usize {
        self.bottom + path + path / SLOPES * 7919
    }

    /// Random numbers for the facet of the bottom that a path meets first.
    fn numbers_below(&self, path: usize) -> u64 {
        mixed(self.seed, !(path as u64))
    }

    /// Random numbers for the further facets of a path.
    fn numbers(&self, path: usize) -> u64 {
        mixed(self.seed, path as u64 + 1)
    }
}

#[cfg(test)]
#[path = "walk_tests.rs"]
mod tests;
