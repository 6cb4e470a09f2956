//! Settings that are raised until the estimated error of a result is within the bound of its preset.

use super::Settings;
use crate::effective::{ErrorBound, ErrorEstimate, FACETS_POWER};

/// Part of the bound that a refined result should have, so that one refinement usually suffices.
const AIM: f64 = 0.7;
/// Largest factor by which one step raises the facets.
const MAX_STEP: usize = 8;
/// Largest number of azimuths that refinement asks for. Visibility takes time in proportion.
const MAX_AZIMUTHS: usize = 384;
/// Largest factor by which refinement raises the product of facets and azimuths, and so the time of visibility.
const MAX_WORK: usize = 32;
/// Largest factor by which refinement narrows the soft step. `standard` then has a tenth of a degree.
const MAX_SHARPNESS: usize = 8;

/// Factors by which settings are raised above those of the preset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refinement {
    pub facets: usize,
    pub azimuths: usize,
    /// The soft step is narrower by this factor.
    pub sharpness: usize,
}

impl Refinement {
    pub const NONE: Self = Self { facets: 1, azimuths: 1, sharpness: 1 };

    /// The settings of a preset with this refinement.
    pub fn apply(self, settings: &Settings) -> Settings {
        let most = settings.max_refined_facets.unwrap_or(0);
        let facets = settings.facets.max((settings.facets * self.facets).min(most));
        Settings {
            facets,
            horizon_azimuths: settings.horizon_azimuths * self.azimuths,
            slice_azimuths: settings.slice_azimuths * self.azimuths,
            penumbra: settings.penumbra / self.sharpness as f32,
            ..settings.clone()
        }
    }

    /// The refinement that should bring a result with `estimate`, computed with `self`, within `bound`. `None` if the result
    /// is within the bound, or if no setting that would help can be raised further.
    pub fn next(self, estimate: &ErrorEstimate, bound: ErrorBound, settings: &Settings) -> Option<Self> {
        if !estimate.may_exceed(bound) {
            return None;
        }
        let ErrorEstimate { facets, azimuths, soft_step, .. } = *estimate;
        let total = AIM * estimate.rel_l2 / estimate.excess(bound);
        // Each cause may have what the smaller ones leave, but at least an equal part.
        let allowed = |part: f64, others: [f64; 2]| {
            let smaller: f64 = others.iter().filter(|other| **other < part).map(|other| other * other).sum();
            (total * total - smaller).max(total * total / 3.0).sqrt()
        };
        let mut next = self;
        let of_facets = facets / allowed(facets, [azimuths, soft_step]);
        if of_facets > 1.0 {
            let wanted = of_facets.powf(2.0 / FACETS_POWER);
            next.facets *= (wanted.min(MAX_STEP as f64).ceil() as usize).next_power_of_two();
        }
        let of_azimuths = azimuths / allowed(azimuths, [facets, soft_step]);
        if of_azimuths > 1.0 {
            next.azimuths *= if of_azimuths > 2.0 { 4 } else { 2 };
        }
        if soft_step > allowed(soft_step, [facets, azimuths]) {
            next.sharpness = (2 * next.sharpness).min(MAX_SHARPNESS);
        }
        let azimuths = settings.horizon_azimuths.max(settings.slice_azimuths);
        next.azimuths = next.azimuths.min((MAX_AZIMUTHS / azimuths.max(1)).max(1));
        next.facets = next.facets.min((MAX_WORK / next.azimuths).max(self.facets));
        next.azimuths = next.azimuths.min((MAX_WORK / next.facets).max(self.azimuths));
        let (before, after) = (self.apply(settings), next.apply(settings));
        let same_width = before.penumbra.to_bits() == after.penumbra.to_bits();
        let same_azimuths = before.horizon_azimuths == after.horizon_azimuths;
        (before.facets != after.facets || !same_azimuths || !same_width).then_some(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Preset;

    const BOUND: ErrorBound = ErrorBound { rel_l2: 0.1, psnr_db: Some(35.0) };

    fn settings() -> Settings {
        Settings::of_preset(Preset::Standard)
    }

    fn estimate(facets: f64, azimuths: f64, soft_step: f64) -> ErrorEstimate {
        let visibility = azimuths.hypot(soft_step);
        let rel_l2 = facets.hypot(visibility);
        let psnr_db = Some(40.0);
        ErrorEstimate { rel_l2, psnr_db, facets, visibility, azimuths, soft_step, ..ErrorEstimate::default() }
    }

    #[test]
    fn only_the_setting_that_causes_the_error_is_raised() {
        let next = |estimate: ErrorEstimate| Refinement::NONE.next(&estimate, BOUND, &settings());
        assert_eq!(next(estimate(0.06, 0.04, 0.03)), None);
        // 0.15 is to become 0.069: a factor of 2.8 in facets, which is rounded up.
        assert_eq!(next(estimate(0.15, 0.01, 0.01)), Some(Refinement { facets: 4, azimuths: 1, sharpness: 1 }));
        assert_eq!(next(estimate(0.01, 0.3, 0.01)), Some(Refinement { facets: 1, azimuths: 4, sharpness: 1 }));
        assert_eq!(next(estimate(0.01, 0.01, 0.2)), Some(Refinement { facets: 1, azimuths: 1, sharpness: 2 }));
    }

    #[test]
    fn a_low_psnr_alone_asks_for_refinement() {
        let low = ErrorEstimate { psnr_db: Some(29.0), ..estimate(0.07, 0.0, 0.0) };
        assert!(Refinement::NONE.next(&low, BOUND, &settings()).unwrap().facets > 1);
        assert_eq!(Refinement::NONE.next(&low, ErrorBound { psnr_db: None, ..BOUND }, &settings()), None);
    }

    #[test]
    fn refinement_ends_at_the_largest_settings() {
        let (mut refinement, mut steps) = (Refinement::NONE, 0);
        while let Some(next) = refinement.next(&estimate(9.0, 9.0, 9.0), BOUND, &settings()) {
            refinement = next;
            steps += 1;
        }
        let most = refinement.apply(&settings());
        assert_eq!((most.facets, most.horizon_azimuths, most.penumbra), (49_152, 192, 0.0025));
        assert!(steps < 6, "{steps}");
    }
}
