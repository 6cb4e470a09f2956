//! Error of a direct sum, estimated from the sum itself.
//!
//! Facets are divided into replicates, each of which is a systematic sample of the whole surface. Their spread shows how
//! the error of the facets is distributed over direction pairs. Its size follows from the difference from a second sample
//! of fewer facets, because replicates are less even than the whole sample. Visibility from a half and from a quarter
//! of the azimuths shows the order and the error of interpolation between azimuths (Richardson 1911). Visibility with
//! half the transition width shows the error of the transition. Pairs of nearly equal directions are examined more often than they are drawn. The
//! stated error of the whole BRDF is [`SAFETY_FACTOR`] times the estimate.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::pair_count::PairCount;
use super::{Direct, FacetSum};
use crate::base::{Cancel, Result};
use crate::brdf::Material;
use crate::geometry::{Facets, REPLICATES};
use crate::interreflection::InterreflectionTable;
use crate::metrics::{Pair, mirror_biased_pairs};
use crate::visibility::Resolution;

/// Pairs of nearly equal directions are rare, but hold most of the error of thin needles ([`Deviations::blended`]). They are
/// therefore taken from a sequence that is longer by this factor, with a weight that is smaller by it.
const RETROREFLECTION_FACTOR: usize = 8;
/// Largest angle between the directions of such a pair [rad].
const RETROREFLECTION_ANGLE: f32 = 0.15;
/// Seed of the sequence.
const RETROREFLECTION_SEED: u64 = 20_261_127;
/// Size of the error relative to [`Deviations::blended`], where what blocks is narrower than the steps between azimuths. The sum
/// multiplies two visibilities that are blended from two azimuths. If both directions see past the same edges, the product
/// should be `v` in place of `v²`, and the error is -1; if they see past independent edges, it is 2 on average.
const BLENDED_RATIO: f64 = 1.5;
/// Ratio of a stated error to the estimate of the expected one, about which the error of a single result scatters. With this
/// ratio, none of the tiles of `cargo bench --bench measure -- errors` states less than a third of its true error or exceeds
/// its bound without a warning.
pub(crate) const SAFETY_FACTOR: f64 = 1.3;
/// Median of stated over true errors of the same tiles.
const TYPICAL_RATIO: f64 = 1.1;
/// The variance of a sum over systematic samples falls with the number of facets to this power: 1 for random samples, 2
/// for smooth integrands.
pub(crate) const FACETS_POWER: f64 = 1.5;
/// The second sample has fewer facets by this factor. With a factor of 2 the stated error depends little on
/// [`FACETS_POWER`]: by 14 % if the true power is 1 or 2.
pub(crate) const SECOND_SAMPLE_DIVISOR: usize = 2;
/// Orders at which the error of visibility falls with the resolution: the first where horizons jump, the second where they
/// are smooth. Refinement, which has no second sample, counts on no more than the first; a stated error on a typical one.
const LEAST_ORDER: f64 = 1.0;
const TYPICAL_ORDER: f64 = 1.5;
const MOST_ORDER: f64 = 2.0;
/// Typical variance of a sum over systematic samples, relative to one over random samples, on many tiles; and its weight
/// in the mean with the value of one tile. That value comes from a single difference of samples, which may be small by
/// chance.
const TYPICAL_VARIANCE: f64 = 0.2;
const TYPICAL_WEIGHT: f64 = 0.3;
/// Resolutions that show the error of visibility: a half and a quarter of the azimuths, and half the transition
/// width.
const HALF: Resolution = Resolution { azimuth_step: 2, softness: 1.0 };
const QUARTER: Resolution = Resolution { azimuth_step: 4, softness: 1.0 };
const SHARPER: Resolution = Resolution { azimuth_step: 1, softness: 0.5 };

/// The error that a preset allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBound {
    /// Largest relative L2.
    pub rel_l2: f64,
    /// Smallest PSNR [dB].
    pub psnr_db: Option<f64>,
}

/// Stated error of an effective BRDF over the pairs that `biscale report` draws from: [`SAFETY_FACTOR`] times the estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// Relative L2 of all errors.
    pub rel_l2: f64,
    /// PSNR of all errors [dB]; absent if no error was found.
    pub psnr_db: Option<f64>,
    /// Relative L2 of the error of the facets.
    pub facets: f64,
    /// Relative L2 of the error of visibility: between azimuths and of the transition.
    pub visibility: f64,
    /// Relative L2 of the low-rank factors against the direct sum.
    pub table: f64,
    /// Relative L2 of the error of the light that facets send to each other, if it is in the result.
    pub interreflection: f64,
    /// The part of the reflected light that facets send to each other and that the result lacks, which is not in the errors
    /// above; absent if it was not measured.
    pub light_left_out: Option<f64>,
    /// The part of `visibility` that is due to the number of azimuths.
    #[serde(skip)]
    pub azimuths: f64,
    /// The part of `visibility` that is due to the width of the transition.
    #[serde(skip)]
    pub soft_step: f64,
}

impl ErrorEstimate {
    /// The estimate in words, such as `0.8 %, 54.1 dB`.
    pub fn describe(&self) -> String {
        let psnr = self.psnr_db.map_or_else(String::new, |psnr| format!(", {psnr:.1} dB"));
        let percent = 100.0 * self.rel_l2;
        if percent < 0.1 { format!("{percent:.3} %{psnr}") } else { format!("{percent:.1} %{psnr}") }
    }

    /// The relative L2 that the true error typically has.
    pub fn typical_rel_l2(&self) -> f64 {
        self.rel_l2 / TYPICAL_RATIO
    }

    /// Returns true if the stated error exceeds a bound.
    pub fn exceeds(&self, bound: ErrorBound) -> bool {
        self.excess(bound) > 1.0
    }

    /// The error as a multiple of a bound.
    pub fn excess(&self, bound: ErrorBound) -> f64 {
        let psnr = match (self.psnr_db, bound.psnr_db) {
            (Some(psnr), Some(bound)) => 10.0_f64.powf((bound - psnr) / 20.0),
            _ => 0.0,
        };
        psnr.max(self.rel_l2 / bound.rel_l2)
    }
}

/// Estimates errors of one direct sum.
#[derive(Debug)]
pub struct ErrorEstimator {
    direct: Direct,
    /// Facets and sum of each replicate. Empty if the facets represent the surface exactly.
    replicates: Vec<(Vec<usize>, FacetSum)>,
    /// Ratio of the error of interpolation between azimuths to its difference from that of half of the azimuths.
    azimuth_ratio: f64,
    /// Ratio of the error of the transition to its difference from that of half the width.
    soft_step_ratio: f64,
    /// Variance of `f̄` relative to what the spread of the replicates would show if they were random samples.
    variance_ratio: f64,
    /// Light that facets send to each other, and the base area of the tile.
    bounced: Option<(Arc<InterreflectionTable>, f64)>,
    estimate: ErrorEstimate,
}

/// `f̄` of one pair, with the deviations that show its error.
#[derive(Default)]
struct Deviations {
    /// Weight of the pair in sums over pairs.
    weight: f64,
    f_bar: DVec3,
    /// `f̄` of each replicate less that of all facets, to first order.
    replicates: [DVec3; REPLICATES],
    /// `f̄` with half of the azimuths less `f̄`, and with a quarter less `f̄` with half.
    coarse: [DVec3; 2],
    /// Near retroreflection, `f̄` with `v_i (1 - v_i)` in place of `v_i v_o`: it shows how much of the visibility is a blend
    /// of two azimuths. Fewer azimuths give blends as well, so that `coarse` does not show this error.
    blended: DVec3,
    /// `f̄` with a transition of half the width less `f̄`.
    sharper: DVec3,
    /// `f̄` of the second sample less `f̄`.
    second: DVec3,
    /// The part of light that facets send to each other, which `f_bar` lacks.
    bounced: DVec3,
}

impl Deviations {
    /// Variance of the mean of the replicates if they were random samples.
    fn random_variance(&self) -> DVec3 {
        let squares: DVec3 = self.replicates.iter().map(|x| x * x).sum();
        squares / (REPLICATES * (REPLICATES - 1)) as f64
    }
}

fn is_near_retroreflection(pair: &Pair) -> bool {
    pair.i.angle_between(pair.o) < RETROREFLECTION_ANGLE
}

/// `f̄` of `direct` with visibility of a lower resolution, for directions above the horizon.
pub(super) fn f_bar_at(direct: &Direct, resolution: Resolution, Pair { i, o }: Pair) -> DVec3 {
    let count = direct.sum.facet_count();
    let (mut v_i, mut v_o) = (vec![0.0; count], vec![0.0; count]);
    direct.visibility.fill_at(resolution, i, &mut v_i);
    direct.visibility.fill_at(resolution, o, &mut v_o);
    let area = direct.sum.projected_area(&v_o, o);
    if area > 0.0 { direct.sum.sum(i, o, &v_i, &v_o) / area } else { DVec3::ZERO }
}

/// Sums of squares over the pairs of an estimate, and the largest value.
pub(super) struct Totals {
    /// Sum of `|f̄|²`.
    pub norm: f64,
    /// Largest value of `f̄`.
    peak: f64,
    /// Number of values: three per pair.
    values: f64,
}

impl Totals {
    /// The totals of weights and values of `f̄`.
    pub fn of(f_bars: impl Iterator<Item = (f64, DVec3)>) -> Self {
        let mut totals = Self { norm: 0.0, peak: 0.0, values: 0.0 };
        for (weight, f_bar) in f_bars {
            totals.norm += weight * f_bar.length_squared();
            totals.peak = totals.peak.max(f_bar.max_element());
            totals.values += 3.0 * weight;
        }
        totals
    }

    /// The PSNR of a relative L2 [dB].
    pub fn psnr_db(&self, rel_l2: f64) -> Option<f64> {
        let rms = rel_l2 * (self.norm / self.values).sqrt();
        (rms > 0.0).then(|| 20.0 * (self.peak / rms).log10())
    }
}

impl ErrorEstimator {
    /// Examines a direct sum over `facets`. `second` is the sum over a second sample of the surface, with
    /// [`SECOND_SAMPLE_DIVISOR`] times fewer facets. Without it, facets count as random samples: their error then is too large,
    /// by up to a factor of 6, on surfaces of few large triangles. `table` is the relative L2 of factors that stand for the
    /// sum, or 0. `bounced` is the light that facets send to each other, and the base area of the tile. `light_left_out` is
    /// stated as it is.
    pub(crate) fn new(
        pairs: &PairCount,
        direct: &Direct,
        facets: &Facets,
        (material_of_slot, materials): (&[usize], &[Material]),
        second: Option<&Direct>,
        table: f64,
        (bounced, light_left_out): (Option<(Arc<InterreflectionTable>, f64)>, Option<f64>),
    ) -> Self {
        let sum_of = |replicate: usize| {
            let of_replicate = |s: &usize| usize::from(facets.replicates[*s]) == replicate;
            let indices: Vec<usize> = (0..facets.len()).filter(of_replicate).collect();
            let sum = FacetSum::new(&facets.subset(&indices), material_of_slot, materials);
            (indices, sum)
        };
        let replicates = if facets.replicates.is_empty() { Vec::new() } else { (0..REPLICATES).map(sum_of).collect() };
        let table = SAFETY_FACTOR * table;
        let estimate = ErrorEstimate { rel_l2: table, table, light_left_out, ..ErrorEstimate::default() };
        let mut estimator = Self {
            direct: direct.clone(),
            replicates,
            azimuth_ratio: 1.0,
            soft_step_ratio: 1.0,
            variance_ratio: 1.0,
            bounced,
            estimate,
        };
        estimator.examine(pairs, second, table);
        estimator
    }

    /// The stated error of the whole BRDF.
    pub fn estimate(&self) -> ErrorEstimate {
        self.estimate
    }

    /// Standard error of `f̄` at each pair, without [`SAFETY_FACTOR`].
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn standard_errors(&self, pairs: &[Pair], cancel: &Cancel) -> Result<Vec<Vec3>> {
        let of = |deviations: Deviations| {
            let facets = deviations.random_variance() * self.variance_ratio;
            let azimuths = deviations.coarse[0] * self.azimuth_ratio;
            let blended = deviations.blended * BLENDED_RATIO;
            let soft_step = deviations.sharper * self.soft_step_ratio;
            let visibility = azimuths * azimuths + blended * blended + soft_step * soft_step;
            let table = deviations.f_bar * (self.estimate.table / SAFETY_FACTOR);
            let bounced = deviations.bounced * self.rel_error_of_bounced();
            (facets + visibility + table * table + bounced * bounced).map(f64::sqrt).as_vec3()
        };
        cancel.map("standard errors", pairs.len(), |k| of(self.deviations(None, pairs[k])))
    }

    /// Relative error of the light between facets; 0 if it is left out.
    fn rel_error_of_bounced(&self) -> f64 {
        self.bounced.as_ref().map_or(0.0, |(bounced, _)| bounced.rel_error())
    }

    fn examine(&mut self, pairs: &PairCount, second: Option<&Direct>, table: f64) {
        let of = |pair| self.deviations(second, pair);
        let mut all = pairs.evaluate(of, |at| at.f_bar + at.bounced, |at| at.coarse[0]);
        // The peak is that of pairs as they come.
        let Totals { peak, .. } = Totals::of(all.iter().map(|at| (1.0, at.f_bar + at.bounced)));
        let longer = mirror_biased_pairs((RETROREFLECTION_FACTOR - 1) * all.len(), RETROREFLECTION_SEED);
        let near: Vec<Pair> = longer.into_iter().filter(is_near_retroreflection).collect();
        all.par_extend(near.par_iter().map(|&pair| self.deviations(second, pair)));
        let totals = Totals { peak, ..Totals::of(all.iter().map(|at| (at.weight, at.f_bar + at.bounced))) };
        if totals.norm <= 0.0 {
            return;
        }
        let total = |of: &dyn Fn(&Deviations) -> f64| all.iter().map(|at| at.weight * of(at)).sum::<f64>();
        let random = total(&|at| at.random_variance().element_sum());
        if second.is_some() && random > 0.0 {
            // The squared difference of two samples has the sum of their variances as its expectation.
            let variances = 1.0 + (SECOND_SAMPLE_DIVISOR as f64).powf(FACETS_POWER);
            let found = total(&|at| at.second.length_squared()) / variances / random;
            self.variance_ratio = found + TYPICAL_WEIGHT * (TYPICAL_VARIANCE - found);
        }
        let variance = random * self.variance_ratio;
        let size = |of: &dyn Fn(&Deviations) -> DVec3| total(&|at| of(at).length_squared()).sqrt();
        let [half, quarter] = [0, 1].map(|k| size(&|at| at.coarse[k]));
        let least_order = if second.is_some() { TYPICAL_ORDER } else { LEAST_ORDER };
        let order = if half > 0.0 && quarter > 0.0 { (quarter / half).log2() } else { least_order };
        self.azimuth_ratio = 1.0 / (2.0_f64.powf(order.clamp(least_order, MOST_ORDER)) - 1.0);
        let sharper = size(&|at| at.sharper);
        self.soft_step_ratio = 1.0 / (1.0 - 2.0_f64.powf(-least_order));
        let stated = |squares: f64| SAFETY_FACTOR * (squares / totals.norm).sqrt();
        let blended = BLENDED_RATIO * size(&|at| at.blended);
        let azimuths = stated((self.azimuth_ratio * half).powi(2) + blended * blended);
        let soft_step = stated((self.soft_step_ratio * sharper).powi(2));
        let (facets, visibility) = (stated(variance), azimuths.hypot(soft_step));
        let bounced = total(&|at| at.bounced.length_squared());
        let interreflection = self.rel_error_of_bounced() * stated(bounced);
        let rel_l2 = facets.hypot(visibility).hypot(table).hypot(interreflection);
        let psnr_db = totals.psnr_db(rel_l2);
        let light_left_out = self.estimate.light_left_out;
        self.estimate = ErrorEstimate {
            rel_l2,
            psnr_db,
            facets,
            visibility,
            table,
            interreflection,
            light_left_out,
            azimuths,
            soft_step,
        };
    }

    /// The change of `f̄` from the resolution of the result to the first of others, and from each to the next.
    fn changes<const N: usize>(&self, resolutions: [Resolution; N], f_bar: DVec3, pair: Pair) -> [DVec3; N] {
        let mut before = f_bar;
        resolutions.map(|resolution| {
            if !self.direct.visibility.has_azimuth_step(resolution.azimuth_step) {
                return DVec3::ZERO;
            }
            let f_bar = f_bar_at(&self.direct, resolution, pair);
            f_bar - std::mem::replace(&mut before, f_bar)
        })
    }

    fn deviations(&self, second: Option<&Direct>, pair: Pair) -> Deviations {
        let Pair { i, o } = pair;
        let is_near = is_near_retroreflection(&pair);
        let weight = if is_near { 1.0 / RETROREFLECTION_FACTOR as f64 } else { 1.0 };
        let mut deviations = Deviations { weight, ..Deviations::default() };
        if i.z <= 0.0 || o.z <= 0.0 {
            return deviations;
        }
        let mut blended = DVec3::ZERO;
        // Projected area and reflection of each replicate, or of all facets.
        let parts: Vec<(f64, DVec3)> = self.direct.with_visibility(i, o, |v_i, v_o| {
            if is_near && !self.direct.visibility.is_exact_between_azimuths() {
                let blocked: Vec<f32> = v_i.iter().map(|v| 1.0 - v).collect();
                blended = self.direct.sum.sum(i, o, v_i, &blocked);
            }
            let of = |sum: &FacetSum, v_i: &[f32], v_o: &[f32]| (sum.projected_area(v_o, o), sum.sum(i, o, v_i, v_o));
            if self.replicates.is_empty() {
                return vec![of(&self.direct.sum, v_i, v_o)];
            }
            let visible = |facets: &[usize], v: &[f32]| -> Vec<f32> { facets.iter().map(|&s| v[s]).collect() };
            self.replicates.iter().map(|(facets, sum)| of(sum, &visible(facets, v_i), &visible(facets, v_o))).collect()
        });
        let area: f64 = parts.iter().map(|part| part.0).sum();
        if area <= 0.0 {
            return deviations;
        }
        deviations.blended = blended / area;
        deviations.f_bar = parts.iter().map(|part| part.1).sum::<DVec3>() / area;
        if let Some((bounced, base_area)) = &self.bounced {
            bounced.eval_lights(&[i], o, |_, g| deviations.bounced = g * (base_area / area));
        }
        if !self.replicates.is_empty() {
            for (deviation, (part_area, reflected)) in deviations.replicates.iter_mut().zip(&parts) {
                *deviation = (reflected - deviations.f_bar * part_area) * (REPLICATES as f64 / area);
            }
        }
        if let Some(second) = second {
            let mut reflected = DVec3::ZERO;
            let area = second.sums(&[i], o, |_, sum| reflected = sum);
            deviations.second = if area > 0.0 { reflected / area } else { DVec3::ZERO } - deviations.f_bar;
        }
        deviations.coarse = self.changes([HALF, QUARTER], deviations.f_bar, pair);
        [deviations.sharper] = self.changes([SHARPER], deviations.f_bar, pair);
        deviations
    }
}

#[cfg(test)]
#[path = "error_estimate_tests.rs"]
mod tests;
