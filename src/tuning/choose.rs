//! Settings that reach a target in dB or milliseconds.
//!
//! Errors of different tiles with the same settings differ by 20 dB, so each result states its own error
//! ([`crate::effective::ErrorEstimator`]). The stated errors lead to a quality level, and a small reference corrects it.
//! Nothing is stored between runs. The choice for a PSNR uses no clock and is the same on every machine.

use std::time::Instant;

use super::candidates::{Candidate, with_settings};
use super::quality_scale::{self, FINEST};
use super::target_reference::{CheckedError, Peak, TargetReference};
use crate::base::{Cancel, Result};
use crate::pipeline::{Outcome, Pipeline};
use crate::scene::LoadedScene;

/// Target of a choice of settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// The cheapest settings with this PSNR of `f̄` [dB].
    Psnr(f64),
    /// The best settings that take at most this time from an edit of the geometry to the effective BRDF [ms].
    Milliseconds(f64),
}

/// Time and error of one quality level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Quality level.
    pub level: f64,
    pub ms: f64,
    /// PSNR without the error of the reference [dB]. It is infinite if there is no error or none was measured.
    pub psnr_db: f64,
    pub rel_l2: f64,
    /// Standard error of the PSNR on other pairs [dB].
    pub psnr_std_error_db: f64,
}

impl Measurement {
    /// PSNR that other pairs reach in five of six cases [dB].
    fn safe_db(&self) -> f64 {
        self.psnr_db - self.psnr_std_error_db
    }
}

/// Settings that were chosen for a target.
#[derive(Debug, Clone)]
pub struct Chosen {
    pub target: Target,
    /// The scene with the chosen settings.
    pub scene: LoadedScene,
    pub candidate: Candidate,
    /// Measurement of the chosen settings.
    pub reached: Measurement,
    /// False if no settings reach the target; these are then the closest.
    pub reaches_target: bool,
    /// All measurements, in order.
    pub measurements: Vec<Measurement>,
}

impl Chosen {
    /// The command-line options that repeat the choice.
    pub fn options(&self) -> String {
        let scene = &self.scene.scene;
        let light = scene.effects.interreflection.name();
        format!("{} --seed {} --effect interreflection={light}", self.candidate.cli_args(), scene.quality.seed)
    }

    /// One line with the target, what was reached, and the command-line options that repeat the choice.
    pub fn summary(&self) -> String {
        let options = self.options();
        let Measurement { ms, psnr_db, rel_l2, psnr_std_error_db, .. } = self.reached;
        match self.target {
            Target::Psnr(asked) => {
                let missed = if self.reaches_target { "" } else { "; no finer quality level exists" };
                let reached = if psnr_db.is_finite() { format!("{psnr_db:.1} dB") } else { "no difference".to_owned() };
                format!(
                    "asked {asked:.1} dB, got {reached} (± {psnr_std_error_db:.1} dB, {:.2} % relative L2) in {ms:.1} \
                     ms{missed}: {options}",
                    rel_l2 * 100.0
                )
            }
            Target::Milliseconds(asked) => {
                let missed = if self.reaches_target { "" } else { "; no coarser quality level exists" };
                format!("asked {asked:.1} ms, got {ms:.1} ms{missed}: {options}")
            }
        }
    }
}

/// Quality level at which a search for a PSNR begins: 2,048 facets, which show the peak.
const FIRST_LEVEL: f64 = 7.0;
/// Coarsest quality level for a PSNR: 64 facets. Six replicates of fewer than ten facets do not show the error of their sum.
const COARSEST_LEVEL: f64 = 2.0;
/// Usual gain of PSNR from one quality level to the next finer one [dB]: the error falls with about the 0.75th power of the number of facets.
const DB_PER_LEVEL: f64 = 4.5;
/// Range of this gain where two stated errors show it [dB].
const MIN_DB_PER_LEVEL: f64 = 3.0;
const MAX_DB_PER_LEVEL: f64 = 9.0;
/// Largest step between quality levels. Larger steps would overshoot: on smooth tiles errors fall faster.
const MAX_STEP: f64 = 3.0;
/// Smallest step between quality levels.
const STEP: f64 = 0.25;
/// A PSNR that exceeds the target by at most this is not lowered [dB].
const ENOUGH_DB: f64 = 3.0;
/// A stated PSNR may be below the target by this [dB]. Stated errors tend to be too large, and the check decides.
const SLACK_DB: f64 = 1.0;
/// Largest number of quality levels that state their error.
const MAX_STATED: usize = 6;
/// Largest number of quality levels that are compared with a reference.
const MAX_CHECKS: usize = 5;

/// Chooses settings for a target. `progress` receives a description of each step.
///
/// # Errors
/// Returns the errors of [`Pipeline::effective`].
pub fn choose(loaded: &LoadedScene, target: Target, cancel: &Cancel, mut progress: impl FnMut(&str)) -> Result<Chosen> {
    let mut search = Search::new(loaded, cancel)?;
    let reached = match target {
        Target::Psnr(asked) => search.cheapest_with_psnr(asked, &mut progress)?,
        Target::Milliseconds(asked) => search.finest_within(asked, &mut progress)?,
    };
    let candidate = quality_scale::candidate_at(reached.level, search.overhangs);
    let scene = with_settings(&search.loaded, &candidate)?;
    let reaches_target = match target {
        Target::Psnr(asked) => reached.psnr_db >= asked,
        Target::Milliseconds(asked) => reached.ms <= asked,
    };
    Ok(Chosen { target, scene, candidate, reached, reaches_target, measurements: search.measurements })
}

struct Search<'a> {
    /// The scene with its own decision on interreflection, so that all quality levels compute the same light.
    loaded: LoadedScene,
    cancel: &'a Cancel,
    pipeline: Pipeline,
    overhangs: bool,
    /// Time of the mesh, which is a part of every edit [ms].
    geometry_ms: f64,
    measurements: Vec<Measurement>,
    /// The last quality level that was computed, its result and its time [ms].
    last: Option<(f64, Outcome, f64)>,
}

impl<'a> Search<'a> {
    fn new(loaded: &LoadedScene, cancel: &'a Cancel) -> Result<Self> {
        let mut pipeline = crate::gpu::pipeline();
        pipeline.set_cancel(cancel.clone());
        let loaded = pipeline.with_same_light(loaded)?;
        let outcome = pipeline.effective(&with_settings(&loaded, &quality_scale::candidate_at(0.0, false))?)?;
        let overhangs = outcome.plan.overhangs();
        let geometry_ms = outcome.times.iter().filter(|(name, _)| *name == "geometry").map(|(_, ms)| ms).sum();
        Ok(Self { loaded, cancel, pipeline, overhangs, geometry_ms, measurements: Vec::new(), last: None })
    }

    /// Computes the scene at a quality level; returns it with the milliseconds from a geometry edit.
    fn build(&mut self, level: f64, runs: usize) -> Result<(Outcome, f64)> {
        if let Some((_, outcome, ms)) = self.last.as_ref().filter(|(last, ..)| *last == level && runs == 1) {
            return Ok((outcome.clone(), *ms));
        }
        let mut scene = with_settings(&self.loaded, &quality_scale::candidate_at(level, self.overhangs))?;
        let seed = scene.scene.quality.seed;
        let mut times = Vec::with_capacity(runs);
        // A different seed draws different facets. All stages after the mesh run as after an edit of the geometry.
        for run in 1..runs {
            scene.scene.quality.seed = seed ^ run as u64;
            let start = Instant::now();
            self.pipeline.effective(&scene)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        scene.scene.quality.seed = seed;
        let start = Instant::now();
        let outcome = self.pipeline.effective(&scene)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
        times.sort_by(f64::total_cmp);
        let ms = self.geometry_ms + times[times.len() / 2];
        self.last = Some((level, outcome.clone(), ms));
        Ok((outcome, ms))
    }

    /// The scene at a quality level with its stated error, and the milliseconds from a geometry edit.
    fn build_stated(&mut self, level: f64) -> Result<(Outcome, f64)> {
        let (outcome, ms) = self.build(level, 1)?;
        // Unlike a later estimate, this one can be cancelled.
        outcome.errors_unless(self.cancel)?;
        Ok((outcome, ms))
    }

    /// The coarsest quality level whose stated PSNR was found to be about `db` or more, or the finest one.
    fn level_by_stated_error(&mut self, db: f64, peak: Peak, progress: &mut impl FnMut(&str)) -> Result<f64> {
        // Levels that state less and at least the target, with what they state.
        let (mut below, mut above) = (None::<(f64, f64)>, None::<(f64, f64)>);
        let (mut level, mut db_per_level) = (FIRST_LEVEL, DB_PER_LEVEL);
        for _ in 0..MAX_STATED {
            let outcome = self.build_stated(level)?.0;
            let stated = peak.stated_db(&outcome);
            progress(&format!("{} facets: {stated:.1} dB stated", outcome.settings.facets));
            if stated < db - SLACK_DB {
                below = Some((level, stated));
            } else {
                above = Some((level, stated));
            }
            let excess = stated - db;
            let is_near = (-SLACK_DB..=ENOUGH_DB).contains(&excess);
            if is_near || level == FINEST && excess < 0.0 || level == COARSEST_LEVEL && excess > 0.0 {
                break;
            }
            if let (Some(below), Some(above)) = (below, above) {
                let slope = (above.1 - below.1) / (above.0 - below.0);
                db_per_level = slope.clamp(MIN_DB_PER_LEVEL, MAX_DB_PER_LEVEL);
            }
            // If no level is expected to reach the target, only the finest one is tried.
            let step = (0.5 * SLACK_DB - excess) / db_per_level;
            let next = if level + step >= FINEST { FINEST } else { level + step.clamp(-MAX_STEP, MAX_STEP) };
            let least = below.map_or(COARSEST_LEVEL, |(level, _)| level + STEP);
            let most = above.map_or(FINEST, |(level, _)| level - STEP);
            if least > most {
                break;
            }
            level = next.clamp(least, most);
        }
        Ok(above.map_or(level, |(level, _)| level))
    }

    /// The coarsest quality level that was found to reach `db`, or the best one.
    fn cheapest_with_psnr(&mut self, db: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        let peak = Peak::of(&self.build(FIRST_LEVEL, 1)?.0);
        let mut level = self.level_by_stated_error(db, peak, progress)?;
        let stated = peak.stated_db(&self.build_stated(level)?.0);
        let error = (peak, db.min(stated));
        let reference = TargetReference::new(&self.pipeline, &self.loaded, error, self.cancel, progress)?;
        // Levels that are known to miss and to reach the target, and the best of those that miss.
        let (mut misses, mut reaches, mut best) = (COARSEST_LEVEL - STEP, None::<Measurement>, None::<Measurement>);
        loop {
            let (outcome, ms) = self.build_stated(level)?;
            let CheckedError { psnr_db, psnr_std_error_db, rel_l2 } = reference.errors(&outcome);
            let measured = Measurement { level, ms, psnr_db, rel_l2, psnr_std_error_db };
            progress(&format!("{} facets: {psnr_db:.1} dB", outcome.settings.facets));
            self.measurements.push(measured);
            let excess = measured.safe_db() - db;
            if excess >= 0.0 {
                reaches = Some(measured);
            } else {
                misses = f64::max(misses, level);
                best = best.filter(|best| best.safe_db() > measured.safe_db()).or(Some(measured));
            }
            let (least, most) = (misses + STEP, reaches.map_or(FINEST, |measured| measured.level - STEP));
            let is_near = (0.0..=ENOUGH_DB).contains(&excess);
            if least > most || is_near || self.measurements.len() >= MAX_CHECKS {
                return Ok(reaches.or(best).unwrap_or(measured));
            }
            // Levels are multiples of the smallest step, so that nearly equal ones are not tried.
            let steps = (SLACK_DB - excess) / (DB_PER_LEVEL * STEP);
            let steps = steps.clamp(-MAX_STEP / STEP, MAX_STEP / STEP).ceil();
            level = (level + STEP * steps).clamp(least, most);
        }
    }

    /// The finest quality level that takes at most `ms`, or the coarsest one.
    fn finest_within(&mut self, ms: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        // The relative noise of long times is small, so one run suffices.
        let measure = |search: &mut Self, level: f64, progress: &mut dyn FnMut(&str)| -> Result<Measurement> {
            let runs = if ms < 2e3 { 3 } else { 1 };
            let (outcome, ms) = search.build(level, runs)?;
            progress(&format!("{} facets: {ms:.1} ms", outcome.settings.facets));
            let measured = Measurement { level, ms, psnr_db: f64::INFINITY, rel_l2: 0.0, psnr_std_error_db: 0.0 };
            search.measurements.push(measured);
            Ok(measured)
        };
        // The search aims a little below the budget, because times vary between runs.
        let aim = 0.93 * ms;
        let (mut low, mut high) = (measure(self, 0.0, progress)?, None::<Measurement>);
        let (mut level, mut restarted) = (5.0_f64, false);
        for _ in 0..MAX_TRIES {
            if low.ms > ms || FINEST - low.level < 0.5 * STEP {
                break;
            }
            let measured = measure(self, level, progress)?;
            if measured.ms <= ms {
                low = if measured.level > low.level { measured } else { low };
                if measured.ms > 0.85 * ms {
                    break;
                }
            } else {
                high = Some(measured);
            }
            level = match high {
                // Between two levels, time is a power of the number of facets.
                Some(high) if high.level - low.level > 0.06 => {
                    let slope = (high.ms / low.ms).ln() / (high.level - low.level);
                    let at = low.level + (aim / low.ms).ln() / slope.max(1e-3);
                    let margin = 0.15 * (high.level - low.level);
                    at.clamp(low.level + margin, high.level - margin)
                }
                // Other load on the machine made the times inconsistent. The search restarts at the lower level.
                Some(_) if !restarted && low.ms < 0.8 * ms => {
                    (restarted, high) = (true, None);
                    (low.level + 0.3).min(FINEST)
                }
                Some(_) => break,
                // A step takes at least a quarter more work and at most eight times as much.
                None => (low.level + (aim / low.ms).log2().clamp(0.3, 3.0)).min(FINEST),
            };
        }
        Ok(low)
    }
}

/// Largest number of quality levels that are timed for a budget.
const MAX_TRIES: usize = 10;

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(target: Target) -> Chosen {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &[]).unwrap();
        choose(&loaded, target, &Cancel::default(), |_| {}).unwrap()
    }

    #[test]
    fn a_psnr_is_reached_by_the_same_settings_each_time_and_the_summary_repeats_them() {
        let first = chosen(Target::Psnr(38.0));
        let again = chosen(Target::Psnr(38.0));
        assert_eq!(first.candidate, again.candidate);
        assert!(first.reaches_target && first.reached.psnr_db < 45.0, "{:?}", first.reached);
        assert!(first.summary().contains("asked 38.0 dB, got ") && first.summary().contains("--set quality.facets="));
        assert!(first.measurements.len() <= MAX_CHECKS);
        let higher = chosen(Target::Psnr(50.0));
        assert!(higher.reached.level > first.reached.level);
    }

    #[test]
    fn a_budget_that_no_level_meets_takes_the_coarsest_level_and_the_summary_says_so() {
        let coarsest = chosen(Target::Milliseconds(1e-6));
        assert_eq!(coarsest.reached.level, 0.0);
        assert!(!coarsest.reaches_target);
        assert!(coarsest.summary().contains("no coarser quality level"), "{}", coarsest.summary());
    }

    #[test]
    fn a_psnr_that_every_level_exceeds_takes_the_coarsest_level() {
        let loaded = crate::scene::open("table4_teapot", &[]).unwrap();
        let coarsest = choose(&loaded, Target::Psnr(10.0), &Cancel::default(), |_| {}).unwrap();
        assert!(coarsest.reaches_target && coarsest.reached.level == COARSEST_LEVEL, "{:?}", coarsest.measurements);
    }

    #[test]
    fn a_level_that_is_computed_already_keeps_its_time() {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &[]).unwrap();
        let cancel = Cancel::default();
        let mut search = Search::new(&loaded, &cancel).unwrap();
        let ms = search.build(5.0, 1).unwrap().1;
        assert_eq!(search.build(5.0, 1).unwrap().1.to_bits(), ms.to_bits());
    }

    #[test]
    fn a_psnr_that_nothing_reaches_is_tried_at_few_levels_and_the_best_is_named() {
        let best = chosen(Target::Psnr(900.0));
        assert!(!best.reaches_target && best.reached.level == FINEST, "{:?}", best.measurements);
        assert_eq!(best.measurements.len(), 1);
        assert!(best.summary().contains("; no finer quality level exists: --quality fine"), "{}", best.summary());
    }

    #[test]
    fn a_larger_budget_buys_a_finer_setting() {
        // No level meets the small budget, and some level meets the large one, also on a busy machine.
        let (small, large) = (chosen(Target::Milliseconds(1e-6)), chosen(Target::Milliseconds(400.0)));
        assert!(large.reached.level > small.reached.level, "{:?} {:?}", small.measurements, large.measurements);
        assert!(large.reached.ms <= 400.0);
    }
}
