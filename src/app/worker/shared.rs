//! State that the draft worker and the refining worker share.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::effective::Representation;
use crate::interreflection::InterreflectionTable;
use crate::pipeline::Outcome;
use crate::scene::{ColorMap, Effects, LoadedScene, MaterialSpec, Painted, Quality, Tile};

use super::rendered_preview::RenderedPreview;
use super::screen::Screen;

/// Inputs of an effective BRDF.
pub type SmallScale = (Tile, Option<ColorMap>, Vec<MaterialSpec>, Quality, Effects, PathBuf, Painted);

/// A final image with its scene and the size that was asked for.
pub struct FinishedPreview {
    pub loaded: Box<LoadedScene>,
    pub size: [usize; 2],
    pub preview: RenderedPreview,
    /// Warnings about the material, once they are known.
    pub warnings: Option<Vec<String>>,
}

/// State of both workers: the last BRDF at a scene's own quality, the last final image, and the available GPUs.
#[derive(Default)]
pub struct SharedState {
    pub best: Mutex<Option<(SmallScale, Outcome)>>,
    pub last: Mutex<Option<FinishedPreview>>,
    /// Empty until the window reports; a draft does not wait for it.
    pub gpu_share: OnceLock<GpuShare>,
    /// The newest version whose draft has ended.
    drafted: AtomicU64,
}

/// GPUs as the window found them.
#[derive(Clone, Default)]
pub struct GpuShare {
    /// Name of the only adapter, if it is a software adapter.
    pub only_software: Option<String>,
    /// The GPU on which the window draws.
    pub screen: Option<Screen>,
}

impl SharedState {
    /// The BRDF at the scene's own quality, if it is the last that was computed.
    pub fn known(&self, loaded: &LoadedScene) -> Option<Outcome> {
        let best = lock(&self.best);
        best.as_ref()
            .filter(|(key, _)| *key == small_scale(loaded))
            .map(|(_, outcome)| outcome.clone().for_scene(&loaded.scene))
    }

    /// The interreflection of the last BRDF at a scene's own quality, if it differs from the scene only in settings of the
    /// surface. Drafts add it while the user drags a control, so that the brightness does not jump when they are refined.
    pub fn bounced_light_like(&self, loaded: &LoadedScene) -> Option<Arc<InterreflectionTable>> {
        let best = lock(&self.best);
        let (key, outcome) = best.as_ref()?;
        let Representation::Interreflecting(_, bounced) = &outcome.brdf.representation else { return None };
        let mut like_last = small_scale(loaded);
        if like_last.0.geometry.kind() != key.0.geometry.kind() {
            return None;
        }
        like_last.0.geometry.clone_from(&key.0.geometry);
        (like_last == *key).then(|| bounced.clone())
    }

    pub fn is_drafted(&self, version: u64) -> bool {
        self.drafted.load(Ordering::Relaxed) >= version
    }

    /// Returns a guard that records the end of the version's draft when it is dropped, even if the draft failed.
    pub fn draft_guard(&self, version: u64) -> DraftGuard<'_> {
        DraftGuard(self, version)
    }
}

/// Guard of a draft in progress.
pub struct DraftGuard<'a>(&'a SharedState, u64);

impl Drop for DraftGuard<'_> {
    fn drop(&mut self) {
        self.0.drafted.fetch_max(self.1, Ordering::Relaxed);
    }
}

pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub fn small_scale(loaded: &LoadedScene) -> SmallScale {
    let scene = &loaded.scene;
    let (tile, map, materials) = (scene.tile.clone(), scene.color_map.clone(), scene.materials.clone());
    let (quality, effects) = (scene.quality.clone(), scene.effects.clone());
    (tile, map, materials, quality, effects, loaded.base_dir.clone(), loaded.painted.clone())
}
