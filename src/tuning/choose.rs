//! Settings that reach a target in dB or milliseconds.
//!
//! Errors of different tiles with the same settings differ by 20 dB, so each result states its own error
//! ([`crate::effective::ErrorEstimator`]). The stated errors lead to a quality level, and a small reference corrects it.
//! Nothing is stored between runs. The choice for a PSNR uses no clock and is the same on every machine.

use std::time::Instant;

use super::candidates::{Candidate, with_settings};
use super::quality_scale::{self, FINEST};
use super::target_reference::TargetReference;
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
    /// Standard error of the PSNR [dB]. A few bright pairs may cause most of the error, and another set may lack them.
    pub psnr_std_error_db: f64,
}

impl Measurement {
    /// PSNR that other pairs reach in two of three cases [dB].
    fn safe_db(&self) -> f64 {
        self.psnr_db - 0.5 * self.psnr_std_error_db
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
    /// One line with the target, what was reached, and the command-line options that repeat the choice.
    pub fn summary(&self) -> String {
        let seed = self.scene.scene.quality.seed;
        let options = format!("{} --seed {seed}", self.candidate.cli_args());
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

/// Quality level at which a search for a PSNR begins.
const FIRST_LEVEL: f64 = 4.0;
/// PSNR that a quality level more usually gains [dB]: the error falls with about the 0.75th power of the number of facets.
const DB_PER_LEVEL: f64 = 4.5;
/// Largest step between quality levels whose stated errors are compared. Larger steps would overshoot: on smooth tiles
/// errors fall faster.
const MAX_STEP: f64 = 3.0;
/// Smallest step between quality levels.
const STEP: f64 = 0.25;
/// Largest number of quality levels that are compared with a reference.
const MAX_CHECKS: usize = 6;

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
    let scene = with_settings(loaded, &candidate)?;
    let reaches_target = match target {
        Target::Psnr(asked) => reached.psnr_db >= asked,
        Target::Milliseconds(asked) => reached.ms <= asked,
    };
    Ok(Chosen { target, scene, candidate, reached, reaches_target, measurements: search.measurements })
}

struct Search<'a> {
    loaded: &'a LoadedScene,
    pipeline: Pipeline,
    overhangs: bool,
    /// Time of the mesh, which is a part of every edit [ms].
    geometry_ms: f64,
    measurements: Vec<Measurement>,
}

impl<'a> Search<'a> {
    fn new(loaded: &'a LoadedScene, cancel: &Cancel) -> Result<Self> {
        let mut pipeline = crate::gpu::pipeline();
        pipeline.set_cancel(cancel.clone());
        let outcome = pipeline.effective(&with_settings(loaded, &quality_scale::candidate_at(0.0, false))?)?;
        let overhangs = outcome.plan.overhangs();
        let geometry_ms = outcome.times.iter().filter(|(name, _)| *name == "geometry").map(|(_, ms)| ms).sum();
        Ok(Self { loaded, pipeline, overhangs, geometry_ms, measurements: Vec::new() })
    }

    /// Computes the scene at a quality level; returns it with the milliseconds from a geometry edit.
    fn build(&mut self, level: f64, runs: usize) -> Result<(Outcome, f64)> {
        let mut scene = with_settings(self.loaded, &quality_scale::candidate_at(level, self.overhangs))?;
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
        Ok((outcome, self.geometry_ms + times[times.len() / 2]))
    }

    /// A quality level whose stated PSNR is about `db`, or the finest one, and the result there.
    fn level_by_stated_error(&mut self, db: f64, progress: &mut impl FnMut(&str)) -> Result<(f64, Outcome)> {
        let (mut level, mut low) = (FIRST_LEVEL, -MAX_STEP);
        loop {
            let outcome = self.build(level, 1)?.0;
            let stated = outcome.errors().and_then(|errors| errors.estimate().psnr_db).unwrap_or(f64::INFINITY);
            progress(&format!("{} facets: {stated:.1} dB stated", outcome.settings.facets));
            let step = ((db - stated) / DB_PER_LEVEL).clamp(-MAX_STEP, FINEST);
            // If no level is expected to reach the target, only the finest one is tried.
            let step = if level + step >= FINEST { FINEST - level } else { step.min(MAX_STEP) };
            if step.abs() <= 2.0 * STEP || level + step <= low {
                return Ok((level, outcome));
            }
            if step > 0.0 {
                low = level;
            }
            level = (level + step).clamp(0.0, FINEST);
        }
    }

    /// The coarsest quality level that was found to reach `db`, or the best one.
    fn cheapest_with_psnr(&mut self, db: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        let (mut level, outcome) = self.level_by_stated_error(db, progress)?;
        let stated = outcome.errors().and_then(|errors| errors.estimate().psnr_db).unwrap_or(db);
        let reference = TargetReference::new(&self.pipeline, self.loaded, &outcome, db.min(stated), progress)?;
        // Levels that are known to miss and to reach the target, and the best of those that miss.
        let (mut misses, mut reaches, mut best) = (-STEP, None::<Measurement>, None::<Measurement>);
        loop {
            let (outcome, ms) = self.build(level, 1)?;
            let (psnr_db, psnr_std_error_db, rel_l2) = reference.errors(&outcome);
            let measured = Measurement { level, ms, psnr_db, rel_l2, psnr_std_error_db };
            progress(&format!("{} facets: {psnr_db:.1} dB", outcome.settings.facets));
            self.measurements.push(measured);
            // Levels are multiples of the smallest step, so that nearly equal ones are not tried.
            let steps = ((db - measured.safe_db()) / (DB_PER_LEVEL * STEP)).clamp(-MAX_STEP / STEP, MAX_STEP / STEP);
            let next = level + STEP * steps.ceil();
            if measured.safe_db() >= db {
                reaches = Some(measured);
            } else {
                misses = f64::max(misses, level);
                best = best.filter(|best| best.safe_db() > measured.safe_db()).or(Some(measured));
            }
            let (least, most) = (misses + STEP, reaches.map_or(FINEST, |measured| measured.level - STEP));
            if least > most || next == level || self.measurements.len() >= MAX_CHECKS {
                return Ok(reaches.or(best).unwrap_or(measured));
            }
            level = next.clamp(least, most);
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
