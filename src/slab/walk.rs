//! One photon between the faces of a slab, which are so far apart that positions on them know nothing of each other.

use glam::{DVec2, DVec3};
use rand::{Rng, RngExt};

use super::fresnel::{reflectance, refract};
use super::ndf::{Ndf, normal};
use super::optics::Channel;
use super::spread::r2;

/// A slab in one colour channel, through which photons walk: two faces and the material between them.
#[derive(Debug, Clone, Copy)]
pub struct ChannelSlab<'a> {
    pub top: &'a Ndf,
    pub bottom: &'a Ndf,
    pub channel: Channel,
}

/// Light that leaves the slab.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exit {
    /// Unit direction of travel.
    pub direction: DVec3,
    /// Part of the photon.
    pub weight: f64,
    /// Number of reflections inside.
    pub bounces: usize,
    /// True if all facets on the way were level.
    pub is_straight: bool,
}

/// Parts of a photon by what became of them. Light of `first_total_reflection` may leave later.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    pub absorbed: f64,
    /// Light that Smith's masking blocks after a facet, or that a facet sends into the face.
    pub masked: f64,
    /// Light that the bottom face reflects totally when it first arrives.
    pub first_total_reflection: f64,
}

/// A facet that light meets, and what becomes of the light.
pub(crate) struct Scattering {
    /// Direction and weight of the light that stays on the side where it came from.
    pub reflected: Option<(DVec3, f64)>,
    /// Direction and weight of the light that crosses the face.
    pub refracted: Option<(DVec3, f64)>,
    pub masked: f64,
    pub is_level: bool,
    pub is_total: bool,
}

/// Weight below which a photon between level facets ends.
const LEAST_WEIGHT: f64 = 1e-5;
/// Weight below which one of several photons goes on with this weight and stands for the others.
const ROULETTE: f64 = 0.02;
/// Vertical component below which light is steep, and the facets of which steep light meets one.
const STEEP: f64 = 0.7;
const CANDIDATES: usize = 8;
/// Largest number of reflections inside.
const MAX_BOUNCES: usize = 256;

/// Scatters light of weight `weight` that travels along `d` at a random facet. `eta` is the index behind over that before.
///
/// Facets of GGX are drawn by the area that the light sees. Others are drawn by base area and weighted by the area that the
/// light sees over its mean, `(w·h)+ / (h.z w.z (1 + Λ(w)))`. Light that is steep meets one of several such facets, chosen by
/// their areas, because the area of a single one then varies much.
pub(crate) fn scatter(face: &Ndf, d: DVec3, weight: f64, eta: f64, rng: &mut impl Rng) -> Scattering {
    let (u, v) = (rng.random(), rng.random());
    if let Some(slope) = face.visible_slope(-d, u, v) {
        return scatter_at(face, (slope, false), d, weight, eta);
    }
    let k = d.truncate() / d.z.abs().max(1e-12).copysign(d.z);
    let seen = |slope: DVec2| (1.0 + k.dot(slope)).max(0.0);
    let mean = (1.0 + face.signed_lambda(-d)).max(1e-9);
    if d.z.abs() >= STEEP || face.is_smooth() {
        let facet = face.facet(u, v);
        return scatter_at(face, facet, d, weight * seen(facet.0) / mean, eta);
    }
    let candidates: [(DVec2, bool); CANDIDATES] = std::array::from_fn(|j| {
        let [x, y] = r2(j);
        face.facet((u + x).fract(), (v + y).fract())
    });
    let areas = candidates.map(|(slope, _)| seen(slope));
    let sum: f64 = areas.iter().sum();
    let mut left = sum * rng.random::<f64>();
    let chosen = areas.iter().position(|area| {
        left -= area;
        left < 0.0
    });
    let facet = candidates[chosen.unwrap_or(0)];
    scatter_at(face, facet, d, weight * sum / (CANDIDATES as f64 * mean), eta)
}

/// Scatters light at a facet. `weight` is that of the light on the facet.
fn scatter_at(face: &Ndf, (slope, is_level): (DVec2, bool), d: DVec3, weight: f64, eta: f64) -> Scattering {
    let up = normal(slope);
    let h = if d.z < 0.0 { up } else { -up };
    let c = -d.dot(h);
    let mut result = Scattering { reflected: None, refracted: None, masked: 0.0, is_level, is_total: false };
    if c <= 0.0 {
        return result;
    }
    let r = reflectance(c, eta);
    result.is_total = r >= 1.0;
    let mut leave = |direction: Option<DVec3>, part: f64, is_down: bool| {
        let Some(direction) = direction.filter(|out| (out.z < 0.0) == is_down && out.z != 0.0) else {
            result.masked += part;
            return None;
        };
        let seen = face.seen(direction);
        result.masked += part * (1.0 - seen);
        (part * seen > 0.0).then_some((direction, part * seen))
    };
    let was_down = d.z < 0.0;
    let mirrored = (d + 2.0 * c * h).try_normalize();
    result.reflected = if r > 0.0 { leave(mirrored, weight * r, !was_down) } else { None };
    result.refracted = if r < 1.0 { leave(refract(d, h, eta), weight * (1.0 - r), was_down) } else { None };
    result
}

impl ChannelSlab<'_> {
    /// Follows a photon of weight 1 from the direction `i` above. At each facet it splits into the light that leaves, which
    /// is reported to `exit`, and the light that stays inside.
    pub fn run(&self, i: DVec3, rng: &mut impl Rng, mut exit: impl FnMut(Exit)) -> Tally {
        let mut losses = Tally::default();
        let eta = self.channel.eta;
        if self.channel.is_clear() {
            let part = self.channel.transmission(-i);
            exit(Exit { direction: -i, weight: part, bounces: 0, is_straight: true });
            return Tally { absorbed: 1.0 - part, ..losses };
        }
        let entered = scatter(self.top, -i, 1.0, eta, rng);
        let mut is_straight = entered.is_level;
        losses.masked += entered.masked;
        if let Some((direction, weight)) = entered.reflected {
            exit(Exit { direction, weight, bounces: 0, is_straight });
        }
        let mut inside = entered.refracted;
        for bounces in 0..MAX_BOUNCES {
            let Some((d, weight)) = inside else { return losses };
            let part = self.channel.transmission(d);
            losses.absorbed += weight * (1.0 - part);
            let weight = weight * part;
            let weight = if weight >= ROULETTE {
                weight
            } else if is_straight {
                // Light between level facets has a closed form, which leaves nothing.
                if weight < LEAST_WEIGHT {
                    return losses;
                }
                weight
            } else if ROULETTE * rng.random::<f64>() < weight {
                ROULETTE
            } else {
                return losses;
            };
            let face = if d.z < 0.0 { self.bottom } else { self.top };
            let met = scatter(face, d, weight, 1.0 / eta, rng);
            is_straight &= met.is_level;
            losses.masked += met.masked;
            if bounces == 0 && met.is_total {
                losses.first_total_reflection += met.reflected.map_or(0.0, |(_, weight)| weight);
            }
            if let Some((direction, weight)) = met.refracted {
                exit(Exit { direction, weight, bounces, is_straight });
            }
            inside = met.reflected;
        }
        losses.masked += inside.map_or(0.0, |(_, weight)| weight);
        losses
    }
}

#[cfg(test)]
mod tests {
    use super::super::Profile;
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn all_light_is_accounted_for_within_three_standard_errors() {
        let ggx = Ndf::analytic(Profile::Ggx, DVec2::splat(0.3), 0.0);
        let uneven = Ndf::analytic(Profile::Beckmann, DVec2::new(0.5, 0.1), 0.3);
        let points =
            Ndf::of_facets(&[(DVec2::new(0.5, 0.1), 1.0), (DVec2::new(-0.5, -0.1), 1.0), (DVec2::ZERO, 1.0)], 64)
                .unwrap();
        for (top, bottom) in [(&ggx, &uneven), (&points, &ggx), (&uneven, &points)] {
            for degrees in [0.0, 45.0, 75.0, 85.0_f64] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let walk = ChannelSlab { top, bottom, channel: Channel { eta: 1.5, depth: 0.2 } };
                let mut rng = ChaCha8Rng::seed_from_u64(5);
                let count = 20_000;
                let (mut sum, mut square) = (0.0, 0.0);
                for _ in 0..count {
                    let mut all = 0.0;
                    let losses = walk.run(DVec3::new(sin, 0.0, cos), &mut rng, |exit| all += exit.weight);
                    all += losses.absorbed + losses.masked;
                    sum += all;
                    square += all * all;
                }
                let n = f64::from(count);
                let error = ((square / n - (sum / n).powi(2)) / n).sqrt();
                assert!((sum / n - 1.0).abs() < 3.0 * error + 1e-3, "{degrees}: {} ± {error}", sum / n);
            }
        }
    }
}
