//! The detail of drafts on the CPU while the user drags a control: as much as the time of a draft allows.

use std::time::Instant;

use crate::plan::{Preset, Settings};

use super::image_worker::ms;

/// Time limit for a draft [ms].
pub const DRAFT_MS: f64 = 45.0;
/// Time limit for the part that does not depend on the number of pixels: facets, visibility and table [ms].
const MATERIAL_MS: f64 = 26.0;
/// Part of this limit below which twice as many facets are expected to meet it.
const ROOM: f64 = 0.45;
/// Least time for shading [ms], so that a draft can be recognised.
const MIN_SHADING_MS: f64 = 14.0;
/// Each level has half as many facets as the one before.
const LEVELS: u32 = 3;
/// Number of quick drafts after which a finer level is tried. It doubles with each trial, up to a limit.
const QUICK_DRAFTS: u32 = 6;
const MOST_QUICK_DRAFTS: u32 = 96;

/// The number of facets of the next draft, from the times of those before.
#[derive(Debug)]
pub struct DraftDetail {
    level: u32,
    quick: u32,
    required: u32,
}

impl Default for DraftDetail {
    fn default() -> Self {
        Self { level: 0, quick: 0, required: QUICK_DRAFTS }
    }
}

impl DraftDetail {
    /// The number of facets; `None` for those of the preset.
    pub fn facets(&self) -> Option<usize> {
        (self.level > 0).then(|| Settings::of_preset(Preset::Draft).facets >> self.level)
    }

    /// Records the time from a new surface to its table [ms], also of a draft that was cancelled.
    pub fn record(&mut self, material_ms: f64) {
        if material_ms > MATERIAL_MS {
            self.level = (self.level + 1).min(LEVELS - 1);
            self.quick = 0;
        } else if material_ms < ROOM * MATERIAL_MS && self.level > 0 {
            self.quick += 1;
            if self.quick >= self.required {
                self.level -= 1;
                self.quick = 0;
                self.required = (2 * self.required).min(MOST_QUICK_DRAFTS);
            }
        } else {
            self.quick = 0;
        }
    }

    /// Time that is left for the pixels of a draft that began at `start` [ms].
    pub fn shading_ms(start: Instant) -> f64 {
        (DRAFT_MS - ms(start)).max(MIN_SHADING_MS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_drafts_have_fewer_facets_and_quick_ones_more_again() {
        let mut detail = DraftDetail::default();
        assert_eq!(detail.facets(), None);
        let mut after = |times: &[f64]| {
            times.iter().for_each(|ms| detail.record(*ms));
            detail.facets()
        };
        assert_eq!(after(&[20.0, 25.0]), None);
        assert_eq!(after(&[60.0]), Some(1024));
        assert_eq!(after(&[30.0, 30.0, 30.0]), Some(512), "the coarsest stays");
        assert_eq!(after(&[20.0; 20]), Some(512), "which is just quick enough");
        assert_eq!(after(&[10.0; 6]), Some(1024));
        assert_eq!(after(&[60.0]), Some(512), "the trial was too slow");
        assert_eq!(after(&[10.0; 11]), Some(512), "so that the next one comes later");
        assert_eq!(after(&[10.0]), Some(1024));
    }
}
