//! Settings that reach a target in dB or milliseconds.
//!
//! Errors of different tiles with the same settings differ by 20 dB, so the scene is measured. Its quality levels are
//! compared with a small reference, which takes seconds. No measurement is stored between runs. The choice for a PSNR
//! uses no clock and is the same on every machine.

use std::time::Instant;

use super::candidates::{Candidate, with_settings};
use super::quality_scale;
use super::target_reference::{PAIRS_SEED, TargetReference};
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
    /// Averages the errors with those on as many other pairs.
    fn averaged_with(self, (psnr_db, psnr_std_error_db, rel_l2): (f64, f64, f64)) -> Self {
        let power = |db: f64| 10_f64.powf(-0.1 * db);
        Self {
            psnr_db: -10.0 * (0.5 * (power(self.psnr_db) + power(psnr_db))).log10(),
            psnr_std_error_db: 0.5 * self.psnr_std_error_db.hypot(psnr_std_error_db),
            rel_l2: (0.5 * (self.rel_l2 * self.rel_l2 + rel_l2 * rel_l2)).sqrt(),
            ..self
        }
    }

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
                let missed =
                    if psnr_db < asked { "; no finer quality level exists, see --quality reference" } else { "" };
                let reached = if psnr_db.is_finite() { format!("{psnr_db:.1} dB") } else { "no difference".to_owned() };
                format!(
                    "asked {asked:.1} dB, got {reached} (± {psnr_std_error_db:.1} dB, {:.2} % relative L2) in {ms:.1} \
                     ms{missed}: {options}",
                    rel_l2 * 100.0
                )
            }
            Target::Milliseconds(asked) => {
                let missed = if ms > asked { "; no coarser quality level exists" } else { "" };
                format!("asked {asked:.1} ms, got {ms:.1} ms{missed}: {options}")
            }
        }
    }
}

/// Quality level that estimates peak and mean square of a scene.
const TYPICAL_LEVEL: f64 = 6.0;
/// Smallest step between quality levels above [`UNEVEN_BELOW`], where errors fall evenly.
const STEP: f64 = 0.125;
/// Quality level up to which errors fall unevenly, so that all fine steps are scanned.
const UNEVEN_BELOW: f64 = 7.0;
/// Fine steps per quality level up to [`UNEVEN_BELOW`].
const FINE_STEPS: u32 = 16;

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
    Ok(Chosen { target, scene, candidate, reached, measurements: search.measurements })
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

    /// The coarsest quality level that reaches `db`, or the best one.
    fn cheapest_with_psnr(&mut self, db: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        let coarse = self.build(TYPICAL_LEVEL, 1)?.0;
        let reference = TargetReference::new(&mut self.pipeline, self.loaded, &coarse, db, PAIRS_SEED, progress)?;
        let measure = |search: &mut Self, level: f64, progress: &mut dyn FnMut(&str)| -> Result<Measurement> {
            let (outcome, ms) = search.build(level, 1)?;
            let (psnr_db, psnr_std_error_db, rel_l2) = reference.errors(&outcome);
            let measured = Measurement { level, ms, psnr_db, rel_l2, psnr_std_error_db };
            progress(&format!("{} facets: {psnr_db:.1} dB", outcome.settings.facets));
            search.measurements.push(measured);
            Ok(measured)
        };
        let (mut level, mut best) = (0.0, measure(self, 0.0, progress)?);
        while best.safe_db() < db && level < quality_scale::FINEST {
            level = (level + 1.0).min(quality_scale::FINEST);
            best = measure(self, level, progress)?;
        }
        if best.safe_db() < db {
            // Errors need not fall with every level, so the best measurement is returned.
            let better = self.measurements.iter().copied().max_by(|a, b| a.safe_db().total_cmp(&b.safe_db()));
            return Ok(better.unwrap_or(best));
        }
        if best.level <= UNEVEN_BELOW && best.level > 0.0 {
            // With few facets, errors vary from one number of facets to the next. All fine steps are scanned, coarse
            // ones first. The first of many steps may pass by chance, so it must also pass on other pairs.
            let other = TargetReference::new(&mut self.pipeline, self.loaded, &coarse, db, PAIRS_SEED + 1, progress)?;
            let first = (best.level - 2.0).max(0.0);
            for k in 1..=3 * FINE_STEPS {
                let measured = measure(self, first + f64::from(k) / f64::from(FINE_STEPS), progress)?;
                if measured.safe_db() < db {
                    continue;
                }
                let both = measured.averaged_with(other.errors(&self.build(measured.level, 1)?.0));
                if both.safe_db() >= db || k == 3 * FINE_STEPS {
                    return Ok(both);
                }
            }
        }
        let mut step = 0.5;
        while step >= STEP && best.level > 0.0 {
            let measured = measure(self, best.level - step, progress)?;
            if measured.safe_db() >= db {
                best = measured;
            }
            step *= 0.5;
        }
        Ok(best)
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
            if low.ms > ms || quality_scale::FINEST - low.level < STEP {
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
                    (low.level + 0.3).min(quality_scale::FINEST)
                }
                Some(_) => break,
                // A step takes at least a quarter more work and at most eight times as much.
                None => (low.level + (aim / low.ms).log2().clamp(0.3, 3.0)).min(quality_scale::FINEST),
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
        assert!(first.reached.psnr_db >= 38.0 && first.reached.psnr_db < 45.0, "{:?}", first.reached);
        assert!(first.summary().contains("asked 38.0 dB, got ") && first.summary().contains("--set quality.facets="));
        let higher = chosen(Target::Psnr(50.0));
        assert!(higher.reached.level > first.reached.level);
    }

    #[test]
    fn a_budget_that_no_level_meets_takes_the_coarsest_level_and_the_summary_says_so() {
        let coarsest = chosen(Target::Milliseconds(1e-6));
        assert_eq!(coarsest.reached.level, 0.0);
        assert!(coarsest.summary().contains("no coarser quality level"), "{}", coarsest.summary());
    }

    #[test]
    fn a_larger_budget_buys_a_finer_setting() {
        // No level meets the small budget, and some level meets the large one, also on a busy machine.
        let (small, large) = (chosen(Target::Milliseconds(1e-6)), chosen(Target::Milliseconds(400.0)));
        assert!(large.reached.level > small.reached.level, "{:?} {:?}", small.measurements, large.measurements);
        assert!(large.reached.ms <= 400.0);
    }
}
