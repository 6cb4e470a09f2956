//! A slab: what it transmits and reflects for a pair of directions.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};

use super::capture::svbtdf::MeanBtdf;
use super::faces::FaceSum;
use super::fresnel::reflectance;
use super::inner::{Inner, Parts};
use super::ndf::Ndf;
use super::optics::{Channel, Optics};
use super::rows::SlabRow;
use super::spread::Spread;
use super::straight::{Straight, straight};
use super::virtual_face::virtual_face;
use crate::effective::{Reflectance, Transmittance};

/// Method for light that meets rough facets on both faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Dai et al. 2009, Eq. 11.
    Dual,
    /// Their Eq. 1, as a sum over facets of the smoother face.
    Faces,
}

/// A slab whose light passes once, unless the light of inner reflections is added.
#[derive(Debug, Clone)]
pub struct Slab {
    pub top: Arc<Ndf>,
    pub bottom: Arc<Ndf>,
    /// Density of the differences of rough slopes, mass 1.
    pub virtual_face: Arc<Spread>,
    /// Facets of Eq. 1; absent if only Eq. 11 is used.
    pub facets: Option<Arc<FaceSum>>,
    pub optics: Optics,
    /// Part of the virtual roughness that lies on top (Eq. 11).
    pub alpha: f64,
    pub method: Method,
    /// Light of inner reflections; absent if bounces are off.
    pub inner: Option<Arc<Inner>>,
    /// The light of inner reflections for light from below, once it is needed.
    pub below: Arc<OnceLock<Option<Arc<Inner>>>>,
    /// Photons per ring of the table from below, and their seed.
    pub photons: usize,
    pub seed: u64,
    /// The far appearance of a captured sheet, which takes the place of both faces. It has no reflection.
    pub captured: Option<Arc<MeanBtdf>>,
}

/// Part of the virtual roughness that lies on top, by the variances of the rough parts; 1/2 without any.
pub fn alpha_of(top: &Ndf, bottom: &Ndf) -> f64 {
    let variance = |ndf: &Ndf| if ndf.is_smooth() { 0.0 } else { ndf.rough_moments().1 };
    let (t, b) = (variance(top), variance(bottom));
    if t + b > 0.0 { t / (t + b) } else { 0.5 }
}

impl Slab {
    /// A slab of two faces by Eq. 11, without inner reflections. A virtual face without a closed form is a table of `side`
    /// by `side` slopes.
    pub fn new(top: Arc<Ndf>, bottom: Arc<Ndf>, optics: Optics, side: usize) -> Self {
        Self {
            virtual_face: Arc::new(virtual_face(&top, &bottom, side)),
            alpha: alpha_of(&top, &bottom),
            top,
            bottom,
            facets: None,
            optics,
            method: Method::Dual,
            inner: None,
            below: Arc::default(),
            photons: 4096,
            seed: 1,
            captured: None,
        }
    }

    /// The same slab by the sum of Eq. 1 over `count` facets.
    pub fn by_faces(self, count: usize) -> Self {
        let facets = Some(Arc::new(FaceSum::new(&self.top, &self.bottom, count)));
        Self { facets, method: Method::Faces, ..self }
    }

    /// Adds the light of inner reflections.
    pub fn with_inner(self, inner: Arc<Inner>) -> Self {
        Self { inner: Some(inner), below: Arc::default(), ..self }
    }

    /// Transmission of the slab for one direction, above or below, and many others.
    pub fn row(&self, w: DVec3) -> SlabRow<'_> {
        SlabRow::new(self, w)
    }

    /// BTDF [1/sr] of light that is refracted once at each face, and not straight, for directions on opposite sides.
    pub fn single_pass(&self, i: DVec3, o: DVec3) -> DVec3 {
        self.row(i).single_pass(o)
    }

    /// BTDF [1/sr] without the straight light, for directions on opposite sides. It is reciprocal.
    pub fn btdf(&self, i: DVec3, o: DVec3) -> DVec3 {
        self.row(i).btdf(o)
    }

    /// BRDF [1/sr] of the face on the side of both directions, with the light that returns from inside, but without the
    /// mirrored light of level facets.
    pub fn brdf(&self, i: DVec3, o: DVec3) -> DVec3 {
        let is_above = i.z > 0.0;
        let over = DVec3::new(1.0, 1.0, i.z.signum());
        let (face, inner) =
            if is_above { (&self.top, self.inner.clone()) } else { (&self.bottom, self.inner_from_below()) };
        let (up_i, up_o) = (i * over, o * over);
        if !(up_i.z > 0.0 && up_o.z > 0.0) {
            return DVec3::ZERO;
        }
        let mut sum = self.optics.per_channel(|channel| facet_brdf(face, i, o, channel.eta));
        if let Some(inner) = inner {
            sum += self.where_not_clear(inner.brdf(up_i, up_o));
        }
        (DVec3::ONE - self.optics.diffuse) * sum
    }

    /// Keeps the channels in which the slab has faces.
    pub(super) fn where_not_clear(&self, value: DVec3) -> DVec3 {
        DVec3::select(self.optics.eta.cmpne(DVec3::ONE), value, DVec3::ZERO)
    }

    /// The table of light from below: that of the slab turned over.
    fn inner_from_below(&self) -> Option<Arc<Inner>> {
        self.inner.as_ref()?;
        let table = self.below.get_or_init(|| {
            let (top, bottom) = (self.bottom.mirrored(), self.top.mirrored());
            Inner::new(&top, &bottom, &self.optics, self.photons, self.seed, &Default::default()).ok().map(Arc::new)
        });
        table.clone()
    }

    /// `f̄(i, o)` [1/sr] of any pair of directions, the light's cosine included: transmitted if they lie on opposite sides,
    /// reflected if on one side. Straight and mirrored light is left out: see [`Self::straight`].
    pub fn eval(&self, i: DVec3, o: DVec3) -> DVec3 {
        let value = if i.z * o.z < 0.0 {
            self.btdf(i, o)
        } else if i.z * o.z > 0.0 {
            self.brdf(i, o)
        } else {
            DVec3::ZERO
        };
        value * i.z.abs()
    }

    /// Parts of light from `i` that pass straight through, and that level facets mirror, per channel.
    pub fn straight(&self, i: DVec3) -> [DVec3; 2] {
        if self.captured.is_some() {
            return [DVec3::ZERO; 2];
        }
        let over = DVec3::new(1.0, 1.0, i.z.signum());
        let parts = |channel: Channel| -> Straight {
            if i.z >= 0.0 {
                return straight(&self.top, &self.bottom, i, channel, self.inner.is_some());
            }
            straight(&self.bottom.mirrored(), &self.top.mirrored(), i * over, channel, self.inner.is_some())
        };
        let left = DVec3::ONE - self.optics.diffuse;
        let transmitted = self.optics.per_channel(|channel| parts(channel).transmitted);
        let reflected = self.optics.per_channel(|channel| parts(channel).reflected);
        [left * transmitted, left * reflected]
    }

    /// Parts of light from `i`, which points up, that do not pass at once, per channel; `None` without bounces.
    pub fn parts(&self, i: DVec3) -> Option<[Parts; 3]> {
        let inner = self.inner.as_ref()?;
        Some([0, 1, 2].map(|k| {
            if !(self.top.is_smooth() && self.bottom.is_smooth()) {
                return inner.parts(i, k);
            }
            // All light between level faces is straight, and the rest is absorbed.
            let of = |bounces| straight(&self.top, &self.bottom, i, self.optics.channel(k), bounces);
            let (all, once) = (of(true), of(false));
            Parts {
                absorbed: 1.0 - all.transmitted - all.reflected,
                after_bounces: all.transmitted - once.transmitted,
                ..Parts::default()
            }
        }))
    }

    /// Root mean square difference of the slopes of both faces.
    pub fn deviation(&self) -> f64 {
        if let Some(captured) = &self.captured {
            return captured.deviation();
        }
        self.top.deviation().hypot(self.bottom.deviation())
    }

    /// Deviation of transmitted directions, and the size of the details in a lobe, or 0 if it is smooth.
    pub fn transmitted_shape(&self) -> (f64, f64) {
        let turn = self.optics.eta.max_element() - 1.0;
        (turn * self.deviation(), turn * Ndf::finest_of(&self.top, &self.bottom))
    }

    /// The slab turned over: `eval(i, o)` of it is that of this slab with all z reversed. Inner reflections are left out.
    pub fn turned(&self) -> Self {
        let (top, bottom) = (Arc::new(self.bottom.mirrored()), Arc::new(self.top.mirrored()));
        let side = match &*self.virtual_face {
            Spread::Table(table) => table.side,
            _ => 256,
        };
        let captured = self.captured.as_ref().map(|captured| Arc::new(captured.turned()));
        let turned = Self { alpha: 1.0 - self.alpha, captured, ..Self::new(top, bottom, self.optics, side) };
        let facets = self.facets.as_ref().map(|facets| Arc::new(facets.turned()));
        Self { facets, method: self.method, photons: self.photons, seed: self.seed, ..turned }
    }
}

/// BRDF [1/sr] of the rough facets of a face, for directions on one side of it.
fn facet_brdf(face: &Ndf, i: DVec3, o: DVec3, eta: f64) -> f64 {
    let Some(h) = (i + o).try_normalize().filter(|_| !face.is_smooth() && eta != 1.0) else { return 0.0 };
    let slope = h.truncate() / h.z;
    let fresnel = reflectance(i.dot(h), eta);
    fresnel * face.density(slope) * face.seen(i) * face.seen(o) / (4.0 * (i.z * o.z).abs() * h.z.powi(4))
}

impl Reflectance for Slab {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        for (light, value) in lights.iter().zip(out) {
            let is_reflected = light.z > 0.0 && o.z > 0.0;
            *value = if is_reflected { self.eval(light.as_dvec3(), o.as_dvec3()).as_vec3() } else { Vec3::ZERO };
        }
    }
}

impl Transmittance for Slab {
    fn eval_transmitted(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let row = self.row(o.as_dvec3());
        for (light, value) in lights.iter().zip(out) {
            let i = light.as_dvec3();
            *value = (row.btdf(i) * i.z.abs()).as_vec3();
        }
    }
}
