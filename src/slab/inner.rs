//! Light that is reflected inside the slab before it leaves, and the light that masking removes, as tables.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::even_numbers::EvenNumbers;
use super::fresnel::reflectance;
use super::ndf::Ndf;
use super::optics::{Channel, Optics};
use super::ring_table::{
    RINGS, RingTable, TURNS, edge, projected_solid_angle, ring_of, ring_taps, transposed, turn_of,
};
use super::walk::{ChannelSlab, Exit};
use crate::base::{Cancel, Result};

/// Photons per ring between smooth faces; they spread over the angles of the ring.
const SMOOTH_PHOTONS: usize = 512;

/// Light of one channel that was reflected inside, from above, averaged over the azimuth of the light.
#[derive(Debug, Clone, PartialEq)]
struct ChannelTable {
    /// BTDF and BRDF [1/sr].
    transmitted: RingTable,
    reflected: RingTable,
    /// Parts of the light of each ring, over the azimuth of the light.
    parts: Vec<RingParts>,
    /// Mean of the masked part over all directions of the light, by projected solid angle.
    mean_masked: f64,
    eta: f64,
    /// Whether the top and the bottom are smooth.
    is_smooth: [bool; 2],
    /// Part of the light of each ring that passes a smooth face.
    passing: [f64; RINGS],
}

/// Parts of the incident light that do not pass at once.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Parts {
    pub absorbed: f64,
    /// Light that masking removes; half of it joins each side.
    pub masked: f64,
    pub first_total_reflection: f64,
    /// Light that leaves below after reflections inside.
    pub after_bounces: f64,
}

/// Parts of the light of a ring as functions of its azimuth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct RingParts {
    absorbed: Harmonics,
    masked: Harmonics,
    first_total_reflection: Harmonics,
    after_bounces: Harmonics,
    /// Light in the tables.
    transmitted: Harmonics,
    reflected: Harmonics,
}

impl RingParts {
    fn all_mut(&mut self) -> [&mut Harmonics; 6] {
        let Self { absorbed, masked, first_total_reflection, after_bounces, transmitted, reflected } = self;
        [absorbed, masked, first_total_reflection, after_bounces, transmitted, reflected]
    }
}

/// A function of the azimuth: its mean, and its products with the cosine and the sine of once, twice and four times the
/// azimuth. These hold tilted faces, grooves and square patterns.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Harmonics {
    products: [f64; 7],
    /// Variance of each product; the sum of squares until [`Self::finish`].
    variance: f64,
}

/// Standard deviations of chance that the products of all rings must exceed together to be kept: isotropic faces have none.
const SIGNIFICANT: f64 = 4.0;

impl Harmonics {
    /// The functions at the azimuth of a direction.
    fn basis(i: DVec3) -> [f64; 7] {
        let Some(DVec2 { x, y }) = i.truncate().try_normalize() else { return [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        let (x2, y2) = (x * x - y * y, 2.0 * x * y);
        [1.0, x, y, x2, y2, x2 * x2 - y2 * y2, 2.0 * x2 * y2]
    }

    fn add(&mut self, basis: &[f64; 7], value: f64) {
        self.products.iter_mut().zip(basis).for_each(|(sum, base)| *sum += base * value);
        self.variance += value * value;
    }

    /// Turns sums over `count` photons into means.
    fn finish(&mut self, count: usize) {
        let scale = 1.0 / count.max(1) as f64;
        self.products.iter_mut().for_each(|product| *product *= scale);
        self.variance *= 0.5 * scale * scale;
    }

    fn at(&self, basis: &[f64; 7]) -> f64 {
        let rest: f64 = self.products[1..].iter().zip(&basis[1..]).map(|(a, b)| a * b).sum();
        (self.products[0] + 2.0 * rest).max(0.0)
    }

    fn mean(&self) -> f64 {
        self.products[0]
    }
}

/// Drops products that may be noise. A dependence on the azimuth shows in all rings, so that few photons are enough to see it.
fn drop_noise(rings: &mut [RingParts]) {
    let count = rings.len() as f64;
    for part in 0..rings[0].all_mut().len() {
        for k in 1..7 {
            let square = |ring: &mut RingParts| {
                let Harmonics { products, variance } = &*ring.all_mut()[part];
                if *variance > 0.0 { products[k] * products[k] / variance } else { 0.0 }
            };
            if rings.iter_mut().map(square).sum::<f64>() < count + SIGNIFICANT * (2.0 * count).sqrt() {
                rings.iter_mut().for_each(|ring| ring.all_mut()[part].products[k] = 0.0);
            }
        }
    }
}

/// The tables of all channels. Channels that are alike share one.
#[derive(Debug, Clone, PartialEq)]
pub struct Inner {
    tables: Vec<ChannelTable>,
    of_channel: [usize; 3],
}

impl Inner {
    /// Traces at most `photons` photons per ring and channel, with a fixed seed. Rings near the normal, of which little light is
    /// reflected inside, get fewer.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn new(top: &Ndf, bottom: &Ndf, optics: &Optics, photons: usize, seed: u64, cancel: &Cancel) -> Result<Self> {
        // All photons of a direction are alike without rough facets.
        let photons = if top.is_smooth() && bottom.is_smooth() { photons.min(SMOOTH_PHOTONS) } else { photons };
        let mut channels: Vec<Channel> = Vec::new();
        let of_channel = [0, 1, 2].map(|k| {
            let channel = optics.channel(k);
            channels.iter().position(|other| *other == channel).unwrap_or_else(|| {
                channels.push(channel);
                channels.len() - 1
            })
        });
        let table = |channel: &Channel| {
            cancel.check()?;
            Ok(ChannelTable::new(&ChannelSlab { top, bottom, channel: *channel }, photons, seed, cancel))
        };
        let tables = channels.iter().map(table).collect::<Result<Vec<_>>>()?;
        cancel.check()?;
        Ok(Self { tables, of_channel })
    }

    fn per_channel(&self, value: impl Fn(&ChannelTable) -> f64) -> DVec3 {
        let values: Vec<f64> = self.tables.iter().map(value).collect();
        let [r, g, b] = self.of_channel.map(|k| values[k]);
        DVec3::new(r, g, b)
    }

    /// BTDF [1/sr] of the light that bounced inside, and of half of the masked light, for light from above.
    pub fn btdf(&self, i: DVec3, o: DVec3) -> DVec3 {
        self.per_channel(|table| {
            let scale = table.relative(i, |parts| &parts.transmitted);
            let taps = [(i, table.is_smooth[0]), (o, table.is_smooth[1])].map(|(w, smooth)| table.taps(w, smooth));
            scale * table.transmitted.read_at(i, o, taps[0], taps[1]) + 0.5 * table.part(i, |parts| &parts.masked) / PI
        })
    }

    /// BRDF [1/sr] of the light that returns from inside, and of half of the masked light, for light from above.
    pub fn brdf(&self, i: DVec3, o: DVec3) -> DVec3 {
        self.per_channel(|table| {
            let masked = |w: DVec3| table.part(w, |parts| &parts.masked);
            // The product is reciprocal, and its integral over the viewers is half of the masked part.
            let part = if table.mean_masked > 0.0 { masked(i) * masked(o) / table.mean_masked } else { 0.0 };
            let scale = |w: DVec3| table.relative(w, |parts| &parts.reflected);
            let taps = [i, o].map(|w| table.taps(w, table.is_smooth[0]));
            scale(i) * scale(o) * table.reflected.read_at(i, o, taps[0], taps[1]) + 0.5 * part / PI
        })
    }

    /// Parts of light from `i` of a channel, interpolated.
    pub fn parts(&self, i: DVec3, channel: usize) -> Parts {
        let table = &self.tables[self.of_channel[channel]];
        Parts {
            absorbed: table.part(i, |parts| &parts.absorbed),
            masked: table.part(i, |parts| &parts.masked),
            first_total_reflection: table.part(i, |parts| &parts.first_total_reflection),
            after_bounces: table.part(i, |parts| &parts.after_bounces),
        }
    }

    /// Largest masked part of light up to 75° from the normal.
    pub fn largest_masked(&self) -> f64 {
        let rings = RINGS * 75 / 90;
        self.tables.iter().flat_map(|table| &table.parts[..rings]).map(|parts| parts.masked.mean()).fold(0.0, f64::max)
    }

    /// BTDF [1/sr] of the light of the first channel that bounced inside, averaged over the azimuth of the light.
    pub(super) fn bounced(&self) -> &RingTable {
        &self.tables[0].transmitted
    }

    /// Size in memory [bytes].
    pub fn bytes(&self) -> usize {
        self.tables.len() * 2 * RingTable::LEN * size_of::<f32>()
    }
}

/// Sums of one ring of the light.
struct RingSums {
    photons: usize,
    transmitted: Vec<f64>,
    reflected: Vec<f64>,
    parts: RingParts,
}

impl ChannelTable {
    fn new(walk: &ChannelSlab<'_>, photons: usize, seed: u64, cancel: &Cancel) -> Self {
        let rings: Vec<RingSums> =
            (0..RINGS).into_par_iter().map(|ring| trace_ring(walk, ring, photons, seed, cancel)).collect();
        let per_bin = |ring: usize| projected_solid_angle(ring) / TURNS as f64;
        let values = |sums: &dyn Fn(&RingSums) -> &[f64]| -> Vec<f64> {
            let of_ring = |ring: &RingSums| {
                let values = sums(ring).iter().enumerate();
                values.map(|(k, sum)| sum / (per_bin(k / TURNS) * ring.photons as f64)).collect::<Vec<f64>>()
            };
            rings.iter().flat_map(of_ring).collect()
        };
        let transmitted = values(&|ring| &ring.transmitted);
        let one_way = values(&|ring| &ring.reflected);
        // Reflection is reciprocal: both ways estimate one value.
        let reflected = (0..one_way.len()).map(|k| (0.5 * (one_way[k] + one_way[transposed(k)])) as f32).collect();
        let mut parts: Vec<RingParts> = rings.iter().map(|ring| ring.parts).collect();
        drop_noise(&mut parts);
        let mean_masked = (0..RINGS).map(|ring| projected_solid_angle(ring) / PI * parts[ring].masked.mean()).sum();
        let transmitted = RingTable::new(transmitted.iter().map(|value| *value as f32).collect());
        let (eta, is_smooth) = (walk.channel.eta, [walk.top.is_smooth(), walk.bottom.is_smooth()]);
        let passing = std::array::from_fn(|ring| mean_passing(ring, eta));
        Self { transmitted, reflected: RingTable::new(reflected), parts, mean_masked, eta, is_smooth, passing }
    }

    /// The rings around a direction, with weights, for light that passes a face. What passes a smooth face is interpolated as a
    /// part of the Fresnel transmission, which falls to 0 within the last ring.
    fn taps(&self, w: DVec3, is_smooth: bool) -> [(usize, f64); 2] {
        if !is_smooth {
            return ring_taps(w);
        }
        let passing = 1.0 - reflectance(w.z.abs(), self.eta);
        ring_taps(w).map(|(ring, weight)| {
            let of_ring = self.passing[ring];
            (ring, if of_ring > 0.0 { weight * passing / of_ring } else { 0.0 })
        })
    }

    /// A part of light from `i`, interpolated between the rings.
    fn part(&self, i: DVec3, of: impl Fn(&RingParts) -> &Harmonics) -> f64 {
        let basis = Harmonics::basis(i);
        self.taps(i, self.is_smooth[0]).iter().map(|(ring, weight)| weight * of(&self.parts[*ring]).at(&basis)).sum()
    }

    /// A part of light from `i` over its mean of all azimuths.
    fn relative(&self, i: DVec3, of: impl Fn(&RingParts) -> &Harmonics) -> f64 {
        let taps = self.taps(i, self.is_smooth[0]);
        let mean: f64 = taps.iter().map(|(ring, weight)| weight * of(&self.parts[*ring]).mean()).sum();
        if mean > 0.0 { self.part(i, of) / mean } else { 1.0 }
    }
}

/// Part of the light of a ring that passes a smooth face, by projected solid angle.
fn mean_passing(ring: usize, eta: f64) -> f64 {
    const STEPS: usize = 64;
    let (low, high) = (edge(ring), edge(ring + 1));
    let square = |step: usize| low + (high - low) * (step as f64 + 0.5) / STEPS as f64;
    (0..STEPS).map(|step| 1.0 - reflectance((1.0 - square(step)).max(0.0).sqrt(), eta)).sum::<f64>() / STEPS as f64
}

/// Part of the photons that the innermost ring gets; the share grows evenly to 1 of the outermost.
const LEAST_SHARE: f64 = 0.25;

/// Traces photons from one ring, spread evenly over its projected solid angle.
fn trace_ring(walk: &ChannelSlab<'_>, ring: usize, photons: usize, seed: u64, cancel: &Cancel) -> RingSums {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(ring as u64);
    let share = LEAST_SHARE + (1.0 - LEAST_SHARE) * (ring + 1) as f64 / RINGS as f64;
    let photons = ((share * photons as f64).ceil() as usize).max(1);
    let shift = std::array::from_fn(|_| rng.random());
    let bins = RINGS * TURNS;
    let mut sums =
        RingSums { photons, transmitted: vec![0.0; bins], reflected: vec![0.0; bins], parts: RingParts::default() };
    let (low, high) = (edge(ring), edge(ring + 1));
    for photon in 0..photons {
        if photon % 4096 == 0 && cancel.is_set() {
            break;
        }
        let mut numbers = EvenNumbers::new(photon, &shift, &mut rng);
        let square: f64 = low + (high - low) * numbers.random::<f64>();
        let (y, x) = (TAU * numbers.random::<f64>()).sin_cos();
        let i = DVec3::new(square.sqrt() * x, square.sqrt() * y, (1.0 - square).max(0.0).sqrt());
        let (mut after_bounces, mut through, mut back) = (0.0, 0.0, 0.0);
        let losses = walk.run(i, &mut numbers, |exit| {
            let Exit { direction, weight, bounces, is_straight } = exit;
            let is_below = direction.z < 0.0;
            if is_below && bounces > 0 {
                after_bounces += weight;
            }
            // Straight light has a closed form, as has light that reflects off the top or passes at once.
            if is_straight || bounces == 0 {
                return;
            }
            let side = if is_below { &mut sums.transmitted } else { &mut sums.reflected };
            *(if is_below { &mut through } else { &mut back }) += weight;
            side[ring_of(direction) * TURNS + turn_of(i, direction)] += weight;
        });
        let values = [losses.absorbed, losses.masked, losses.first_total_reflection, after_bounces, through, back];
        let basis = Harmonics::basis(i);
        sums.parts.all_mut().into_iter().zip(values).for_each(|(part, value)| part.add(&basis, value));
    }
    sums.parts.all_mut().into_iter().for_each(|part| part.finish(photons));
    sums
}
