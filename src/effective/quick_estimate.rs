//! Estimates of errors from few direction pairs, which rule out that a result must be refined.

use glam::DVec3;

use super::Direct;
use super::error_estimate::{ErrorBound, ErrorEstimate, SAFETY_FACTOR, Totals, f_bar_at};
use super::pair_count::{PAIRS, PAIRS_SEED, PairCount};
use crate::geometry::Facets;
use crate::interreflection::InterreflectionTable;
use crate::metrics::{Pair, mirror_biased_pairs};
use crate::visibility::Resolution;

/// Numbers of direction pairs.
const QUICK_PAIRS: PairCount = PairCount { min: 16, min_effective: 1.5, max_for_errors: 0 };
/// Fewer azimuths and a wider transition at once.
const COARSE: Resolution = Resolution { azimuth_step: 2, softness: 2.0 };

/// Estimates `rel_l2` and `psnr_db` of a direct sum from few pairs, in a small part of the time of an edit. The parts are
/// left out, and the estimate tends to be too large: facets count as random samples, and convergence as of first order.
/// Returns the values of the pairs as well, unless the sum is exact.
pub(crate) fn quick_estimate(direct: &Direct, facets: &Facets) -> (ErrorEstimate, PairValues) {
    let exact_facets = facets.replicates.is_empty();
    let has_coarse = direct.visibility.has_azimuth_step(COARSE.azimuth_step);
    let mut estimate = ErrorEstimate::default();
    if exact_facets && !has_coarse {
        return (estimate, PairValues::default());
    }
    let sum = &direct.sum;
    let deviations = |pair: Pair| {
        let Pair { i, o } = pair;
        let (area, reflected, difference) = direct.with_visibility(i, o, |v_i, v_o| {
            let (area, reflected) = (sum.projected_area(v_o, o), sum.sum(i, o, v_i, v_o));
            if exact_facets || area <= 0.0 {
                return (area, reflected, DVec3::ZERO);
            }
            // The squared difference of two halves of the sample has the variance of their sum as its expectation.
            let half: Vec<f32> =
                v_o.iter().zip(&facets.replicates).map(|(v, replicate)| v * f32::from(replicate % 2)).collect();
            let (half_area, half) = (sum.projected_area(&half, o), sum.sum(i, o, v_i, &half));
            (area, reflected, 2.0 * half - reflected - reflected / area * (2.0 * half_area - area))
        });
        if area <= 0.0 {
            return (DVec3::ZERO, 0.0, area);
        }
        let f_bar = reflected / area;
        let coarse = if has_coarse { f_bar_at(direct, COARSE, pair) - f_bar } else { DVec3::ZERO };
        (f_bar, (difference / area).length_squared() + coarse.length_squared(), area)
    };
    let all = QUICK_PAIRS.evaluate(deviations, |at| at.0, |_| DVec3::ZERO);
    let totals = Totals::of(all.iter().map(|at| (1.0, at.0)));
    if totals.norm > 0.0 {
        estimate.rel_l2 = SAFETY_FACTOR * (all.iter().map(|at| at.1).sum::<f64>() / totals.norm).sqrt();
        estimate.psnr_db = totals.psnr_db(estimate.rel_l2);
    }
    let quick = all.into_iter().map(|(f_bar, _, area)| (f_bar, area)).collect();
    (estimate, PairValues { quick, ..PairValues::default() })
}

/// `f̄` without interreflection and `a_v` of the pairs of a quick estimate and of a full one; empty until they are needed.
#[derive(Debug, Default)]
pub(crate) struct PairValues {
    quick: Vec<(DVec3, f64)>,
    all: Vec<(DVec3, f64)>,
}

/// Estimates the part of the errors of `f̄` that is due to the light between facets. Few pairs suffice if they show less than
/// a part of the bound. Adds the values that it needs to those that are `known`.
pub(crate) fn estimate_of_bounced(
    direct: &Direct,
    (bounced, base_area): (&InterreflectionTable, f64),
    known: &mut PairValues,
    (bound, part): (ErrorBound, f64),
) -> ErrorEstimate {
    let of = |pair: Pair| {
        let mut reflected = DVec3::ZERO;
        let area = direct.sums(&[pair.i], pair.o, |_, sum| reflected = sum);
        (if area > 0.0 { reflected / area } else { DVec3::ZERO }, area)
    };
    let error = |values: &[(DVec3, f64)]| {
        let pairs = mirror_biased_pairs(values.len(), PAIRS_SEED);
        let of_pair = |(pair, &(f_bar, area)): (&Pair, &(DVec3, f64))| {
            let mut g = DVec3::ZERO;
            bounced.eval_lights(&[pair.i], pair.o, |_, value| g = value * base_area);
            if area > 0.0 { [f_bar + g / area, g / area] } else { [DVec3::ZERO; 2] }
        };
        let all: Vec<[DVec3; 2]> = pairs.iter().zip(values).map(of_pair).collect();
        let totals = Totals::of(all.iter().map(|at| (1.0, at[0])));
        let of_bounced: f64 = all.iter().map(|at| at[1].length_squared()).sum();
        let part = if totals.norm > 0.0 { (of_bounced / totals.norm).sqrt() } else { 0.0 };
        let rel_l2 = SAFETY_FACTOR * bounced.rel_error() * part;
        let psnr_db = totals.psnr_db(rel_l2);
        ErrorEstimate { rel_l2, psnr_db, interreflection: rel_l2, ..ErrorEstimate::default() }
    };
    if known.quick.is_empty() {
        known.quick = QUICK_PAIRS.evaluate(of, |at| at.0, |_| DVec3::ZERO);
    }
    let quick = error(&known.quick);
    if quick.excess(bound) <= part {
        return quick;
    }
    if known.all.is_empty() {
        known.all = PAIRS.evaluate(of, |at| at.0, |_| DVec3::ZERO);
    }
    error(&known.all)
}
