//! Drafts that a graphics processor makes from the tile itself, as fine as it is fast.

use std::sync::Arc;

use crate::base::Result;
use crate::pipeline::{GpuTile, Pipeline};
use crate::plan::{Preset, Settings, VisibilityAlgorithm};
use crate::scene::{LoadedScene, Quality};

use super::shared::{SmallScale, small_scale};

/// From coarse to fine; above them the scene's own quality.
const RUNGS: [Preset; 2] = [Preset::Draft, Preset::Standard];
/// Visibility and product may take so long, and leave room for those of the next rung below these: by count `standard` is up to
/// six drafts, and `fine` up to three of `standard`.
const MAX_MS: f64 = 25.0;
const MIN_MS: [f64; RUNGS.len()] = [2.0, 7.0];

/// What such drafts are made from, and how fine they are.
#[derive(Default)]
pub struct DeviceDrafts {
    last: Option<Last>,
    /// An index into [`RUNGS`], or their number for the scene's own quality.
    rung: usize,
    /// Whether there was a table, how many lobes, and the route.
    kind: Option<(bool, usize, VisibilityAlgorithm)>,
    /// Quick drafts until a rung that was too slow is tried again, and how many those were the last time.
    rest: u32,
    rested: u32,
}

struct Last {
    key: (SmallScale, usize),
    /// Absent where only the CPU makes it.
    tile: Option<Arc<GpuTile>>,
}

impl DeviceDrafts {
    /// The tile of a scene on the present rung, but no finer than the scene asks for; `None` where only the CPU makes it.
    ///
    /// # Errors
    /// As [`Pipeline::unseen`].
    pub fn tile(&mut self, loaded: &LoadedScene, pipeline: &mut Pipeline) -> Result<Option<Arc<GpuTile>>> {
        let key = (small_scale(loaded), self.rung);
        if let Some(last) = self.last.as_ref().filter(|last| last.key == key) {
            return Ok(last.tile.clone());
        }
        let made = self.make(loaded, pipeline)?;
        // What a rung costs is known of tiles of one kind only.
        let kind = made.as_ref().map(|tile| (tile.sum.nodes.is_some(), tile.sum.sum.lobe_count(), tile.plan.route));
        if kind == self.kind || self.rung == 0 {
            self.kind = kind;
            self.last = Some(Last { key, tile: made.clone() });
            return Ok(made);
        }
        *self = Self { kind, ..Self::default() };
        self.tile(loaded, pipeline)
    }

    fn make(&self, loaded: &LoadedScene, pipeline: &mut Pipeline) -> Result<Option<Arc<GpuTile>>> {
        let tile = match RUNGS.get(self.rung) {
            Some(preset) if !is_below(loaded, *preset) => pipeline.unseen(&as_preset(loaded, *preset))?,
            _ => pipeline.unseen(loaded)?,
        };
        Ok(tile.map(Arc::new))
    }

    /// `ms`: of what grows with the rung. The next edit is as fine as leaves its picture in time; a rung that did not is tried
    /// again ever more seldom.
    pub fn took(&mut self, ms: f64) {
        if ms > MAX_MS {
            self.rung = self.rung.saturating_sub(1);
            self.rested = (4 * self.rested).clamp(8, 1 << 20);
            self.rest = self.rested;
        } else if MIN_MS.get(self.rung).is_some_and(|least| ms < *least) {
            match self.rest {
                0 => self.rung += 1,
                _ => self.rest -= 1,
            }
        }
    }
}

/// The same scene at a preset, without knobs that were turned by hand.
pub fn as_preset(loaded: &LoadedScene, preset: Preset) -> LoadedScene {
    let mut draft = loaded.clone();
    let quality = &loaded.scene.quality;
    draft.scene.quality = Quality {
        preset: preset.name().to_owned(),
        seed: quality.seed,
        backend: quality.backend.clone(),
        ..Quality::default()
    };
    draft
}

/// Whether a scene asks for less than a preset.
fn is_below(loaded: &LoadedScene, preset: Preset) -> bool {
    let own = Settings::from_quality(&loaded.scene.quality);
    own.facets < Settings::of_preset(preset).facets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drafts_become_finer_while_they_are_quick_and_what_was_too_slow_is_seldom_tried_again() {
        let mut drafts = DeviceDrafts::default();
        let mut rungs = |times: &[f64]| -> Vec<usize> {
            let after = times.iter().map(|ms| {
                drafts.took(*ms);
                drafts.rung
            });
            after.collect()
        };
        assert_eq!(rungs(&[3.0, 1.0, 6.0, 1.0, 10.0, 40.0]), [0, 1, 2, 2, 2, 1], "a draft leaves less room above it");
        assert_eq!(rungs(&[1.0; 9]), [1, 1, 1, 1, 1, 1, 1, 1, 2], "it is tried again after eight");
        assert_eq!(rungs(&[40.0]), [1]);
        assert_eq!(rungs(&[1.0; 32]), [1; 32], "and then after more");
        assert_eq!(rungs(&[40.0, 40.0]), [0, 0], "the coarsest stays");
    }
}
