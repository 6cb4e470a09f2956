//! `biscale cache` shows or removes the results that are cached on disk.

use std::io::Write;

use crate::base::print_on_stderr;
use crate::cache::{Cache, MAX_BYTES, Usage, default_folder};
use anyhow::Result;
use serde::Serialize;

use super::print_json;
use super::{CacheArgs, CachingArgs};

impl CachingArgs {
    /// Opens the user's cache, or none with `--no-cache`.
    pub fn open(&self) -> Cache {
        if self.no_cache { Cache::off() } else { open() }
    }
}

/// Opens the user's cache. It is off if there is no folder for it.
pub fn open() -> Cache {
    default_folder(|name| std::env::var_os(name)).map_or_else(Cache::off, |folder| Cache::at(&folder))
}

/// Waits until the cache is written, and prints a note if writing failed.
pub fn finish(cache: &Cache, quiet: bool) {
    if let (Some(error), false) = (cache.finish(), quiet) {
        print_on_stderr(format_args!("note: the results could not be cached: {error}"));
    }
}

#[derive(Serialize)]
struct Report {
    /// Null if the cache is off.
    folder: Option<String>,
    files: usize,
    bytes: u64,
    /// Largest size of the folder.
    #[serde(rename = "most_bytes")]
    max_bytes: u64,
    /// Files that `--clear` removed.
    removed: Usage,
}

pub fn run(args: &CacheArgs) -> Result<()> {
    let cache = open();
    let removed = if args.clear { cache.clear() } else { Usage::default() };
    let Usage { files, bytes } = cache.usage();
    let folder = cache.folder().map(|folder| folder.display().to_string());
    let report = Report { folder, files, bytes, max_bytes: MAX_BYTES, removed };
    if args.json {
        return print_json(&report);
    }
    let mut out = std::io::stdout().lock();
    let Some(folder) = report.folder else {
        writeln!(out, "nothing is cached: BISCALE_CACHE is `off`, or there is no folder for the cache")?;
        return Ok(());
    };
    if args.clear {
        writeln!(out, "removed {} files, {} bytes", removed.files, removed.bytes)?;
    }
    writeln!(out, "{folder}: {files} files, {bytes} bytes of at most {MAX_BYTES}")?;
    Ok(())
}
