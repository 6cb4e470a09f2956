//! Truth of single pairs of directions: random walks from the light, with the exact lobe towards the viewer at every
//! facet.

use glam::{DVec2, DVec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::base::{Cancel, Result};
use crate::slab::fresnel::{inside, reflectance};
use crate::slab::walk::scatter;
use crate::slab::{Channel, Ndf, Optics, leaving_bottom};

/// Work and accuracy of the truth of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairSettings {
    /// Largest number of walks per pair and channel.
    pub walks: usize,
    /// Standard error over the value at which the walks of a pair end.
    pub target: f64,
    /// Follow light that is reflected inside.
    pub bounces: bool,
    pub seed: u64,
}

/// `f̄` of one pair with its standard error, per channel [1/sr]. Straight light is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PairTruth {
    pub f_bar: DVec3,
    pub standard_error: DVec3,
}

/// Walks between two checks of the error.
const WALKS_PER_PASS: usize = 2048;
/// Weight below which a walk ends.
const LEAST_WEIGHT: f64 = 1e-6;
const MAX_BOUNCES: usize = 256;

impl PairTruth {
    /// The truth of pairs of directions, on the same side or on opposite sides of the slab.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn of_pairs(
        (top, bottom): (&Ndf, &Ndf),
        optics: &Optics,
        pairs: &[(DVec3, DVec3)],
        settings: &PairSettings,
        cancel: &Cancel,
    ) -> Result<Vec<Self>> {
        let turned = (bottom.mirrored(), top.mirrored());
        let estimate = |(at, (i, o)): (usize, &(DVec3, DVec3))| {
            cancel.check()?;
            let over = DVec3::new(1.0, 1.0, -1.0);
            // Transmission is reciprocal, and light from below meets the slab turned over.
            let (faces, i_up, other) = match (i.z > 0.0, o.z > 0.0) {
                (true, _) => ((top, bottom), *i, *o),
                (false, true) => ((top, bottom), *o, *i),
                (false, false) => ((&turned.0, &turned.1), *i * over, *o * over),
            };
            if i_up.z <= 0.0 || other.z == 0.0 {
                return Ok(Self::default());
            }
            let mut errors = [0.0; 3];
            let value = optics.per_channel_indexed(|k, channel| {
                let walks = PairWalk::new(faces, channel, i_up, other, settings.bounces);
                let (value, standard_error) = walks.estimate(settings, (at * 3 + k) as u64);
                errors[k] = standard_error;
                value
            });
            let error = optics.per_channel_indexed(|k, _| errors[k]);
            let diffuse = optics.diffuse;
            let scattered = if other.z < 0.0 { diffuse / std::f64::consts::PI } else { DVec3::ZERO };
            let cosine = i.z.abs();
            Ok(Self {
                f_bar: cosine * ((DVec3::ONE - diffuse) * value + scattered),
                standard_error: cosine * (DVec3::ONE - diffuse) * error,
            })
        };
        pairs.par_iter().enumerate().map(estimate).collect()
    }
}

/// One pair of directions and one channel.
struct PairWalk<'a> {
    top: &'a Ndf,
    bottom: &'a Ndf,
    channel: Channel,
    i: DVec3,
    o: DVec3,
    bounces: bool,
    /// The way to the viewer through level facets only.
    level: LevelWay,
}

/// Light that leaves through a level facet towards the viewer, possibly after reflections by level facets.
struct LevelWay {
    /// Direction of travel inside that arrives at the face of the viewer, and the weight from there per BTDF inside.
    arriving: DVec3,
    weight: f64,
    /// The mirrored direction, which arrives at the other face, and its weight.
    mirrored: DVec3,
    mirrored_weight: f64,
}

impl LevelWay {
    fn new(exit: &Ndf, other: &Ndf, channel: Channel, o: DVec3, bounces: bool) -> Self {
        let eta = channel.eta;
        let arriving = inside(o, eta);
        let mirrored = DVec3::new(arriving.x, arriving.y, -arriving.z);
        let r = reflectance(o.z.abs(), eta);
        let part = channel.transmission(arriving);
        // A solid angle inside is η² times smaller, both projected.
        let leaves = exit.level() * exit.seen(-arriving) * exit.seen(o) * (1.0 - r) / (eta * eta);
        let at_exit = exit.level() * exit.seen(-arriving) * r * exit.seen(mirrored);
        let at_other = other.level() * other.seen(-mirrored) * r * other.seen(arriving);
        let series = if bounces { 1.0 / (1.0 - (at_exit * at_other * part * part).min(1.0 - 1e-12)) } else { 1.0 };
        let weight = part * leaves * series;
        let mirrored_weight = if bounces { part * at_other * weight } else { 0.0 };
        Self { arriving, weight, mirrored, mirrored_weight }
    }

    /// Weight of light inside along the direction of this way that leaves a face downwards or upwards.
    fn along(&self, is_down: bool) -> (DVec3, f64) {
        if (self.arriving.z < 0.0) == is_down {
            (self.arriving, self.weight)
        } else {
            (self.mirrored, self.mirrored_weight)
        }
    }
}

impl<'a> PairWalk<'a> {
    fn new((top, bottom): (&'a Ndf, &'a Ndf), channel: Channel, i: DVec3, o: DVec3, bounces: bool) -> Self {
        let (exit, other) = if o.z < 0.0 { (bottom, top) } else { (top, bottom) };
        Self { top, bottom, channel, i, o, bounces, level: LevelWay::new(exit, other, channel, o, bounces) }
    }

    /// Mean and standard error of the BTDF or BRDF.
    fn estimate(&self, settings: &PairSettings, stream: u64) -> (f64, f64) {
        if self.channel.is_clear() {
            return (0.0, 0.0);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        rng.set_stream(stream);
        let (mut sum, mut square, mut walks) = (0.0, 0.0, 0_usize);
        loop {
            for _ in 0..WALKS_PER_PASS {
                let value = self.walk(&mut rng);
                sum += value;
                square += value * value;
            }
            walks += WALKS_PER_PASS;
            let n = walks as f64;
            let mean = sum / n;
            let error = ((square / n - mean * mean).max(0.0) / n).sqrt();
            if walks >= settings.walks || (walks >= 4 * WALKS_PER_PASS && error <= settings.target * mean) {
                return (mean, error);
            }
        }
    }

    fn walk(&self, rng: &mut ChaCha8Rng) -> f64 {
        let eta = self.channel.eta;
        let mut sum = 0.0;
        if self.o.z > 0.0 {
            sum += reflected(self.top, -self.i, self.o, eta);
        }
        let (towards, weight) = self.level.along(true);
        if weight > 0.0 {
            sum += weight * entering(self.top, self.i, towards, eta);
        }
        let mut light = scatter(self.top, -self.i, 1.0, eta, rng).refracted;
        for bounce in 0..MAX_BOUNCES {
            let Some((d, weight)) = light else { break };
            let weight = weight * self.channel.transmission(d);
            if weight < LEAST_WEIGHT {
                break;
            }
            let is_down = d.z < 0.0;
            let face = if is_down { self.bottom } else { self.top };
            if (self.o.z < 0.0) == is_down {
                sum += weight * leaving(face, d, self.o, eta);
            }
            if !self.bounces && (is_down == (self.o.z < 0.0) || bounce > 0) {
                break;
            }
            let (towards, rest) = self.level.along(!is_down);
            if self.bounces && rest > 0.0 {
                sum += weight * rest * reflected(face, d, towards, 1.0 / eta);
            }
            light = scatter(face, d, weight, 1.0 / eta, rng).reflected;
            if !self.bounces {
                break;
            }
        }
        sum
    }
}

/// Density of the slope of `h` over `(n·h)⁴`, times Smith's masking of both directions.
fn facets(face: &Ndf, h: DVec3, a: DVec3, b: DVec3) -> f64 {
    let slope: DVec2 = h.truncate() / h.z;
    face.density(slope) / h.z.powi(4) * face.seen(a) * face.seen(b)
}

/// Lobe [1/sr] of the rough facets of a face that reflect light along `d` towards `out`, both on one side of the face.
fn reflected(face: &Ndf, d: DVec3, out: DVec3, eta: f64) -> f64 {
    let Some(h) = (out - d).try_normalize() else { return 0.0 };
    let c = -d.dot(h);
    if face.is_smooth() || c <= 0.0 || h.z == 0.0 {
        return 0.0;
    }
    reflectance(c, eta) * facets(face, h, -d, out) / (4.0 * (d.z * out.z).abs())
}

/// Lobe [1/sr inside] of the rough facets of the top that refract light from `i` to travel along `inner`.
fn entering(top: &Ndf, i: DVec3, inner: DVec3, eta: f64) -> f64 {
    let Some(h) = (-(i + eta * inner)).try_normalize() else { return 0.0 };
    let (outer_cosine, inner_cosine) = (i.dot(h), -inner.dot(h));
    if top.is_smooth() || h.z <= 0.0 || outer_cosine <= 0.0 || inner_cosine <= 0.0 {
        return 0.0;
    }
    let jacobian = eta * eta * inner_cosine / (i + eta * inner).length_squared();
    (1.0 - reflectance(outer_cosine, eta)) * jacobian * outer_cosine * facets(top, h, i, inner) / (i.z * inner.z.abs())
}

/// Lobe [1/sr] of the rough facets of a face that refract light along `d` inside towards `o` outside.
fn leaving(face: &Ndf, d: DVec3, o: DVec3, eta: f64) -> f64 {
    if face.is_smooth() {
        return 0.0;
    }
    // The top face seen from inside is a bottom face with all z, and so all slopes, reversed.
    let over = DVec3::new(1.0, 1.0, if o.z < 0.0 { 1.0 } else { -1.0 });
    let lobe = leaving_bottom(d * over, o * over, eta);
    lobe.map_or(0.0, |lobe| lobe.factor * face.density(over.z * lobe.slope) * face.seen(-d) * face.seen(o))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slab::{Profile, rough_top};

    #[test]
    fn the_level_way_through_a_smooth_bottom_is_eq_6() {
        let top = Ndf::analytic(Profile::Beckmann, DVec2::splat(0.3), 0.0);
        let flat = Ndf::smooth();
        let channel = Channel { eta: 1.5, depth: 0.1 };
        let (i, o) = (DVec3::new(0.5, 0.1, 0.7).normalize(), DVec3::new(-0.4, 0.0, -0.8).normalize());
        let walk = PairWalk::new((&top, &flat), channel, i, o, false);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let at = rough_top(i, o, 1.5).unwrap();
        let closed =
            at.factor * top.density(at.slope) * top.seen(i) * top.seen(at.inner) * channel.transmission(at.inner);
        assert!((walk.walk(&mut rng) / closed - 1.0).abs() < 1e-12);
    }
}
