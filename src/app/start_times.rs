//! When the parts of a start-up were there: what `biscale edit --start-times` prints.

use std::time::Instant;

use super::worker::Made;

/// Says on standard error when things were there, where that was asked for.
#[derive(Debug, Clone, Copy, Default)]
pub struct StartTimes {
    /// When the program started; nothing is said without it.
    pub since: Option<Instant>,
}

impl StartTimes {
    /// Something is there now.
    pub fn note(self, what: &str) {
        if let Some(since) = self.since {
            eprintln!("{:>7.1} ms  {what}", since.elapsed().as_secs_f64() * 1e3);
        }
    }
}

/// Follows the first frames of a window until one with a picture of the object was handed to the screen.
pub struct FirstFrames {
    times: StartTimes,
    frames: u32,
    /// Whether a frame had a picture of the object.
    shading_brdf: bool,
    said: bool,
}

impl FirstFrames {
    pub fn new(times: StartTimes) -> Self {
        Self { times, frames: 0, shading_brdf: false, said: false }
    }

    pub fn are_followed(&self) -> bool {
        self.times.since.is_some()
    }

    /// Before a frame is laid out: by now the one before it was handed to the screen. Whether all is said.
    pub fn before(&mut self) -> bool {
        match self.frames {
            0 => self.times.note("first frame begun"),
            1 => self.times.note("first frame handed to the screen"),
            _ => {}
        }
        if self.shading_brdf && !self.said {
            self.said = true;
            self.times.note("first picture handed to the screen");
        }
        self.shading_brdf
    }

    /// Whether the next frame, which the editor may not need, is the one that says something.
    pub fn is_told_by_the_next(&self) -> bool {
        self.frames == 1 || self.shading_brdf
    }

    /// After a frame was laid out.
    pub fn after(&mut self, made: Option<&Made>) {
        self.frames += 1;
        if let (Some(made), false) = (made, self.shading_brdf) {
            self.shading_brdf = true;
            let stages: Vec<_> = made.stages.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
            self.times.note(&format!("first picture made ({:.1} ms: {})", made.latency_ms, stages.join(", ")));
        }
    }
}
