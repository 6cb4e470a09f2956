//! The material between the faces.

use glam::DVec3;

/// Index, thickness and absorption of a slab. Vectors are linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Index of the slab over that of its surroundings, at least 1.
    pub eta: DVec3,
    /// Distance of the faces [tile units].
    pub thickness: f64,
    /// Absorption along a ray inside [1 / tile unit].
    pub absorption: DVec3,
    /// Fraction of the light that leaves the other side with constant radiance (`ρ_d`, Eq. 13).
    pub diffuse: DVec3,
}

impl Default for Optics {
    fn default() -> Self {
        Self { eta: DVec3::splat(1.5), thickness: 0.0, absorption: DVec3::ZERO, diffuse: DVec3::ZERO }
    }
}

/// One colour channel of [`Optics`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    pub eta: f64,
    /// Absorption times thickness: `exp(-depth / cos θ)` of the light arrives at the other face.
    pub depth: f64,
}

impl Channel {
    /// The part of the light along `d` inside that arrives at the other face.
    pub fn transmission(&self, d: DVec3) -> f64 {
        if self.depth <= 0.0 { 1.0 } else { (-self.depth / d.z.abs().max(1e-12)).exp() }
    }

    /// Returns true if the slab has the index of its surroundings, so that no light is deflected.
    pub fn is_clear(&self) -> bool {
        self.eta == 1.0
    }
}

impl Optics {
    pub fn channel(&self, channel: usize) -> Channel {
        Channel { eta: self.eta[channel], depth: (self.absorption[channel] * self.thickness).max(0.0) }
    }

    /// Evaluates a function of each channel, once for channels that are alike.
    pub fn per_channel(&self, mut value: impl FnMut(Channel) -> f64) -> DVec3 {
        self.per_channel_indexed(|_, channel| value(channel))
    }

    /// As [`Self::per_channel`]; the function also gets the index of the first channel of its kind.
    pub fn per_channel_indexed(&self, mut value: impl FnMut(usize, Channel) -> f64) -> DVec3 {
        let channels = [0, 1, 2].map(|k| self.channel(k));
        let mut values = DVec3::ZERO;
        for (k, channel) in channels.iter().enumerate() {
            let known = channels[..k].iter().position(|other| other == channel);
            values[k] = known.map_or_else(|| value(k, *channel), |other| values[other]);
        }
        values
    }
}
