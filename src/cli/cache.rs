//! `biscale cache`: what is kept between runs.

use std::io::Write;

use crate::cache::{Cache, MAX_BYTES, Usage, default_folder};
use anyhow::Result;
use serde::Serialize;

use super::print_json;
use super::{CacheArgs, KeepingArgs};

impl KeepingArgs {
    /// The person's cache, unless they want none.
    pub fn open(&self) -> Cache {
        if self.no_cache { Cache::off() } else { open() }
    }
}

/// The person's cache.
pub fn open() -> Cache {
    default_folder(|name| std::env::var_os(name)).map_or_else(Cache::off, |folder| Cache::at(&folder))
}

/// Waits for what is still being written, and says if it could not be.
pub fn finish(cache: &Cache, quiet: bool) {
    if let (Some(trouble), false) = (cache.finish(), quiet) {
        eprintln!("note: nothing could be kept for the next time: {trouble}");
    }
}

#[derive(Serialize)]
struct Report {
    /// Null where nothing is kept.
    folder: Option<String>,
    files: usize,
    bytes: u64,
    /// More than these are never kept.
    most_bytes: u64,
    /// What `--clear` removed.
    removed: Usage,
}

pub fn run(args: &CacheArgs) -> Result<()> {
    let cache = open();
    let removed = if args.clear { cache.clear() } else { Usage::default() };
    let Usage { files, bytes } = cache.usage();
    let folder = cache.folder().map(|folder| folder.display().to_string());
    let report = Report { folder, files, bytes, most_bytes: MAX_BYTES, removed };
    if args.json {
        return print_json(&report);
    }
    let mut out = std::io::stdout().lock();
    let Some(folder) = report.folder else {
        writeln!(out, "nothing is kept: BISCALE_CACHE is `off`, or there is no folder for it")?;
        return Ok(());
    };
    if args.clear {
        writeln!(out, "removed {} files, {} bytes", removed.files, removed.bytes)?;
    }
    writeln!(out, "{folder}: {files} files, {bytes} bytes of at most {MAX_BYTES}")?;
    Ok(())
}
