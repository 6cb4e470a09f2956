//! The plan of a slab: how it is computed, why, and at what cost.

use super::{Effect, EffectKind, Preset, Settings};
use crate::scene::SlabMethod;
use crate::slab::{Method, Slab};

/// Accuracy of a slab.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabSettings {
    /// Facets that the method `faces` sums; with 0, `auto` takes Eq. 11 always.
    pub facets: usize,
    /// Largest relative L2 of Eq. 11 against Eq. 1 at which `auto` takes Eq. 11.
    pub bound: f64,
    /// Slopes per side of a table for a face, and for the virtual face.
    pub face_table: usize,
    pub virtual_table: usize,
    /// Photons per ring of the table of inner reflections.
    pub photons: usize,
    /// Paths per shading point of an image; 0 for filtered lookups.
    pub paths: usize,
    pub seed: u64,
    /// Largest number of walks per pair of a reference.
    pub reference_walks: usize,
}

impl Settings {
    /// The accuracy of a slab.
    pub fn slab(&self) -> SlabSettings {
        let (facets, bound, face_table, virtual_table, photons, paths) = match self.preset {
            Preset::Draft => (16, 0.2, 128, 128, 1024, 0),
            Preset::Standard | Preset::Wu2011 => (64, 0.05, 256, 256, 24_576, 64),
            Preset::Fine => (256, 0.02, 256, 512, 98_304, 1024),
            Preset::Reference => (256, 0.02, 256, 512, 98_304, 16_384),
        };
        SlabSettings {
            facets: self.slab_facets.unwrap_or(facets),
            bound,
            face_table,
            virtual_table,
            photons,
            paths: self.paths.unwrap_or(paths),
            seed: self.seed,
            reference_walks: self.reference_passes * self.reference_facets,
        }
    }
}

/// Properties of a slab on which its plan rests.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabFeatures {
    pub method: SlabMethod,
    /// True if all facets of a face are level, or if the slab has the index of its surroundings.
    pub is_exact: bool,
    /// Relative L2 of Eq. 11 against Eq. 1.
    pub dual_error: f64,
    pub bounces: bool,
    /// Number of colour channels that differ.
    pub channels: usize,
}

impl SlabFeatures {
    pub fn of(slab: &Slab, method: SlabMethod, dual_error: f64) -> Self {
        let mut channels = 0;
        slab.optics.per_channel(|_| {
            channels += 1;
            0.0
        });
        let is_exact = slab.top.is_smooth() || slab.bottom.is_smooth() || slab.optics.eta == glam::DVec3::ONE;
        Self { method, is_exact, dual_error, bounces: slab.inner.is_some(), channels }
    }
}

/// The method chosen for a slab, with the rows of the plan that give the reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabDecision {
    pub method: Method,
    pub effects: Vec<Effect>,
}

/// Nanoseconds of Eq. 11 per pair, and of each facet of the sum (`cargo bench --bench measure -- slabs`).
const DUAL_NS: f64 = 160.0;
const FACET_NS: f64 = 30.0;
/// Nanoseconds per photon of the table of inner reflections, and its rings.
const PHOTON_NS: f64 = 500.0;
const RINGS: f64 = 24.0;
/// Nanoseconds of each representative of a captured sheet per pair (`cargo bench --bench measure -- capture`, per core).
const REPRESENTATIVE_NS: f64 = 95.0;
/// Pairs of which the predicted time is stated: a Klems matrix.
const PAIRS: f64 = 145.0 * 145.0;

impl SlabDecision {
    pub fn new(features: &SlabFeatures, settings: &SlabSettings) -> Self {
        let SlabFeatures { method, is_exact, dual_error, bounces, channels } = *features;
        let (error, bound) = (100.0 * dual_error, 100.0 * settings.bound);
        let takes_sum = !is_exact && settings.facets > 0 && dual_error > settings.bound;
        let (method, reason) = match method {
            SlabMethod::Dual => (Method::Dual, format!("the dual-microfacet model as asked; {error:.1} % from Eq. 1")),
            SlabMethod::Faces => (Method::Faces, format!("a sum over {} facets, as asked", settings.facets.max(1))),
            SlabMethod::Auto if is_exact => {
                (Method::Dual, "one rough face at most: the closed formula is exact".to_owned())
            }
            SlabMethod::Auto if takes_sum => (
                Method::Faces,
                format!(
                    "the dual-microfacet model is {error:.1} % from Eq. 1 on 32 pairs, more than {bound:.0} %: a sum over \
                     {} facets",
                    settings.facets
                ),
            ),
            SlabMethod::Auto => (
                Method::Dual,
                format!("the dual-microfacet model is {error:.1} % from Eq. 1 on 32 pairs (bound: {bound:.0} %)"),
            ),
        };
        let pair_ns = channels as f64
            * match method {
                Method::Dual => DUAL_NS,
                Method::Faces => DUAL_NS + FACET_NS * settings.facets as f64,
            };
        let inner_ms = channels as f64 * RINGS * settings.photons as f64 * PHOTON_NS * 1e-6;
        let inner_reason = if bounces {
            format!("light between the faces: a table from {} photons at each of 24 angles", settings.photons)
        } else {
            "off as asked: light between the faces, and light that masking removes, is lost".to_owned()
        };
        let effects = vec![
            row(
                "slab",
                true,
                format!("{reason}; the cost is that of 145 x 145 pairs on one core"),
                PAIRS * pair_ns * 1e-6,
            ),
            row("slab_bounces", bounces, inner_reason, if bounces { inner_ms } else { 0.0 }),
        ];
        Self { method, effects }
    }

    /// A captured sheet of so many representatives: the mean over its pixels, without inner reflections.
    pub fn of_capture(representatives: usize) -> Self {
        let reason =
            format!("a captured sheet: the mean over its pixels is a sum over {representatives} representatives");
        let pair_ns = DUAL_NS + REPRESENTATIVE_NS * representatives as f64;
        let bounces = "the capture holds the light that is reflected inside".to_owned();
        let effects = vec![row("slab", true, reason, PAIRS * pair_ns * 1e-6), row("slab_bounces", false, bounces, 0.0)];
        Self { method: Method::Dual, effects }
    }
}

fn row(name: &'static str, on: bool, reason: String, predicted_ms: f64) -> Effect {
    let kind = EffectKind::Physics;
    Effect {
        name,
        kind,
        on,
        reason,
        predicted_ms,
        measured_ms: None,
        forced: false,
        bound: None,
        light: None,
        left_out: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Preset;

    #[test]
    fn auto_takes_the_sum_only_beyond_the_bound_of_the_preset() {
        let features =
            |dual_error, method| SlabFeatures { method, is_exact: false, dual_error, bounces: true, channels: 1 };
        let decide = |preset, error, method| {
            SlabDecision::new(&features(error, method), &Settings::of_preset(preset).slab()).method
        };
        assert_eq!(decide(Preset::Draft, 0.1, SlabMethod::Auto), Method::Dual);
        assert_eq!(decide(Preset::Standard, 0.1, SlabMethod::Auto), Method::Faces);
        assert_eq!(decide(Preset::Standard, 0.01, SlabMethod::Auto), Method::Dual);
        assert_eq!(decide(Preset::Fine, 0.03, SlabMethod::Auto), Method::Faces);
        assert_eq!(decide(Preset::Draft, 0.0, SlabMethod::Faces), Method::Faces);
        assert_eq!(decide(Preset::Fine, 0.9, SlabMethod::Dual), Method::Dual);
        let never = SlabSettings { facets: 0, ..Settings::of_preset(Preset::Fine).slab() };
        assert_eq!(SlabDecision::new(&features(0.9, SlabMethod::Auto), &never).method, Method::Dual);
    }
}
