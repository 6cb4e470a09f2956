//! Paths from a viewer above the slab. They are those of [`Walk`](crate::slab::Walk) in single precision, with slopes
//! drawn in advance.

use glam::{Vec2, Vec3};

use super::face_samples::{FaceSamples, SLOPES};
use super::{ChannelGroup, Faces};
use crate::effective::{PathEnd, PathKind, Viewer};

/// Every so many paths, one also follows the reflected light. At grazing views each path does, because the reflected part
/// then differs from facet to facet.
const REFLECTED_EVERY: usize = 2;
/// Cosine of the viewer below which a view is grazing.
const GRAZING: f32 = 0.6;
/// Facets of which light inside meets one, chosen by their areas as the light sees them. The variance of the area of a
/// single facet of GGX is infinite.
const CANDIDATES: usize = 16;
/// Cosine below which light inside is so steep that it meets one of several candidates also at its first arrival.
const STEEP: f32 = 0.7;
/// Largest number of reflections inside, and weight below which a path ends.
const MAX_BOUNCES: usize = 64;
const LEAST_WEIGHT: f32 = 1e-3;

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
fn mixed(seed: u64, step: u64) -> u64 {
    let mut x = seed ^ step.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl Faces {
    /// Reports the ends of all paths of a viewer; returns the parts of the even light below and above.
    pub fn follow(&self, viewer: &Viewer, mut end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        let mut masked = Vec3::ZERO;
        let scale = (Vec3::ONE - self.diffuse) / viewer.paths.max(1) as f32;
        if let Some(start) = Some(viewer).filter(|viewer| viewer.o.z > 0.0).and_then(|viewer| Start::new(viewer, self))
        {
            for group in &self.groups {
                for path in 0..viewer.paths {
                    let lost = self.path(group, &start, path, &mut |mut found: PathEnd| {
                        found.weight *= scale;
                        end(found);
                    });
                    masked += group.mask * lost;
                }
            }
        }
        let half = if self.bounces { 0.5 * masked * scale } else { Vec3::ZERO };
        [half + self.diffuse, half]
    }

    /// Follows one path; returns the masked part.
    fn path(&self, group: &ChannelGroup, start: &Start, path: usize, end: &mut impl FnMut(PathEnd)) -> f32 {
        let mut masked = 0.0;
        // Paths beyond the number of slopes pair them anew.
        let (first, second) = (start.top + path, start.bottom + path + path / SLOPES * 7919);
        let Some(met) = Met::new(start.ray, self.top.slope(first), start.facing, group.eta) else { return 0.0 };
        let follows_reflection = path.is_multiple_of(start.every);
        if follows_reflection {
            let mut lost = 0.0;
            if let Some(out) = leave(&self.top, met.reflected(start.ray.d), false, &mut lost)
                && !met.is_level
            {
                let weight = group.mask * (out.weight * start.share);
                end(PathEnd { kind: PathKind::Reflected, direction: out.d, weight });
            }
            masked += lost * start.share;
        }
        let Some(inner) = leave(&self.top, met.refracted(start.ray.d), true, &mut masked) else { return masked };
        let part = group.mask * self.transmission(inner.d);
        let chosen = if inner.d.z > -STEEP {
            candidate(&self.bottom, inner.d, mixed(start.seed, !(path as u64)))
        } else {
            Some((self.bottom.slope(second), 1.0))
        };
        let Some((slope, area)) = chosen else { return masked };
        let facing = self.bottom.facing(inner.d) * area;
        let Some(below) = Met::new(inner, slope, facing, 1.0 / group.eta) else { return masked };
        let mut lost = 0.0;
        let is_straight = met.is_level && below.is_level;
        if below.reflectance < 1.0
            && let Some(out) = leave(&self.bottom, below.refracted(inner.d), true, &mut lost)
            && !is_straight
        {
            end(PathEnd { kind: PathKind::Transmitted, direction: out.d, weight: part * out.weight });
        }
        let grey = |part: Vec3| part.dot(group.mask) / group.mask.dot(group.mask);
        masked += lost * grey(part);
        if self.bounces && follows_reflection && below.reflectance > 0.0 {
            let share = start.share;
            let mut lost = 0.0;
            if let Some(ray) = leave(&self.bottom, below.reflected(inner.d), false, &mut lost) {
                let seed = mixed(start.seed, path as u64 + 1);
                let bounced = Bounced { ray, part: part * share, is_straight, seed };
                masked += self.bounce(group, bounced, end);
            }
            masked += lost * grey(part) * share;
        }
        masked
    }

    /// Follows light that the bottom reflected; returns the masked part.
    fn bounce(&self, group: &ChannelGroup, bounced: Bounced, end: &mut impl FnMut(PathEnd)) -> f32 {
        let Bounced { mut ray, mut part, mut is_straight, seed } = bounced;
        let grey = |part: Vec3| part.dot(group.mask) / group.mask.dot(group.mask);
        let mut masked = 0.0;
        for step in 0..MAX_BOUNCES {
            part *= self.transmission(ray.d);
            if ray.weight * grey(part) < LEAST_WEIGHT {
                break;
            }
            let is_down = ray.d.z < 0.0;
            let face = if is_down { &self.bottom } else { &self.top };
            let Some((slope, area)) = candidate(face, ray.d, mixed(seed, step as u64)) else { return masked };
            let Some(met) = Met::new(ray, slope, face.facing(ray.d) * area, 1.0 / group.eta) else { return masked };
            is_straight &= met.is_level;
            let mut lost = 0.0;
            if met.reflectance < 1.0
                && let Some(out) = leave(face, met.refracted(ray.d), is_down, &mut lost)
                && !is_straight
            {
                end(PathEnd { kind: PathKind::Bounced, direction: out.d, weight: part * out.weight });
            }
            let next = leave(face, met.reflected(ray.d), !is_down, &mut lost);
            masked += lost * grey(part);
            match next {
                Some(next) => ray = next,
                None => return masked,
            }
        }
        // Light between level facets has a closed form, which leaves nothing.
        if is_straight { masked } else { masked + ray.weight * grey(part) }
    }

    /// The part of the light along a direction inside that arrives at the other face.
    fn transmission(&self, d: Vec3) -> Vec3 {
        if self.depth == Vec3::ZERO { Vec3::ONE } else { (-self.depth / d.z.abs().max(1e-6)).exp() }
    }
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
    /// Mean over the paths of the first facets' areas, projected towards the viewer. Weights over this mean add up to 1
    /// exactly, whatever the number of paths.
    facing: f32,
    /// Factor on the light of a path that stands for those after it, which do not follow reflections.
    share: f32,
    /// Every so many paths, one follows reflected light.
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
        let every = if viewer.o.z < GRAZING { 1 } else { REFLECTED_EVERY };
        let (mut all, mut followed) = (0.0, 0.0);
        for path in 0..viewer.paths {
            let facing = viewer.o.dot(faces.top.slope(top + path).extend(1.0)).max(0.0);
            all += facing;
            followed += if path.is_multiple_of(every) { facing } else { 0.0 };
        }
        let share = if followed > 0.0 { all / followed } else { 0.0 };
        let facing = all / viewer.paths as f32;
        let ray = Ray { d: -viewer.o, weight: 1.0 };
        (facing > 0.0).then_some(Self { ray, facing, share, every, top, bottom, seed: viewer.seed })
    }
}
