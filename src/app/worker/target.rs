//! Settings that reach a target, searched in the background as `biscale eval` does for its targets.

use std::sync::Arc;

use crate::base::{Cancel, Error, Result};
use crate::scene::LoadedScene;
use crate::tuning::choose::{Chosen, Target, choose};

use super::runner::JobContext;

/// A scene and the target of its settings.
#[derive(Debug, Clone)]
pub struct TargetJob {
    /// Number of the search, which its results repeat.
    pub serial: u64,
    pub loaded: Arc<LoadedScene>,
    pub target: Target,
}

/// A report of a search.
#[derive(Debug, Clone)]
pub struct TargetResult {
    /// `None` after a fault in the program.
    pub serial: Option<u64>,
    pub news: TargetNews,
}

#[derive(Debug, Clone)]
pub enum TargetNews {
    /// The last step of the search in words.
    Step(String),
    Found(Box<FoundSettings>),
    Failed(String),
}

/// The settings that a search chose.
#[derive(Debug, Clone)]
pub struct FoundSettings {
    pub chosen: Chosen,
    /// PSNR that the result states for itself [dB], if the search was for a time.
    pub stated_db: Option<f64>,
}

/// Runs a search.
pub fn work(job: &TargetJob, context: &JobContext<TargetJob>, report: &dyn Fn(TargetResult)) {
    let send = |news| report(TargetResult { serial: Some(job.serial), news });
    match search(job, context.cancel, |step| send(TargetNews::Step(step.to_owned()))) {
        Ok(found) => send(TargetNews::Found(Box::new(found))),
        Err(Error::Cancelled) => {}
        Err(error) => send(TargetNews::Failed(error.to_string())),
    }
}

fn search(job: &TargetJob, cancel: &Cancel, progress: impl FnMut(&str)) -> Result<FoundSettings> {
    let chosen = choose(&job.loaded, job.target, cancel, progress)?;
    let stated_db = match job.target {
        Target::Psnr(_) => None,
        Target::Milliseconds(_) => {
            let mut pipeline = crate::gpu::pipeline();
            pipeline.set_cancel(cancel.clone());
            let outcome = pipeline.effective(&chosen.scene)?;
            outcome.errors_unless(cancel)?.and_then(|errors| errors.estimate().psnr_db)
        }
    };
    Ok(FoundSettings { chosen, stated_db })
}
