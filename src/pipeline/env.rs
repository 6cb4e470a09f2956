//! The surroundings of a stage: cancellation, the GPU, and files that were read before. None of them decides a result.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::SystemTime;

use glam::Vec3;

use super::stage::lock;
use crate::base::{Cancel, Result};
use crate::brdf::MeasuredCache;
use crate::cache::Key;
use crate::geometry::{Facets, TileMesh};
use crate::scene;
use crate::visibility::PackedVisibility;

/// The GPU as stages use it: the only door from the pipeline to graphics code, which is a layer above.
pub trait GpuAccess: fmt::Debug + Send + Sync {
    /// Returns true if the adapter is more than software.
    fn is_hardware(&self) -> bool;

    /// Visibility of every facet along every direction, from toroidal shadow maps of `resolution` texels per side.
    ///
    /// # Errors
    /// The GPU fails, or [`crate::base::Error::Cancelled`].
    fn visibility_maps(
        &self,
        mesh: &TileMesh,
        facets: &Facets,
        directions: &[Vec3],
        resolution: u32,
        cancel: &Cancel,
    ) -> Result<PackedVisibility>;
}

/// A function that opens the GPU of the machine; `None` if there is none.
pub type GpuOpener = fn() -> Option<Arc<dyn GpuAccess>>;

/// The surroundings of a stage. Clones share what was read.
#[derive(Debug, Clone, Default)]
pub struct Env {
    pub cancel: Cancel,
    pub(super) gpu_opener: Option<GpuOpener>,
    pub(super) gpu_forbidden: bool,
    pub(super) open_gpu: OnceLock<Option<Arc<dyn GpuAccess>>>,
    pub(super) measured: Arc<Mutex<MeasuredCache>>,
    files: Arc<Mutex<HashMap<(PathBuf, Option<SystemTime>, u64), Key>>>,
}

/// Files of more bytes are refused by every reader of a scene, so that their content does not matter.
const MAX_HASHED_FILE: u64 = 1 << 30;

impl Env {
    /// Surroundings without a GPU and without files.
    pub(super) fn with_cancel(cancel: Cancel) -> Self {
        Self { cancel, ..Self::default() }
    }

    /// The GPU, if one may be used and is there. The first call opens it.
    pub(super) fn gpu(&self) -> Option<&Arc<dyn GpuAccess>> {
        if self.gpu_forbidden {
            return None;
        }
        self.open_gpu.get_or_init(|| self.gpu_opener.and_then(|open| open())).as_ref()
    }

    /// A key of a file's content. A file is read again only if its length or its time of modification changed.
    pub(super) fn file_key(&self, base_dir: &Path, path: &Path) -> Key {
        let unreadable = || Key::of_numbers(b"unreadable");
        if path.to_str().is_some_and(|path| path.starts_with("asset:")) {
            return Key::of_numbers(path.as_os_str().as_encoded_bytes());
        }
        let full = scene::files::resolve(base_dir, path);
        let Ok(metadata) = std::fs::metadata(&full) else { return unreadable() };
        if !metadata.is_file() || metadata.len() > MAX_HASHED_FILE {
            return unreadable();
        }
        let stamp = (full, metadata.modified().ok(), metadata.len());
        if let Some(key) = lock(&self.files).get(&stamp) {
            return *key;
        }
        let Ok(bytes) = std::fs::read(&stamp.0) else { return unreadable() };
        let key = Key::of_numbers(&bytes);
        lock(&self.files).insert(stamp, key);
        key
    }
}
