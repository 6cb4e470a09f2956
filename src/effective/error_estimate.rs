//! Error of a direct sum, estimated from the sum itself.
//!
//! Facets are divided into replicates, each of which is a systematic sample of the whole surface. Their spread shows the
//! error of the facets. Visibility from a half and from a quarter of the azimuths shows the order and the error of
//! interpolation between azimuths (Richardson 1911), and a soft step of twice the width that of the soft step.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::{Direct, FacetSum};
use crate::brdf::Material;
use crate::geometry::{Facets, REPLICATES};
use crate::metrics::{Pair, mirror_biased_pairs};
use crate::visibility::Visibility;

/// Number of direction pairs that an estimate for a whole BRDF examines.
const PAIRS: usize = 96;
/// Seed of these pairs.
const PAIRS_SEED: u64 = 20_261_123;
/// Estimated error of an effective BRDF over the pairs that `biscale report` draws from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// Relative L2 of all errors.
    pub rel_l2: f64,
    /// PSNR of all errors [dB]; absent if no error was found.
    pub psnr_db: Option<f64>,
    /// Relative L2 of the error of the facets.
    pub facets: f64,
    /// Relative L2 of the error of visibility: between azimuths and of the soft step.
    pub visibility: f64,
    /// Relative L2 of the low-rank factors against the direct sum.
    pub table: f64,
}

/// Estimates errors of one direct sum.
#[derive(Debug)]
pub struct ErrorEstimator {
    direct: Direct,
    /// Facets and sum of each replicate. Empty if the facets represent the surface exactly.
    replicates: Vec<(Vec<usize>, FacetSum)>,
    /// Visibility from a half and from a quarter of the azimuths.
    coarse: [Option<Visibility>; 2],
    /// Visibility with a soft step of twice the width.
    softer: Option<Visibility>,
    /// Ratio of the error of interpolation between azimuths to its difference from that of half of the azimuths.
    azimuth_ratio: f64,
    /// Variance of `f̄` relative to that of the spread of the replicates. Systematic samples converge faster than
    /// random ones, for which it is 1.
    variance_ratio: f64,
    estimate: ErrorEstimate,
}

/// `f̄` of one pair, with the deviations that show its error.
#[derive(Default)]
struct Deviations {
    f_bar: DVec3,
    /// `f̄` of each replicate less that of all facets, to first order.
    replicates: [DVec3; REPLICATES],
    /// `f̄` with half of the azimuths less `f̄`, and with a quarter less `f̄` with half.
    coarse: [DVec3; 2],
    /// `f̄` with a soft step of twice the width less `f̄`: the error of the soft step is of first order.
    softer: DVec3,
}

impl Deviations {
    /// Variance of the mean of the replicates if they were random samples.
    fn random_variance(&self) -> DVec3 {
        let squares: DVec3 = self.replicates.iter().map(|x| x * x).sum();
        squares / (REPLICATES * (REPLICATES - 1)) as f64
    }

    /// Variance among means of replicates whose numbers are equal modulo `count`.
    fn variance_of(&self, count: usize) -> f64 {
        let part = REPLICATES / count;
        let mean = |k: usize| (0..part).map(|m| self.replicates[k + m * count]).sum::<DVec3>() / part as f64;
        (0..count).map(|k| mean(k).length_squared()).sum::<f64>() / (count - 1) as f64
    }
}

impl ErrorEstimator {
    /// Examines a direct sum over `facets`. `table` is the relative L2 of factors that stand for the sum, or 0.
    pub fn new(
        direct: &Direct,
        facets: &Facets,
        material_of_slot: &[usize],
        materials: &[Material],
        table: f64,
    ) -> Self {
        let sum_of = |replicate: usize| {
            let of_replicate = |s: &usize| usize::from(facets.replicates[*s]) == replicate;
            let indices: Vec<usize> = (0..facets.len()).filter(of_replicate).collect();
            let sum = FacetSum::new(&facets.subset(&indices), material_of_slot, materials);
            (indices, sum)
        };
        let replicates = if facets.replicates.is_empty() { Vec::new() } else { (0..REPLICATES).map(sum_of).collect() };
        let estimate = ErrorEstimate { rel_l2: table, psnr_db: None, facets: 0.0, visibility: 0.0, table };
        let half = direct.visibility.every_second_azimuth();
        let quarter = half.as_ref().and_then(Visibility::every_second_azimuth);
        let mut estimator = Self {
            direct: direct.clone(),
            replicates,
            coarse: [half, quarter],
            softer: direct.visibility.twice_as_soft(),
            azimuth_ratio: 1.0,
            variance_ratio: 1.0,
            estimate,
        };
        estimator.examine(table);
        estimator
    }

    /// The estimate for the whole BRDF.
    pub fn estimate(&self) -> ErrorEstimate {
        self.estimate
    }

    /// Standard error of `f̄` at each pair.
    pub fn standard_errors(&self, pairs: &[Pair]) -> Vec<Vec3> {
        let of = |deviations: Deviations| {
            let facets = deviations.random_variance() * self.variance_ratio;
            let visibility = self.visibility_error(&deviations);
            let table = deviations.f_bar * self.estimate.table;
            (facets + visibility + table * table).map(f64::sqrt).as_vec3()
        };
        pairs.par_iter().map(|pair| of(self.deviations(*pair))).collect()
    }

    /// Squared error of visibility.
    fn visibility_error(&self, deviations: &Deviations) -> DVec3 {
        let azimuths = deviations.coarse[0] * self.azimuth_ratio;
        azimuths * azimuths + deviations.softer * deviations.softer
    }

    fn examine(&mut self, table: f64) {
        let pairs = mirror_biased_pairs(PAIRS, PAIRS_SEED);
        let all: Vec<Deviations> = pairs.par_iter().map(|pair| self.deviations(*pair)).collect();
        let norm: f64 = all.iter().map(|at| at.f_bar.length_squared()).sum();
        let peak = all.iter().map(|at| at.f_bar.max_element()).fold(0.0, f64::max);
        if norm <= 0.0 {
            return;
        }
        let total = |of: &dyn Fn(&Deviations) -> f64| all.iter().map(of).sum::<f64>();
        let [six, three, two] = [6, 3, 2].map(|count| total(&|at| at.variance_of(count)));
        // Variance falls with the number of facets to this power: 1 for random samples, up to 3 for smooth integrands.
        let power = if two > 0.0 { ((six / two).ln() / 3.0_f64.ln()).clamp(1.0, 3.0) } else { 1.0 };
        let variance = (three * 3.0_f64.powf(-power) * two * 2.0_f64.powf(-power)).sqrt();
        let random = total(&|at| at.random_variance().element_sum());
        self.variance_ratio = if random > 0.0 { variance / random } else { 0.0 };
        let [half, quarter] = [0, 1].map(|k| total(&|at| at.coarse[k].length_squared()).sqrt());
        // Second order for smooth horizons, and first order where horizons jump.
        let order = if half > 0.0 && quarter > 0.0 { (quarter / half).log2().clamp(1.0, 2.0) } else { 1.0 };
        self.azimuth_ratio = 1.0 / (2.0_f64.powf(order) - 1.0);
        let visibility = total(&|at| self.visibility_error(at).element_sum());
        let rel_l2 = ((variance + visibility) / norm + table * table).sqrt();
        let rms = rel_l2 * (norm / (3 * PAIRS) as f64).sqrt();
        self.estimate = ErrorEstimate {
            rel_l2,
            psnr_db: (rms > 0.0).then(|| 20.0 * (peak / rms).log10()),
            facets: (variance / norm).sqrt(),
            visibility: (visibility / norm).sqrt(),
            table,
        };
    }

    fn deviations(&self, Pair { i, o }: Pair) -> Deviations {
        let mut deviations = Deviations::default();
        if i.z <= 0.0 || o.z <= 0.0 {
            return deviations;
        }
        let sum = &self.direct.sum;
        let (area, reflected) = self.direct.with_visibility(i, o, |v_i, v_o| {
            let (area, reflected) = (sum.projected_area(v_o, o), sum.sum(i, o, v_i, v_o));
            if area > 0.0 {
                let f_bar = reflected / area;
                for ((facets, sum), deviation) in self.replicates.iter().zip(&mut deviations.replicates) {
                    let visible = |v: &[f32]| -> Vec<f32> { facets.iter().map(|&s| v[s]).collect() };
                    let (v_i, v_o) = (visible(v_i), visible(v_o));
                    let part = sum.sum(i, o, &v_i, &v_o) - f_bar * sum.projected_area(&v_o, o);
                    *deviation = part * (REPLICATES as f64 / area);
                }
            }
            (area, reflected)
        });
        if area <= 0.0 {
            return deviations;
        }
        deviations.f_bar = reflected / area;
        let with = |visibility: &Visibility| {
            let count = sum.facet_count();
            let (mut v_i, mut v_o) = (vec![0.0; count], vec![0.0; count]);
            visibility.fill(i, 0..count, &mut v_i);
            visibility.fill(o, 0..count, &mut v_o);
            let area = sum.projected_area(&v_o, o);
            if area > 0.0 { sum.sum(i, o, &v_i, &v_o) / area } else { DVec3::ZERO }
        };
        let mut finer = deviations.f_bar;
        for (visibility, deviation) in self.coarse.iter().zip(&mut deviations.coarse) {
            if let Some(visibility) = visibility {
                let f_bar = with(visibility);
                *deviation = f_bar - finer;
                finer = f_bar;
            }
        }
        if let Some(visibility) = &self.softer {
            deviations.softer = with(visibility) - deviations.f_bar;
        }
        deviations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::compare;
    use crate::pipeline::{Outcome, Pipeline};

    fn outcome(scene: &str, settings: &[&str]) -> Outcome {
        let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
        Pipeline::new().effective(&crate::scene::open(scene, &settings).unwrap()).unwrap()
    }

    #[test]
    fn the_stated_error_of_a_draft_is_near_its_difference_from_a_fine_result() {
        let pairs = mirror_biased_pairs(200, 5);
        for (scene, azimuths) in [("fig1d_yellow_sides", 24), ("fig5d_pentagonal", 24), ("fig5d_pentagonal", 16)] {
            let values = |outcome: &Outcome| -> Vec<Vec3> {
                pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect()
            };
            let draft = outcome(scene, &["quality.preset=draft", &format!("quality.azimuths={azimuths}")]);
            let error = compare(&values(&draft), &values(&outcome(scene, &["quality.preset=fine"]))).rel_l2;
            let stated = draft.errors().unwrap().estimate().rel_l2;
            assert!((error / 3.0..error * 3.0).contains(&stated), "{scene}, {azimuths} azimuths: {error} {stated}");
            let errors = draft.errors().unwrap().standard_errors(&pairs);
            let of_pairs = compare(&errors, &vec![Vec3::ZERO; pairs.len()]);
            assert!(errors.iter().all(|error| error.is_finite() && error.min_element() >= 0.0), "{of_pairs:?}");
        }
    }

    #[test]
    fn fewer_facets_and_fewer_azimuths_state_larger_errors_of_their_kind() {
        let stated = |setting: &str| {
            outcome("fig5d_pentagonal", &["quality.preset=draft", setting]).errors().unwrap().estimate()
        };
        let (few, many) = (stated("quality.facets=256"), stated("quality.facets=16384"));
        assert!(few.facets > 4.0 * many.facets, "{few:?} {many:?}");
        let (few, many) = (stated("quality.azimuths=8"), stated("quality.azimuths=96"));
        assert!(few.visibility > 4.0 * many.visibility, "{few:?} {many:?}");
    }

    #[test]
    fn a_level_tile_states_no_error() {
        let estimate = outcome("fig9b_cylinder_stripes", &[]).errors().unwrap().estimate();
        assert_eq!((estimate.rel_l2, estimate.psnr_db), (0.0, None));
    }
}
