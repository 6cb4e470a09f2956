//! Times of the start-up steps, which `biscale edit --start-times` prints.

use std::time::Instant;

use super::worker::RenderedPreview;
use crate::base::print_on_stderr;

/// Prints the start-up times on standard error, if the option is set.
#[derive(Debug, Clone, Copy, Default)]
pub struct StartTimes {
    /// Start of the program; absent without the option.
    pub since: Option<Instant>,
}

impl StartTimes {
    /// Prints the time at which a step has ended.
    pub fn note(self, step: &str) {
        if let Some(since) = self.since {
            print_on_stderr(format_args!("{:>7.1} ms  {step}", since.elapsed().as_secs_f64() * 1e3));
        }
    }
}

/// Times the first frames of a window, up to the first one with an image of the object.
pub struct FirstFrames {
    times: StartTimes,
    frames: u32,
    /// A frame had an image of the object.
    has_image: bool,
    is_reported: bool,
}

impl FirstFrames {
    pub fn new(times: StartTimes) -> Self {
        Self { times, frames: 0, has_image: false, is_reported: false }
    }

    /// Returns true if the times are printed.
    pub fn are_timed(&self) -> bool {
        self.times.since.is_some()
    }

    /// Call before a frame is laid out, when the previous frame was presented. Returns true if all times are reported.
    pub fn before(&mut self) -> bool {
        match self.frames {
            0 => self.times.note("first frame begun"),
            1 => self.times.note("first frame presented"),
            _ => {}
        }
        if self.has_image && !self.is_reported {
            self.is_reported = true;
            self.times.note("first image presented");
        }
        self.has_image
    }

    /// Returns true if the next frame reports a time, so that it has to be requested.
    pub fn needs_next_frame(&self) -> bool {
        self.frames == 1 || self.has_image
    }

    /// Call after a frame was laid out.
    pub fn after(&mut self, preview: Option<&RenderedPreview>) {
        self.frames += 1;
        if let (Some(preview), false) = (preview, self.has_image) {
            self.has_image = true;
            let stages: Vec<_> = preview.stages.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
            self.times.note(&format!("first image rendered ({:.1} ms: {})", preview.latency_ms, stages.join(", ")));
        }
    }
}
