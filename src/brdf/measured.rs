//! What every measured BRDF has in common, and the store that keeps one from being read twice.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use glam::Vec3;

use super::LobeAngles;
use crate::base::{InputError, Result};
use crate::cache::Key;

/// A tabulated BRDF, already made reciprocal.
pub trait Measured: std::fmt::Debug + Send + Sync {
    /// `f_r` [1/sr]; finite and not negative; 0 where `n·i` or `n·o` is not positive.
    fn f_r(&self, angles: &LobeAngles) -> Vec3;
    /// [`Measured::f_r`] of many angles, bit for bit; faster. Fills as many as the shorter slice has.
    fn f_r_many(&self, angles: &[LobeAngles], out: &mut [Vec3]) {
        for (out, angles) in out.iter_mut().zip(angles) {
            *out = self.f_r(angles);
        }
    }
    /// Where it came from, for messages.
    fn name(&self) -> &str;
    /// All that its values depend on, as one number.
    fn content(&self) -> Key;
    /// What reading it found.
    fn report(&self) -> &MeasuredReport;
}

/// How good a measured file was, for the health report.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MeasuredReport {
    /// Samples in the file (RGB triples).
    pub total: usize,
    /// Samples left out: negative, NaN or infinite in some channel.
    pub invalid_samples: usize,
    /// Relative L2 of `f(i,o) - f(o,i)` before it was averaged away.
    pub reciprocity_residual: f32,
    /// Relative L2 of the table against exact evaluation of the file at random directions, cosine-weighted; 0 where
    /// the table is the file.
    pub resampling_error: f32,
    /// The largest directional albedo of any channel up to 80°: above 1 the material gains energy.
    pub max_albedo: f32,
}

/// The kinds of measured file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeasuredKind {
    Merl,
    Rgl,
    Utia,
    Npz,
}

/// Measured tables already read, by kind and file as it was then. It belongs to the caller.
#[derive(Debug, Default)]
pub struct MeasuredCache {
    tables: HashMap<FileKey, Arc<dyn Measured>>,
}

/// A file changed in between is another file.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct FileKey {
    kind: MeasuredKind,
    path: PathBuf,
    modified: Option<SystemTime>,
    len: u64,
}

impl MeasuredCache {
    /// The table of a file, read if it is new or has changed.
    pub fn load(&mut self, kind: MeasuredKind, path: &Path) -> Result<Arc<dyn Measured>> {
        let metadata = std::fs::metadata(path)
            .map_err(|error| InputError::new("", error, "a measured BRDF that can be read").in_file(path))?;
        if !metadata.is_file() {
            return Err(InputError::new("", "a folder or device", "a file").in_file(path).into());
        }
        let key = FileKey { kind, path: path.to_owned(), modified: metadata.modified().ok(), len: metadata.len() };
        if let Some(table) = self.tables.get(&key) {
            return Ok(Arc::clone(table));
        }
        let table: Arc<dyn Measured> = match kind {
            MeasuredKind::Merl => Arc::new(super::merl::load(path)?),
            MeasuredKind::Rgl => Arc::new(super::rgl::load(path)?),
            MeasuredKind::Utia => Arc::new(super::utia::load(path)?),
            MeasuredKind::Npz => Arc::new(super::npz::load(path)?),
        };
        self.tables.insert(key, Arc::clone(&table));
        Ok(table)
    }
}
