//! Drafts that a GPU computes from the tile itself, at the finest preset that meets the time limit.

use std::sync::Arc;

use crate::base::Result;
use crate::pipeline::{GpuTile, Pipeline};
use crate::plan::{Preset, Settings, VisibilityAlgorithm};
use crate::scene::{LoadedScene, Quality};

use super::draft_detail::DetailLevel;
use super::shared::{SmallScale, small_scale};

/// Presets from coarse to fine. The next finer step is the scene's own quality.
const PRESETS: [Preset; 2] = [Preset::Draft, Preset::Standard];
/// Time limit for visibility and facet sum [ms]. A slower draft lowers the preset.
const MAX_MS: f64 = 25.0;
/// Time per preset below which the next finer one usually meets the limit [ms]: it takes up to three times as long after
/// `draft`, and two to seven times after `standard`.
const MIN_MS: [f64; PRESETS.len()] = [8.0, 7.0];

/// The tile of the last draft, and the current level of quality.
#[derive(Default)]
pub struct GpuDrafts {
    last: Option<Last>,
    /// Index into [`PRESETS`], or their number for the scene's own quality.
    level: DetailLevel,
    /// Presence of a table, number of lobes, and visibility algorithm of the last tile.
    kind: Option<(bool, usize, VisibilityAlgorithm)>,
}

struct Last {
    key: (SmallScale, usize),
    /// Absent if only the CPU can compute it.
    tile: Option<Arc<GpuTile>>,
}

impl GpuDrafts {
    /// The tile of a scene at the current level, at most as fine as the scene's own quality. Returns `None` if only the
    /// CPU can compute the tile.
    ///
    /// # Errors
    /// Returns the errors of [`Pipeline::gpu_tile`].
    pub fn tile(&mut self, loaded: &LoadedScene, pipeline: &mut Pipeline) -> Result<Option<Arc<GpuTile>>> {
        let key = (small_scale(loaded), self.level.index);
        if let Some(last) = self.last.as_ref().filter(|last| last.key == key) {
            return Ok(last.tile.clone());
        }
        let tile = self.build(loaded, pipeline)?;
        // The cost of a level is comparable only among tiles of one kind.
        let kind =
            tile.as_ref().map(|tile| (tile.input.nodes.is_some(), tile.input.sum.lobe_count(), tile.plan.algorithm));
        if kind == self.kind || self.level.index == 0 {
            self.kind = kind;
            self.last = Some(Last { key, tile: tile.clone() });
            return Ok(tile);
        }
        *self = Self { kind, ..Self::default() };
        self.tile(loaded, pipeline)
    }

    fn build(&self, loaded: &LoadedScene, pipeline: &mut Pipeline) -> Result<Option<Arc<GpuTile>>> {
        let tile = match PRESETS.get(self.level.index) {
            Some(preset) if !is_below(loaded, *preset) => pipeline.gpu_tile(&as_preset(loaded, *preset))?,
            _ => pipeline.gpu_tile(&loaded.without_interreflection())?,
        };
        Ok(tile.map(Arc::new))
    }

    /// Chooses the level of the next draft from `ms`, the time of the work that grows with the level.
    pub fn record(&mut self, ms: f64) {
        self.level.record(ms, MAX_MS, MIN_MS.get(self.level.index).copied());
    }
}

/// A copy of the scene at a preset, without the settings that the scene overrides and without interreflection, which
/// refined images have.
pub fn as_preset(loaded: &LoadedScene, preset: Preset) -> LoadedScene {
    let mut draft = loaded.without_interreflection();
    let quality = &loaded.scene.quality;
    draft.scene.quality = Quality {
        preset: preset.name().to_owned(),
        seed: quality.seed,
        backend: quality.backend.clone(),
        ..Quality::default()
    };
    draft
}

/// Returns true if a scene requests fewer facets than a preset.
fn is_below(loaded: &LoadedScene, preset: Preset) -> bool {
    let own = Settings::from_quality(&loaded.scene.quality);
    own.facets < Settings::of_preset(preset).facets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drafts_become_finer_while_they_are_quick_and_a_level_that_was_too_slow_is_seldom_tried_again() {
        let mut drafts = GpuDrafts::default();
        let mut levels = |times: &[f64]| -> Vec<usize> {
            let after = times.iter().map(|ms| {
                drafts.record(*ms);
                drafts.level.index
            });
            after.collect()
        };
        assert_eq!(levels(&[9.0, 1.0, 6.0, 1.0, 10.0, 40.0]), [0, 1, 2, 2, 2, 1], "9 ms leave no room for `standard`");
        assert_eq!(levels(&[1.0; 9]), [1, 1, 1, 1, 1, 1, 1, 1, 2], "it is tried again after eight");
        assert_eq!(levels(&[40.0]), [1]);
        assert_eq!(levels(&[1.0; 32]), [1; 32], "and then after more");
        assert_eq!(levels(&[40.0, 40.0]), [0, 0], "the coarsest stays");
    }
}
