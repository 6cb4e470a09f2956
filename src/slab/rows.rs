//! Transmission of a slab for one direction and many others. Terms of the one direction are computed once.

use std::f64::consts::PI;

use glam::DVec3;

use super::dual::DualFaces;
use super::faces::SumRow;
use super::model::{Method, Slab};
use super::optics::Channel;

/// A slab and one direction, above or below.
#[derive(Debug, Clone)]
pub struct SlabRow<'a> {
    slab: &'a Slab,
    w: DVec3,
    /// Sums over facets, for the first channel of each kind; absent where Eq. 11 is used.
    sums: [Option<SumRow<'a>>; 3],
}

impl<'a> SlabRow<'a> {
    pub(super) fn new(slab: &'a Slab, w: DVec3) -> Self {
        let mut sums = [const { None }; 3];
        if let (Some(facets), Method::Faces, None) = (&slab.facets, slab.method, &slab.captured) {
            slab.optics.per_channel_indexed(|k, channel| {
                sums[k] = Some(facets.row(&slab.top, &slab.bottom, w, channel));
                0.0
            });
        }
        Self { slab, w, sums }
    }

    /// The direction above and the one below; `None` if both lie on one side.
    fn pair(&self, other: DVec3) -> Option<(DVec3, DVec3)> {
        let (i, o) = if self.w.z > 0.0 { (self.w, other) } else { (other, self.w) };
        (i.z > 0.0 && o.z < 0.0).then_some((i, o))
    }

    /// BTDF [1/sr] of light that is refracted once at each face, and not straight, for a direction on the other side.
    pub fn single_pass(&self, other: DVec3) -> DVec3 {
        let Some((i, o)) = self.pair(other) else { return DVec3::ZERO };
        self.slab.optics.per_channel_indexed(|k, channel| self.in_channel(i, o, k, channel))
    }

    fn in_channel(&self, i: DVec3, o: DVec3, k: usize, channel: Channel) -> f64 {
        if channel.is_clear() {
            return 0.0;
        }
        let slab = self.slab;
        let virtual_density = |m| slab.virtual_face.density(m);
        let faces = DualFaces { top: &slab.top, bottom: &slab.bottom, virtual_density, alpha: slab.alpha };
        match &self.sums[k] {
            Some(sum) => faces.one_rough(i, o, channel) + sum.btdf(if self.w.z > 0.0 { o } else { i }),
            None => faces.btdf(i, o, channel),
        }
    }

    /// BTDF [1/sr] without the straight light, for a direction on the other side.
    pub fn btdf(&self, other: DVec3) -> DVec3 {
        let Some((i, o)) = self.pair(other) else { return DVec3::ZERO };
        let slab = self.slab;
        if let Some(captured) = &slab.captured {
            return captured.btdf(i, o);
        }
        let mut sum = self.single_pass(other);
        if let Some(inner) = &slab.inner {
            sum += slab.where_not_clear(inner.btdf(i, o));
        }
        let diffuse = slab.optics.diffuse;
        (DVec3::ONE - diffuse) * sum + diffuse / PI
    }
}
