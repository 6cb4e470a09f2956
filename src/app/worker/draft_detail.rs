//! The detail of drafts on the CPU while the user drags a control: as much as the time of a draft allows.

use std::time::Instant;

use crate::plan::{Preset, Settings};

use super::image_worker::ms;

/// Time limit for a draft [ms].
pub const DRAFT_MS: f64 = 45.0;
/// Time limit for a draft whose visibility stays, because only colours or materials change [ms].
pub const KEPT_SURFACE_MS: f64 = 25.0;
/// Time limit for the part that does not depend on the number of pixels: facets, visibility and table [ms].
const MATERIAL_MS: f64 = 26.0;
/// Part of this limit below which twice as many facets are expected to meet it.
const ROOM: f64 = 0.45;
/// Smallest part of a time limit that is left for shading, so that a draft can be recognised.
const MIN_SHADING: f64 = 0.3;
/// Coarser levels than the preset's number of facets; each has half as many facets as the next.
const COARSER: usize = 2;

/// A level of detail that follows the times of drafts.
#[derive(Debug, Default)]
pub struct DetailLevel {
    /// The level, from coarse to fine.
    pub index: usize,
    /// Quick drafts that remain until a level that was too slow is tried again.
    remaining: u32,
    /// Number of quick drafts required at the last such trial.
    required: u32,
}

impl DetailLevel {
    /// Chooses the next level. A draft that takes longer than `max_ms` makes it coarser, one quicker than `min_ms`, if a
    /// finer level exists, finer. A level that was too slow is tried again after a number of quick drafts that grows with
    /// each failure.
    pub fn record(&mut self, ms: f64, max_ms: f64, min_ms: Option<f64>) {
        if ms > max_ms {
            // The coarsest level stays, and no level was tried.
            let Some(coarser) = self.index.checked_sub(1) else { return };
            self.index = coarser;
            self.required = (4 * self.required).clamp(8, 1 << 20);
            self.remaining = self.required;
        } else if min_ms.is_some_and(|least| ms < least) {
            match self.remaining {
                0 => self.index += 1,
                _ => self.remaining -= 1,
            }
        }
    }
}

/// The number of facets of the next draft, from the times of those before.
#[derive(Debug)]
pub struct DraftDetail {
    /// [`COARSER`] for the preset's number of facets.
    level: DetailLevel,
}

impl Default for DraftDetail {
    fn default() -> Self {
        Self { level: DetailLevel { index: COARSER, ..DetailLevel::default() } }
    }
}

impl DraftDetail {
    /// The number of facets; `None` for those of the preset.
    pub fn facets(&self) -> Option<usize> {
        let halvings = COARSER - self.level.index;
        (halvings > 0).then(|| Settings::of_preset(Preset::Draft).facets >> halvings)
    }

    /// Records the time from a new surface to its table [ms], also of a draft that was cancelled.
    pub fn record(&mut self, material_ms: f64) {
        let has_finer = self.level.index < COARSER;
        self.level.record(material_ms, MATERIAL_MS, has_finer.then_some(ROOM * MATERIAL_MS));
    }

    /// Time that a limit leaves for the pixels of a draft that began at `start` [ms].
    pub fn shading_ms(limit: f64, start: Instant) -> f64 {
        (limit - ms(start)).max(MIN_SHADING * limit)
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
        assert_eq!(after(&[10.0; 32]), Some(512), "levels that failed are seldom tried again");
        assert_eq!(after(&[10.0]), Some(1024));
        assert_eq!(after(&[10.0]), None, "and what is quick enough becomes finer at once");
    }
}
