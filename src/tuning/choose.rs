//! Settings for a person who asks for decibels or milliseconds.
//!
//! No model of scenes at large foretells an error within 3 dB: tiles with the same settings differ by 20 dB. So the scene at hand
//! is measured: rungs of the [ladder] are compared with a small reference of its own, which takes seconds, and
//! nothing is kept between runs. What a target chooses depends on no clock: it is the same on every machine.

use std::time::Instant;

use super::candidates::{Candidate, with_settings};
use super::quality_scale;
use super::small_reference::{PAIRS_SEED, SmallReference};
use crate::base::{Cancel, Result};
use crate::pipeline::{Outcome, Pipeline};
use crate::scene::LoadedScene;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// A PSNR of `f̄` [dB], as cheaply as it goes.
    Decibels(f64),
    /// The best within so many milliseconds from an edit of the geometry to the effective BRDF.
    Milliseconds(f64),
}

/// A rung that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    pub rung: f64,
    pub ms: f64,
    /// PSNR [dB], the reference's own error taken out; infinite where no error was found or none was asked for.
    pub psnr_db: f64,
    pub rel_l2: f64,
    /// One standard error of the decibels: a few bright pairs may hold most of an error, and others miss them.
    pub psnr_std_error_db: f64,
}

impl Measurement {
    /// With errors on as many other pairs.
    fn with(self, (psnr_db, psnr_std_error_db, rel_l2): (f64, f64, f64)) -> Self {
        let power = |db: f64| 10_f64.powf(-0.1 * db);
        Self {
            psnr_db: -10.0 * (0.5 * (power(self.psnr_db) + power(psnr_db))).log10(),
            psnr_std_error_db: 0.5 * self.psnr_std_error_db.hypot(psnr_std_error_db),
            rel_l2: (0.5 * (self.rel_l2 * self.rel_l2 + rel_l2 * rel_l2)).sqrt(),
            ..self
        }
    }

    /// What is reached on other pairs in two of three cases.
    fn safe_db(&self) -> f64 {
        self.psnr_db - 0.5 * self.psnr_std_error_db
    }
}

/// What was chosen.
#[derive(Debug, Clone)]
pub struct Chosen {
    pub goal: Target,
    /// The scene with the settings.
    pub scene: LoadedScene,
    pub candidate: Candidate,
    pub got: Measurement,
    pub tried: Vec<Measurement>,
}

impl Chosen {
    /// Asked, got, and the words that repeat it.
    pub fn sentence(&self) -> String {
        let seed = self.scene.scene.quality.seed;
        let words = format!("{} --seed {seed}", self.candidate.words());
        let Measurement { ms, psnr_db, rel_l2, psnr_std_error_db, .. } = self.got;
        match self.goal {
            Target::Decibels(asked) => {
                let missed =
                    if psnr_db < asked { "; nothing finer is tried here, see --quality reference" } else { "" };
                let got = if psnr_db.is_finite() { format!("{psnr_db:.1} dB") } else { "no difference".to_owned() };
                format!(
                    "asked {asked:.1} dB, got {got} (± {psnr_std_error_db:.1} dB, {:.2} % relative L2) in {ms:.1} ms{missed}: {words}",
                    rel_l2 * 100.0
                )
            }
            Target::Milliseconds(asked) => {
                let missed = if ms > asked { "; nothing is coarser" } else { "" };
                format!("asked {asked:.1} ms, got {ms:.1} ms{missed}: {words}")
            }
        }
    }
}

/// A rung that shows how bright a scene is.
const TYPICAL: f64 = 6.0;
/// Rungs are told apart this finely where errors fall evenly, and below [`JUMPING`] a rung is cut into [`SCANNED`].
const STEP: f64 = 0.125;
const JUMPING: f64 = 7.0;
const SCANNED: u32 = 16;

/// Chooses settings for `goal`; `progress` hears what is being done.
///
/// # Errors
/// As [`Pipeline::effective`].
pub fn choose(loaded: &LoadedScene, goal: Target, cancel: &Cancel, mut progress: impl FnMut(&str)) -> Result<Chosen> {
    let mut search = Search::new(loaded, cancel)?;
    let found = match goal {
        Target::Decibels(asked) => search.reach(asked, &mut progress)?,
        Target::Milliseconds(asked) => search.within(asked, &mut progress)?,
    };
    let candidate = quality_scale::rung(found.rung, search.overhangs);
    let scene = with_settings(loaded, &candidate)?;
    Ok(Chosen { goal, scene, candidate, got: found, tried: search.tried })
}

struct Search<'a> {
    loaded: &'a LoadedScene,
    pipeline: Pipeline,
    overhangs: bool,
    /// Making the mesh, which comes before every rung [ms].
    geometry_ms: f64,
    tried: Vec<Measurement>,
}

impl<'a> Search<'a> {
    fn new(loaded: &'a LoadedScene, cancel: &Cancel) -> Result<Self> {
        let mut pipeline = crate::gpu::pipeline();
        pipeline.set_cancel(cancel.clone());
        let outcome = pipeline.effective(&with_settings(loaded, &quality_scale::rung(0.0, false))?)?;
        let overhangs = outcome.plan.overhangs();
        let geometry_ms = outcome.times.iter().filter(|(name, _)| *name == "geometry").map(|(_, ms)| ms).sum();
        Ok(Self { loaded, pipeline, overhangs, geometry_ms, tried: Vec::new() })
    }

    /// The scene at a rung, and the milliseconds from a geometry edit to it.
    fn build(&mut self, rung: f64, runs: usize) -> Result<(Outcome, f64)> {
        let mut scene = with_settings(self.loaded, &quality_scale::rung(rung, self.overhangs))?;
        let seed = scene.scene.quality.seed;
        let mut times = Vec::with_capacity(runs);
        // Another seed draws other facets: all that an edit of the geometry asks for, but the mesh itself.
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

    /// The coarsest rung that reaches `db`, or the finest.
    fn reach(&mut self, db: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        let coarse = self.build(TYPICAL, 1)?.0;
        let reference = SmallReference::new(&mut self.pipeline, self.loaded, &coarse, db, PAIRS_SEED, progress)?;
        let try_at = |search: &mut Self, rung: f64, progress: &mut dyn FnMut(&str)| -> Result<Measurement> {
            let (outcome, ms) = search.build(rung, 1)?;
            let (psnr_db, psnr_std_error_db, rel_l2) = reference.errors(&outcome);
            let tried = Measurement { rung, ms, psnr_db, rel_l2, psnr_std_error_db };
            progress(&format!("{} facets: {psnr_db:.1} dB", outcome.settings.facets));
            search.tried.push(tried);
            Ok(tried)
        };
        let (mut rung, mut best) = (0.0, try_at(self, 0.0, progress)?);
        while best.safe_db() < db && rung < quality_scale::FINEST {
            rung = (rung + 1.0).min(quality_scale::FINEST);
            best = try_at(self, rung, progress)?;
        }
        if best.safe_db() < db {
            // The best there was: errors need not fall with every step.
            let better = self.tried.iter().copied().max_by(|a, b| a.safe_db().total_cmp(&b.safe_db()));
            return Ok(better.unwrap_or(best));
        }
        if best.rung <= JUMPING && best.rung > 0.0 {
            // Errors of few facets jump from one number to the next: all rungs between are looked at, coarse ones first. The
            // first of many that passes is likely to be a lucky one: it must pass on other pairs, too.
            let other = SmallReference::new(&mut self.pipeline, self.loaded, &coarse, db, PAIRS_SEED + 1, progress)?;
            let first = (best.rung - 2.0).max(0.0);
            for k in 1..=3 * SCANNED {
                let tried = try_at(self, first + f64::from(k) / f64::from(SCANNED), progress)?;
                if tried.safe_db() < db {
                    continue;
                }
                let both = tried.with(other.errors(&self.build(tried.rung, 1)?.0));
                if both.safe_db() >= db || k == 3 * SCANNED {
                    return Ok(both);
                }
            }
        }
        let mut step = 0.5;
        while step >= STEP && best.rung > 0.0 {
            let tried = try_at(self, best.rung - step, progress)?;
            if tried.safe_db() >= db {
                best = tried;
            }
            step *= 0.5;
        }
        Ok(best)
    }

    /// The finest rung that takes no more than `ms`, or the coarsest.
    fn within(&mut self, ms: f64, progress: &mut impl FnMut(&str)) -> Result<Measurement> {
        // Few runs of what takes long: noise matters less there.
        let try_at = |search: &mut Self, rung: f64, progress: &mut dyn FnMut(&str)| -> Result<Measurement> {
            let runs = if ms < 2e3 { 3 } else { 1 };
            let (outcome, ms) = search.build(rung, runs)?;
            progress(&format!("{} facets: {ms:.1} ms", outcome.settings.facets));
            let tried = Measurement { rung, ms, psnr_db: f64::INFINITY, rel_l2: 0.0, psnr_std_error_db: 0.0 };
            search.tried.push(tried);
            Ok(tried)
        };
        // Aim a little below: a time is never the same twice.
        let aim = 0.93 * ms;
        let (mut low, mut high) = (try_at(self, 0.0, progress)?, None::<Measurement>);
        let (mut rung, mut again) = (5.0_f64, false);
        for _ in 0..MAX_TRIES {
            if low.ms > ms || quality_scale::FINEST - low.rung < STEP {
                break;
            }
            let tried = try_at(self, rung, progress)?;
            if tried.ms <= ms {
                low = if tried.rung > low.rung { tried } else { low };
                if tried.ms > 0.85 * ms {
                    break;
                }
            } else {
                high = Some(tried);
            }
            rung = match high {
                // Between two, time grows as a power of the facets.
                Some(high) if high.rung - low.rung > 0.06 => {
                    let slope = (high.ms / low.ms).ln() / (high.rung - low.rung);
                    let at = low.rung + (aim / low.ms).ln() / slope.max(1e-3);
                    let margin = 0.15 * (high.rung - low.rung);
                    at.clamp(low.rung + margin, high.rung - margin)
                }
                // Times that do not fit together: other work was in the way. Once more from here.
                Some(_) if !again && low.ms < 0.8 * ms => {
                    (again, high) = (true, None);
                    (low.rung + 0.3).min(quality_scale::FINEST)
                }
                Some(_) => break,
                // Never more than eight times the work of the last at once, and at least a quarter more.
                None => (low.rung + (aim / low.ms).log2().clamp(0.3, 3.0)).min(quality_scale::FINEST),
            };
        }
        Ok(low)
    }
}

/// Rungs that are timed for a budget at most.
const MAX_TRIES: usize = 10;

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(goal: Target) -> Chosen {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &[]).unwrap();
        choose(&loaded, goal, &Cancel::default(), |_| {}).unwrap()
    }

    #[test]
    fn a_target_is_met_the_same_way_each_time_and_the_words_repeat_it() {
        let first = chosen(Target::Decibels(38.0));
        let again = chosen(Target::Decibels(38.0));
        assert_eq!(first.candidate, again.candidate);
        assert!(first.got.psnr_db >= 38.0 && first.got.psnr_db < 45.0, "{:?}", first.got);
        assert!(first.sentence().contains("asked 38.0 dB, got ") && first.sentence().contains("--set quality.facets="));
        let higher = chosen(Target::Decibels(50.0));
        assert!(higher.got.rung > first.got.rung);
    }

    #[test]
    fn a_budget_that_nothing_meets_takes_the_coarsest_and_says_so() {
        let found = chosen(Target::Milliseconds(1e-6));
        assert_eq!(found.got.rung, 0.0);
        assert!(found.sentence().contains("nothing is coarser"), "{}", found.sentence());
    }

    #[test]
    fn a_larger_budget_buys_a_finer_setting() {
        // Budgets far apart: whatever else this machine does now, one is met by nothing and the other by some rung.
        let (small, large) = (chosen(Target::Milliseconds(1e-6)), chosen(Target::Milliseconds(400.0)));
        assert!(large.got.rung > small.got.rung, "{:?} {:?}", small.tried, large.tried);
        assert!(large.got.ms <= 400.0);
    }
}
