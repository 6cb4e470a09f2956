//! The interface of measured BRDFs, and a cache of the files already read.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use glam::Vec3;

use super::LobeAngles;
use crate::base::{InputError, Result};
use crate::cache::Key;

/// A tabulated, reciprocal BRDF.
pub trait Measured: std::fmt::Debug + Send + Sync {
    /// `f_r` [1/sr], finite and not negative; 0 if `n·i` or `n·o` is not positive.
    fn f_r(&self, angles: &LobeAngles) -> Vec3;
    /// Computes [`Measured::f_r`] of many angles, with the same bits but faster. Fills as many values as the shorter
    /// slice has.
    fn f_r_many(&self, angles: &[LobeAngles], out: &mut [Vec3]) {
        for (out, angles) in out.iter_mut().zip(angles) {
            *out = self.f_r(angles);
        }
    }
    /// Name of the source, for messages.
    fn name(&self) -> &str;
    /// Hash of everything that the values depend on.
    fn content(&self) -> Key;
    /// Quality of the file.
    fn report(&self) -> &MeasuredReport;
}

/// Quality of a measured file, for the health report.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MeasuredReport {
    /// Number of samples (RGB triples) in the file.
    pub total: usize,
    /// Number of invalid samples, with a channel that is negative, NaN or infinite.
    pub invalid_samples: usize,
    /// Relative L2 of `f(i,o) - f(o,i)` in the file; the table averages both.
    pub reciprocity_residual: f32,
    /// Relative L2, cosine-weighted, of the table against exact evaluation of the file at random directions; 0 if the
    /// table has the file's own samples.
    pub resampling_error: f32,
    /// Largest directional albedo of any channel up to 80°; a material with an albedo above 1 creates energy.
    pub max_albedo: f32,
}

/// Formats of measured files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeasuredKind {
    Merl,
    Rgl,
    Utia,
    Npz,
}

/// Measured tables already read, by kind, path, time and size of the file. The caller owns the cache.
#[derive(Debug, Default)]
pub struct MeasuredCache {
    tables: HashMap<FileKey, Arc<dyn Measured>>,
}

/// Identity of a file; a changed file has another time or size.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct FileKey {
    kind: MeasuredKind,
    path: PathBuf,
    modified: Option<SystemTime>,
    len: u64,
}

impl MeasuredCache {
    /// Returns the table of a file. The file is read if it is new or has changed.
    pub fn load(&mut self, kind: MeasuredKind, path: &Path) -> Result<Arc<dyn Measured>> {
        let metadata = std::fs::metadata(path)
            .map_err(|error| InputError::new("", error, "a measured BRDF that can be read").in_file(path))?;
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
