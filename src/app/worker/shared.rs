//! What the two workers of pictures tell each other.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use crate::pipeline::Outcome;
use crate::scene::{Effects, LoadedScene, MaterialSpec, Painted, Quality, Tile};

use super::made::Made;
use super::screen::Screen;

/// What an effective BRDF depends on.
pub type SmallScale = (Tile, Vec<MaterialSpec>, Quality, Effects, PathBuf, Painted);

/// A full picture and what it shows.
pub type Finished = (Box<LoadedScene>, [usize; 2], Made);

/// What both workers know: the last BRDF at a scene's own quality, the last full picture, and what devices there are.
#[derive(Default)]
pub struct Shared {
    pub best: Mutex<Option<(SmallScale, Outcome)>>,
    pub last: Mutex<Option<Finished>>,
    /// Empty at first: a draft does not wait to find out.
    pub devices: OnceLock<Devices>,
    /// The newest version whose draft is done with.
    drafted: AtomicU64,
}

/// What the window knows of graphics devices.
#[derive(Clone, Default)]
pub struct Devices {
    /// There is only this adapter, which is the processor in disguise.
    pub only_software: Option<String>,
    /// What the window draws on.
    pub screen: Option<Screen>,
}

impl Shared {
    /// The BRDF at the scene's own quality, where it was the last.
    pub fn known(&self, loaded: &LoadedScene) -> Option<Outcome> {
        let best = lock(&self.best);
        best.as_ref().filter(|(key, _)| *key == small_scale(loaded)).map(|(_, outcome)| outcome.clone())
    }

    pub fn is_drafted(&self, version: u64) -> bool {
        self.drafted.load(Ordering::Relaxed) >= version
    }

    /// Notes, once it is dropped, that the draft of a version is done with, also where it failed.
    pub fn drafting(&self, version: u64) -> Drafting<'_> {
        Drafting(self, version)
    }
}

pub struct Drafting<'a>(&'a Shared, u64);

impl Drop for Drafting<'_> {
    fn drop(&mut self) {
        self.0.drafted.fetch_max(self.1, Ordering::Relaxed);
    }
}

pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub fn small_scale(loaded: &LoadedScene) -> SmallScale {
    let scene = &loaded.scene;
    let parts = (scene.tile.clone(), scene.materials.clone(), scene.quality.clone(), scene.effects.clone());
    (parts.0, parts.1, parts.2, parts.3, loaded.base_dir.clone(), loaded.painted.clone())
}
