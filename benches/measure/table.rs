//! The output of a measurement, and the page that holds it.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Lines that a measurement prints.
#[derive(Default)]
pub struct Table {
    lines: Vec<String>,
}

impl Table {
    /// Prints a line and keeps it for the page.
    pub fn line(&mut self, line: impl Into<String>) {
        let line = line.into();
        println!("{line}");
        self.lines.push(line);
    }

    /// Returns the block that replaces the lines between the markers of a page. Markdown tables stay as they are, other
    /// lines are fenced.
    fn block(&self) -> String {
        let origin = format!("commit {}, {}", commit(), machine());
        let lines = self.lines.join("\n");
        if lines.starts_with('|') {
            format!("{lines}\n\n{origin}\n")
        } else {
            format!("```text\n{origin}\n{lines}\n```\n")
        }
    }

    /// Replaces the lines between `<!-- measure: NAME -->` and `<!-- end -->` in every page of `docs` and of
    /// `docs/measurements`, if lines were kept.
    ///
    /// # Errors
    /// An error is returned if a page cannot be read or written, or a marker has no end.
    pub fn write(&self, name: &str) -> Result<(), String> {
        if self.lines.is_empty() {
            return Ok(());
        }
        let (start, end) = (format!("<!-- measure: {name} -->\n"), "<!-- end -->");
        for path in pages()? {
            let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            let Some((before, rest)) = text.split_once(&start) else { continue };
            let Some((_, after)) = rest.split_once(end) else {
                return Err(format!("{}: found no `{end}` after `{}`", path.display(), start.trim_end()));
            };
            let page = format!("{before}{start}{}{end}{after}", self.block());
            std::fs::write(&path, page).map_err(|error| format!("{}: {error}", path.display()))?;
            println!("wrote {}", path.display());
        }
        Ok(())
    }
}

fn pages() -> Result<Vec<PathBuf>, String> {
    let mut pages = Vec::new();
    for folder in ["docs", "docs/measurements"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let entries = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        pages.extend(entries.flatten().map(|entry| entry.path()));
    }
    pages.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    pages.sort();
    Ok(pages)
}

/// Returns the hash of the commit, with a remark if files differ from it.
fn commit() -> String {
    let git = |arguments: &[&str]| -> Option<String> {
        let output = Command::new("git").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(hash) = git(&["rev-parse", "--short", "HEAD"]) else { return "unknown".to_owned() };
    let sources = ["status", "--porcelain", "--", "src", "shaders", "benches", "tests", "Cargo.toml", "Cargo.lock"];
    if git(&sources).is_some_and(|status| !status.is_empty()) { format!("{hash} with changes") } else { hash }
}

/// Returns the processor and the number of its cores.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    format!("{model}, {cores} {}", if cores == 1 { "core" } else { "cores" })
}
