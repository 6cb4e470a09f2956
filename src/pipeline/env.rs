//! The surroundings of a stage: cancellation, the GPU, and files that were read before. None of them decides a result.

use std::any::Any;
use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::time::{Duration, SystemTime};

use glam::Vec3;

use super::stage::lock;
use crate::base::{Cancel, Result, regular_file};
use crate::brdf::MeasuredCache;
use crate::cache::{Key, KeyBuilder};
use crate::geometry::{Facets, TileMesh};
use crate::scene::{self, Pixels};
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

/// The path, time of modification and length of a file.
type FileStamp = (PathBuf, Option<SystemTime>, u64);
/// A painted image of any kind, as long as it is alive.
type AnyImage = Weak<dyn Any + Send + Sync>;

/// The surroundings of a stage. Clones share what was read.
#[derive(Debug, Clone, Default)]
pub struct Env {
    pub cancel: Cancel,
    pub(super) gpu_opener: Option<GpuOpener>,
    pub(super) gpu_forbidden: bool,
    pub(super) open_gpu: OnceLock<Option<Arc<dyn GpuAccess>>>,
    pub(super) measured: Arc<Mutex<MeasuredCache>>,
    files: Arc<Mutex<HashMap<FileStamp, Key>>>,
    images: Arc<Mutex<Vec<(AnyImage, Key)>>>,
}

/// Files of more bytes are distinguished by length and time of modification alone.
const MAX_HASHED_FILE: u64 = 1 << 30;

/// A file that was modified less than this before it was read may change again within the resolution of its time stamp.
const STAMP_RESOLUTION: Duration = Duration::from_secs(2);

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

    /// A key of a painted image's content. An image that is still alive is hashed once.
    pub(super) fn image_key<T: bytemuck::NoUninit + Send + Sync>(&self, image: &Arc<Pixels<T>>) -> Key {
        let image: Arc<dyn Any + Send + Sync> = image.clone();
        let mut images = lock(&self.images);
        images.retain(|(known, _)| known.strong_count() > 0);
        if let Some((_, key)) = images.iter().find(|(known, _)| std::ptr::addr_eq(known.as_ptr(), Arc::as_ptr(&image)))
        {
            return *key;
        }
        let Some(pixels) = image.downcast_ref::<Pixels<T>>() else { return Key::of_numbers(b"no image") };
        let mut key = KeyBuilder::of_stage("image");
        let key = key.numbers("size", &[pixels.size]).numbers("values", &pixels.values).finish();
        images.push((Arc::downgrade(&image), key));
        key
    }

    /// A key of a file's content. A file is read again only if its length or its time of modification changed.
    pub(super) fn file_key(&self, base_dir: &Path, path: &Path) -> Key {
        let unreadable = || Key::of_numbers(b"unreadable");
        if path.to_str().is_some_and(|path| path.starts_with("asset:")) {
            return Key::of_numbers(path.as_os_str().as_encoded_bytes());
        }
        let full = scene::files::resolve(base_dir, path);
        let Ok(metadata) = std::fs::metadata(&full) else { return unreadable() };
        if !metadata.is_file() {
            return unreadable();
        }
        let stamp = (full, metadata.modified().ok(), metadata.len());
        if stamp.2 > MAX_HASHED_FILE {
            return Key::of_numbers(format!("{stamp:?}").as_bytes());
        }
        if let Some(key) = lock(&self.files).get(&stamp) {
            return *key;
        }
        let Ok(bytes) = regular_file::read(&stamp.0) else { return unreadable() };
        let key = Key::of_numbers(&bytes);
        if stamp.1.and_then(|modified| modified.elapsed().ok()).is_some_and(|age| age > STAMP_RESOLUTION) {
            lock(&self.files).insert(stamp, key);
        }
        key
    }
}
