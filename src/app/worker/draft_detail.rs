//! The detail of drafts on the CPU: as much as the time of a picture under the hand allows.

use std::time::Instant;

use crate::plan::{Preset, Settings};

use super::image_worker::ms;

/// Time limit for a draft [ms].
const DRAFT_MS: f64 = 45.0;
/// Time limit for the part that does not depend on the number of pixels: facets, visibility and table [ms].
const MATERIAL_MS: f64 = 26.0;
/// Least time for shading [ms], so that a picture can be recognised.
const MIN_SHADING_MS: f64 = 14.0;
/// A level has half as many facets as the one before.
const LEVELS: u32 = 3;
/// Quick drafts after which a finer level is tried.
const QUICK_DRAFTS: u32 = 6;

/// The number of facets of the next draft, from the times of those before.
#[derive(Debug, Default)]
pub struct DraftDetail {
    level: u32,
    quick: u32,
}

impl DraftDetail {
    /// The number of facets; `None` for those of the preset.
    pub fn facets(&self) -> Option<usize> {
        (self.level > 0).then(|| Settings::of_preset(Preset::Draft).facets >> self.level)
    }

    /// Records the time of a material that was computed anew [ms].
    pub fn record(&mut self, material_ms: f64) {
        self.quick = if material_ms < MATERIAL_MS / 3.0 { self.quick + 1 } else { 0 };
        if material_ms > MATERIAL_MS {
            self.level = (self.level + 1).min(LEVELS - 1);
        } else if self.quick >= QUICK_DRAFTS {
            (self.level, self.quick) = (self.level.saturating_sub(1), 0);
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
        assert_eq!(after(&[5.0; 6]), Some(1024));
        assert_eq!(after(&[5.0; 6]), None);
    }
}
