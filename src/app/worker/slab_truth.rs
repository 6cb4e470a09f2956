//! The lobe of a slab by photons, which are added in batches.

use crate::base::{Cancel, Result};
use crate::pipeline::SlabOutcome;
use crate::reference::photons::{Bins, LobeSettings, TrueLobe};
use crate::slab::{Channel, ChannelSlab, Slab};
use glam::{DVec2, DVec3};

use super::slab_lobe::{LobeCurve, SIDE, STEPS, plane_direction};

/// Photons of one batch and colour channel.
const PHOTONS: usize = 1 << 17;

/// The state of the photons.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthState {
    pub photons: usize,
    /// Relative L2 of the standard errors.
    pub noise: f64,
    /// Transmitted part of the light, and its standard error.
    pub transmitted: [f64; 2],
    /// Name and relative L2 of each model against the photons, without their noise.
    pub models: Vec<(&'static str, f64)>,
}

/// Photons through both faces, in batches.
pub struct Truth<'a> {
    slab: &'a Slab,
    i: DVec3,
    bounces: bool,
    /// Channels that differ, each with its weight in the channel mean of the light that does not leave evenly.
    channels: Vec<(Channel, f64)>,
    /// The even part of the transmitted light, channel mean.
    even: f64,
    seed: u64,
    batches: usize,
    /// Sums over batches of means and variances of the cells, and of the transmitted part.
    sums: Bins,
    transmitted: [f64; 2],
    /// The mean of all batches.
    mean: Option<TrueLobe>,
}

impl<'a> Truth<'a> {
    pub fn new(outcome: &'a SlabOutcome, i: DVec3, bounces: bool) -> Self {
        let optics = &outcome.slab.optics;
        let mut channels: Vec<(Channel, f64)> = Vec::new();
        for k in 0..3 {
            let (channel, weight) = (optics.channel(k), (1.0 - optics.diffuse[k]) / 3.0);
            match channels.iter_mut().find(|(known, _)| *known == channel) {
                Some((_, sum)) => *sum += weight,
                None => channels.push((channel, weight)),
            }
        }
        let zeros = vec![0.0; SIDE * SIDE];
        Self {
            slab: &outcome.slab,
            i,
            bounces,
            channels,
            even: optics.diffuse.element_sum() / 3.0,
            seed: outcome.settings.seed,
            batches: 0,
            sums: Bins { values: zeros.clone(), variances: zeros },
            transmitted: [0.0; 2],
            mean: None,
        }
    }

    pub fn add_batch(&mut self, cancel: &Cancel) -> Result<()> {
        let seed = self.seed.wrapping_add(self.batches as u64);
        let settings = LobeSettings { side: SIDE, photons: PHOTONS, target: 0.0, seed };
        self.batches += 1;
        for (channel, weight) in &self.channels {
            let walk = ChannelSlab { top: &self.slab.top, bottom: &self.slab.bottom, channel: *channel };
            let lobe = TrueLobe::trace(&walk, self.i, &settings, cancel)?;
            let bins = if self.bounces { &lobe.all } else { &lobe.single };
            let sums = self.sums.values.iter_mut().zip(&mut self.sums.variances);
            for ((sum, variance), (value, more)) in sums.zip(bins.values.iter().zip(&bins.variances)) {
                *sum += weight * value;
                *variance += weight * weight * more;
            }
            let part = if self.bounces { lobe.totals.transmitted } else { lobe.totals.single_pass };
            self.transmitted[0] += weight * part.value;
            self.transmitted[1] += (weight * part.standard_error).powi(2);
            self.mean = Some(lobe);
        }
        if let Some(mean) = &mut self.mean {
            let (count, even) = (self.batches as f64, self.even / std::f64::consts::PI);
            let values = self.sums.values.iter().map(|sum| sum / count + even).collect();
            let variances = self.sums.variances.iter().map(|sum| sum / (count * count)).collect();
            mean.all = Bins { values, variances };
        }
        Ok(())
    }

    /// The lobe in the plane of incidence, linear between the middles of cells.
    pub fn curve(&self) -> LobeCurve {
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        let Some(mean) = &self.mean else { return LobeCurve { name: "reference", values, errors: None } };
        for step in 0..=STEPS {
            let at = (plane_direction(self.i, step).truncate() + 1.0) * (0.5 * SIDE as f64) - 0.5;
            let (low, f) = (at.floor().max(DVec2::ZERO), at - at.floor());
            let (mut value, mut variance) = (0.0, 0.0);
            for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let part = |step: usize, f: f64| if step == 0 { 1.0 - f } else { f };
                let weight = part(x, f.x) * part(y, f.y);
                let cell = (low.y as usize + y).min(SIDE - 1) * SIDE + (low.x as usize + x).min(SIDE - 1);
                value += weight * mean.all.values[cell];
                variance += weight * weight * mean.all.variances[cell];
            }
            values.push(value as f32);
            errors.push(variance.sqrt() as f32);
        }
        LobeCurve { name: "reference", values, errors: Some(errors) }
    }

    pub fn state(&self, models: &[(&'static str, Vec<f64>)]) -> TruthState {
        let count = self.batches.max(1) as f64;
        let error = |cells: &[f64]| self.mean.as_ref().map_or(0.0, |mean| mean.relative_l2(&mean.all, cells));
        TruthState {
            photons: self.batches * PHOTONS,
            noise: self.mean.as_ref().map_or(0.0, TrueLobe::noise),
            transmitted: [self.transmitted[0] / count + self.even, self.transmitted[1].sqrt() / count],
            models: models.iter().map(|(name, cells)| (*name, error(cells))).collect(),
        }
    }
}
