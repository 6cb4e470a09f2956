//! Settings that are raised until the estimated error of a result is within the bound of its preset.

use super::Settings;
use crate::effective::{ErrorBound, ErrorEstimate, FACETS_POWER};
use crate::interreflection::{InterreflectionSettings, InterreflectionTable};
use crate::math::directions::ReducedGrid;

/// Part of the bound that a refined result should have, so that one refinement usually suffices.
const AIM: f64 = 0.9;
/// Largest factor by which one step raises the facets.
const MAX_STEP: usize = 8;
/// Largest number of azimuths that refinement asks for. Visibility takes time in proportion.
const MAX_AZIMUTHS: usize = 384;
/// Largest factor by which refinement raises the product of facets and azimuths, and so the time of visibility.
const MAX_WORK: usize = 32;
/// Largest factor by which refinement narrows the transition. `standard` then has a tenth of a degree.
const MAX_SHARPNESS: usize = 8;

/// Rings of the tables of interreflection to which refinement goes.
const TABLE_RINGS: [usize; 3] = [12, 16, 24];
/// Largest factor by which one step raises the rays of interreflection.
const MAX_RAYS_STEP: usize = 4;

/// Factors by which settings are raised above those of the preset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refinement {
    pub facets: usize,
    pub azimuths: usize,
    /// The transition is narrower by this factor.
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
        if !estimate.exceeds(bound) {
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

/// The settings that should bring the light between facets within `bound`. `estimate` is its part of the errors with the
/// settings `now`, for which refinement started from `first`. `None` if it is within the bound, or if the work would be
/// more than [`MAX_WORK`] times that of `first`.
pub fn finer_interreflection(
    [first, now]: [&InterreflectionSettings; 2],
    table: &InterreflectionTable,
    estimate: &ErrorEstimate,
    bound: ErrorBound,
) -> Option<InterreflectionSettings> {
    if !estimate.exceeds(bound) {
        return None;
    }
    let total = AIM * table.rel_error() / estimate.excess(bound);
    // Noise and interpolation may have what the smaller one leaves, but at least an equal part.
    let relative = |part: f64, other: f64| {
        let smaller = if other < part { other * other } else { 0.0 };
        part / (total * total - smaller).max(0.5 * total * total).sqrt()
    };
    let noise = relative(table.noise, table.interpolation);
    let interpolation = relative(table.interpolation, table.noise);
    // Independent rays would have a square; stratified ones do better.
    let rays = (noise * noise).clamp(1.0, MAX_RAYS_STEP as f64).ceil() as usize;
    let finer = TABLE_RINGS.into_iter().filter(|rings| *rings > now.grid.rings);
    let finer: Vec<_> = finer.take(usize::from(interpolation > 1.0) + usize::from(interpolation > 2.5)).collect();
    let with = |rays: usize, rings: Option<&usize>| {
        let grid = rings.map_or(now.grid, |rings| ReducedGrid::new(*rings));
        InterreflectionSettings { useful_rays: now.useful_rays * rays, grid, ..*now }
    };
    let work = |settings: &InterreflectionSettings| (settings.useful_rays * settings.grid.len().pow(2)) as f64;
    let is_affordable = |next: &InterreflectionSettings| work(next) <= MAX_WORK as f64 * work(first) && next != now;
    // The table counts more, because its error falls faster with the work.
    let affordable = |rings: Option<&usize>| {
        let most = MAX_WORK as f64 * work(first) / work(&with(1, rings));
        with(rays.min(most as usize).max(1), rings)
    };
    let choices = [affordable(finer.last()), affordable(finer.first()), affordable(None)];
    choices.into_iter().find(is_affordable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effective::SAFETY_FACTOR;
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
        // 0.2 is to become 0.089: a factor of 2.9 in facets, which is rounded up.
        assert_eq!(next(estimate(0.2, 0.01, 0.01)), Some(Refinement { facets: 4, azimuths: 1, sharpness: 1 }));
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

    /// The rays, and the rings of the table, that follow errors of noise and of interpolation which are the error of `f̄`.
    fn finer(now: [usize; 2], noise: f64, interpolation: f64) -> Option<[usize; 2]> {
        let with = |[useful_rays, rings]: [usize; 2]| InterreflectionSettings {
            elements: 6144,
            useful_rays,
            bounces: 8,
            grid: ReducedGrid::new(rings),
            mirrors: [false; 2],
        };
        let table = InterreflectionTable::with_errors(noise, interpolation);
        let estimate = ErrorEstimate { rel_l2: SAFETY_FACTOR * table.rel_error(), ..ErrorEstimate::default() };
        let next = finer_interreflection([&with([6, 12]), &with(now)], &table, &estimate, BOUND);
        next.map(|next| [next.useful_rays, next.grid.rings])
    }

    #[test]
    fn more_rays_follow_noise_and_a_finer_table_follows_interpolation() {
        assert_eq!(finer([6, 12], 0.06, 0.04), None, "within the bound");
        // 0.15 is to become 0.069 at most: (0.15/0.069)² = 4.7, of which one step takes four.
        assert_eq!(finer([6, 12], 0.15, 0.001), Some([24, 12]));
        assert_eq!(finer([6, 12], 0.001, 0.12), Some([6, 16]));
        assert_eq!(finer([6, 12], 0.001, 0.3), Some([6, 24]));
    }

    #[test]
    fn the_work_of_interreflection_ends_its_refinement() {
        let (mut now, mut steps) = ([6, 12], 0);
        while let Some(next) = finer(now, 0.5, 0.5) {
            now = next;
            steps += 1;
        }
        let work = |[rays, rings]: [usize; 2]| rays * ReducedGrid::new(rings).len().pow(2);
        assert!(work(now) <= MAX_WORK * work([6, 12]) && work(now) > 24 * work([6, 12]), "{now:?}");
        assert!(steps < 5, "{steps}");
        // Rays alone end at the limit.
        assert_eq!(finer([96, 12], 0.5, 0.001), Some([192, 12]));
        assert_eq!(finer([192, 12], 0.5, 0.001), None);
    }
}
