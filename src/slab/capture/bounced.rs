//! Light that is reflected inside a captured slab before it leaves.
//!
//! The paper counts it as part of the lobe, which widens the distribution of slopes. Here, two Beckmann faces whose variances
//! are those of a fitted model stand for the slab. Their light of inner reflections is taken from the photographs before the
//! model is fitted again, and added to the lobe of the captured slab.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::super::ellipse::Profile;
use super::super::inner::Inner;
use super::super::ndf::Ndf;
use super::super::optics::Optics;
use super::super::ring_table::{RINGS, RingTable, ring_taps};
use super::alpha::Fitted;
use super::fit::{Sample, View};
use super::lobe::PointModel;
use super::radiance::diffuse_part;
use crate::base::{Cancel, Result};

/// Steps of the roughness of the virtual face, of this width; a slab of roughness 0 has only straight light.
pub const ROUGHNESSES: usize = 7;
const ROUGHNESS_STEP: f64 = 0.1;
/// Steps of α, from 0 to 1.
pub const ALPHAS: usize = 5;
/// Photons per ring of each table.
const PHOTONS: usize = 2048;

/// BTDF [1/sr] of light that is reflected inside two Beckmann faces, by the roughness of the virtual face and α.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounced {
    /// Roughness by roughness, α fastest.
    tables: Vec<RingTable>,
    /// Light towards viewers on the side of the tables' first direction, under an even background of radiance 1.
    totals: Vec<[f64; RINGS]>,
}

impl Bounced {
    /// The light in slabs of index `eta`, from photons with a fixed seed.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn new(eta: f64, cancel: &Cancel) -> Result<Self> {
        Self::of_photons(eta, PHOTONS, cancel)
    }

    /// As [`Self::new`], from at most `photons` photons per ring of each table.
    fn of_photons(eta: f64, photons: usize, cancel: &Cancel) -> Result<Self> {
        let optics = Optics { eta: DVec3::splat(eta), ..Optics::default() };
        let table = |k: usize| -> Result<RingTable> {
            let roughness = ROUGHNESS_STEP * (k / ALPHAS + 1) as f64;
            let alpha = (k % ALPHAS) as f64 / (ALPHAS - 1) as f64;
            let face = |part: f64| Ndf::analytic(Profile::Beckmann, DVec2::splat(roughness * part.sqrt()), 0.0);
            let inner = Inner::new(&face(alpha), &face(1.0 - alpha), &optics, photons, 1, cancel)?;
            Ok(inner.bounced().clone())
        };
        Ok(Self::of_tables((0..ROUGHNESSES * ALPHAS).map(table).collect::<Result<_>>()?))
    }

    /// Of tables by roughness and α, α fastest.
    pub fn of_tables(tables: Vec<RingTable>) -> Self {
        Self { totals: tables.iter().map(RingTable::totals).collect(), tables }
    }

    /// The tables by roughness and α, α fastest.
    pub fn tables(&self) -> &[RingTable] {
        &self.tables
    }

    /// The table of a model.
    pub fn of_model(&self, model: &PointModel) -> RingTable {
        self.mean([(model.roughness(), model.alpha, 1.0)])
    }

    /// The sum of tables of slabs, given as roughness, α and weight.
    pub fn mean(&self, slabs: impl IntoIterator<Item = (f64, f64, f64)>) -> RingTable {
        let mut weights = vec![0.0; self.tables.len()];
        for (roughness, alpha, weight) in slabs {
            taps(roughness, alpha).into_iter().for_each(|(k, part)| weights[k] += weight * part);
        }
        let mut sum = RingTable::new(Vec::new());
        for (table, weight) in self.tables.iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
            sum.add(weight as f32, table);
        }
        sum
    }

    /// BTDF [1/sr] of a slab for a pair of directions.
    pub fn btdf(&self, roughness: f64, alpha: f64, i: DVec3, o: DVec3) -> f64 {
        taps(roughness, alpha).into_iter().map(|(k, part)| part * self.tables[k].read(i, o)).sum()
    }

    /// Light of an even background of radiance 1 that reaches a viewer on the side of the top, along `w`.
    pub fn total(&self, roughness: f64, alpha: f64, w: DVec3) -> f64 {
        let of_table = |k: usize| ring_taps(w).iter().map(|(ring, weight)| weight * self.totals[k][*ring]).sum::<f64>();
        taps(roughness, alpha).into_iter().map(|(k, part)| part * of_table(k)).sum()
    }
}

/// The four tables around a slab, with weights. Below the first step the tables fade to 0.
fn taps(roughness: f64, alpha: f64) -> [(usize, f64); 4] {
    let at = (roughness / ROUGHNESS_STEP).clamp(0.0, ROUGHNESSES as f64);
    let (upper, turn) = ((at as usize).min(ROUGHNESSES - 1), alpha.clamp(0.0, 1.0) * (ALPHAS - 1) as f64);
    let (t, low) = (at - upper as f64, (turn as usize).min(ALPHAS - 2));
    let s = turn - low as f64;
    // The row of roughness 0 has no table, and no weight.
    let (row, lower, below) = (upper * ALPHAS, upper.saturating_sub(1) * ALPHAS, if upper > 0 { 1.0 - t } else { 0.0 });
    [(lower + low, below * (1.0 - s)), (lower + low + 1, below * s), (row + low, t * (1.0 - s)), (row + low + 1, t * s)]
}

/// Light that is reflected inside a sheet of several models.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetBounces {
    pub light: Arc<Bounced>,
    /// Roughness of each model.
    roughness: Vec<f64>,
}

impl SheetBounces {
    pub fn new(light: Arc<Bounced>, models: &[PointModel]) -> Self {
        Self { light, roughness: models.par_iter().map(PointModel::roughness).collect() }
    }

    /// Roughness of a mixture of models, given as their indices and weights.
    pub fn roughness(&self, parts: impl Iterator<Item = (usize, f64)>) -> f64 {
        parts.map(|(model, weight)| weight * self.roughness[model].powi(2)).sum::<f64>().max(0.0).sqrt()
    }
}

/// The light of a table at the samples of a point, as far as it stands out from its floor: Eq. 14 has already taken the floor
/// with the diffuse part.
pub struct AboveFloor {
    table: RingTable,
    /// BTDF [1/sr].
    pub floor: f64,
}

impl AboveFloor {
    pub fn new(table: RingTable, views: &[View]) -> Self {
        let of_table = |o: DVec3, sample: &Sample| {
            // A broken sample stays broken.
            Sample { btdf: if sample.btdf.is_finite() { table.read(sample.i, o) } else { f64::NAN }, ..*sample }
        };
        let values: Vec<Vec<Sample>> =
            views.iter().map(|View { o, samples }| samples.iter().map(|at| of_table(*o, at)).collect()).collect();
        let floor = diffuse_part(&values.iter().map(Vec::as_slice).collect::<Vec<_>>());
        Self { floor, table }
    }

    /// BTDF [1/sr] at a pair of directions.
    pub fn read(&self, i: DVec3, o: DVec3) -> f64 {
        self.table.read(i, o) - self.floor
    }

    /// The samples without this light, times `scale`.
    fn removed(&self, views: &[View], scale: f64) -> Vec<View> {
        let without = |o: DVec3, sample: &Sample| Sample {
            // NaN stays NaN.
            btdf: if sample.btdf.is_nan() { f64::NAN } else { (sample.btdf - scale * self.read(sample.i, o)).max(0.0) },
            ..*sample
        };
        let view = |View { o, samples }: &View| {
            let samples = samples.iter().map(|sample| without(*o, sample)).collect();
            View { o: *o, samples }
        };
        views.iter().map(view).collect()
    }
}

/// Times that the light of inner reflections is taken away and the model fitted again.
const ROUNDS: usize = 2;

/// Fits a model to the samples without the light of inner reflections that the model itself predicts. `fit` fits samples that
/// hold none.
pub(super) fn fit_without(
    views: &[View],
    bounced: Option<&Arc<Bounced>>,
    fit: impl Fn(&[View]) -> Option<Fitted>,
) -> Option<Fitted> {
    let mut fitted = fit(views)?;
    let Some(bounced) = bounced else { return Some(fitted) };
    for _ in 0..ROUNDS {
        let light = AboveFloor::new(bounced.of_model(&fitted.model), views);
        let Some(next) = fit(&light.removed(views, fitted.scale)) else { return Some(fitted) };
        fitted = Fitted { floor: light.floor, ..next };
    }
    Some(fitted)
}

#[cfg(test)]
mod tests {
    use super::super::alpha::{FitSettings, choose_smoothness, fit_point};
    use super::super::lobe::SlopeGrid;
    use super::super::simulated::KnownPoint;
    use super::*;

    #[test]
    fn weights_of_tables_sum_to_one_and_fade_below_the_first_roughness() {
        for (roughness, alpha, sum) in
            [(0.25, 0.3, 1.0), (0.1, 0.0, 1.0), (9.0, 1.0, 1.0), (0.04, 0.5, 0.4), (0.0, 0.5, 0.0)]
        {
            let taps = taps(roughness, alpha);
            assert!((taps.iter().map(|tap| tap.1).sum::<f64>() - sum).abs() < 1e-12, "{roughness}: {taps:?}");
            assert!(taps.iter().all(|(k, weight)| *k < ROUGHNESSES * ALPHAS && *weight >= 0.0));
        }
        // Roughness 0.2 and α = 0.25 lie on a table.
        assert!(taps(0.2, 0.25).contains(&(ALPHAS + 1, 1.0)));
    }

    #[test]
    fn a_mean_of_tables_and_its_totals_are_those_of_its_slabs() {
        let table =
            |k: usize| RingTable::new((0..RingTable::LEN).map(|j| ((j * (k + 3)) as f32 * 0.1).sin() + 1.0).collect());
        let bounced = Bounced::of_tables((0..ROUGHNESSES * ALPHAS).map(table).collect());
        let (i, o) = (DVec3::new(0.5, 0.1, 0.8).normalize(), DVec3::new(-0.2, 0.3, -0.9).normalize());
        let mean = bounced.mean([(0.23, 0.4, 0.25), (0.51, 0.9, 0.75)]);
        let expected = 0.25 * bounced.btdf(0.23, 0.4, i, o) + 0.75 * bounced.btdf(0.51, 0.9, i, o);
        assert!((mean.read(i, o) - expected).abs() < 1e-5);
        let total: f64 =
            ring_taps(i).iter().map(|(ring, weight)| weight * bounced.mean([(0.3, 0.2, 1.0)]).totals()[*ring]).sum();
        assert!((bounced.total(0.3, 0.2, i) - total).abs() < 1e-4 * total);
    }

    #[test]
    fn light_that_was_reflected_inside_does_not_widen_a_captured_point() {
        let bounced = Arc::new(Bounced::of_photons(1.5, 512, &Cancel::default()).unwrap());
        let known = KnownPoint::analytic(Profile::Beckmann, DVec2::new(0.3, 0.3), 0.9).unwrap();
        let clean = vec![known.photographed(45.0, 0.0)];
        let light = AboveFloor::new(bounced.mean([(0.3, 0.9, 1.0)]), &clean);
        let with_light = |View { o, samples }: &View| View {
            o: *o,
            samples: samples
                .iter()
                .map(|sample| Sample { btdf: (sample.btdf + light.read(sample.i, *o)).max(0.0), ..*sample })
                .collect(),
        };
        let views: Vec<View> = clean.iter().map(with_light).collect();
        let error = |bounced: Option<Arc<Bounced>>| {
            let grid = SlopeGrid { side: 32, span: 1.0 };
            let settings = FitSettings { optics: known.optics.clone(), grid, smooth: 1.0, alpha: None, bounced };
            let smooth = choose_smoothness(std::slice::from_ref(&views), &settings);
            let fitted = fit_point(&views, &FitSettings { smooth, ..settings }).unwrap();
            known.error_at_new_views(|terms| fitted.scale * fitted.model.btdf(terms))
        };
        let (with, without) = (error(Some(bounced.clone())), error(None));
        println!("captured point under light reflected inside: {with:.3}, as part of the lobe: {without:.3}");
        assert!(with < 0.04 && without > 2.0 * with, "{with} {without}");
    }
}
