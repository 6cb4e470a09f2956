//! The recovery file: a copy of unsaved work, stored beside the settings until the document is saved or closed.

use std::fs;
use std::path::{Path, PathBuf};

use crate::base::{Error, Result, regular_file, replace_file};
use crate::scene;
use crate::scene::{LoadedScene, Painted};
use serde::{Deserialize, Serialize};

use super::Document;

/// Contents of the recovery file besides the painted images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Header {
    name: String,
    base_dir: PathBuf,
    path: Option<PathBuf>,
    heights: bool,
    colors: bool,
    #[serde(default)]
    slots: bool,
    scene: String,
}

/// The recovery file of this process. Dropping it removes the file, so a remaining file stems from a crash.
#[derive(Debug)]
pub struct RecoveryFile {
    stem: PathBuf,
}

impl RecoveryFile {
    pub fn new(folder: &Path) -> Self {
        Self { stem: folder.join(format!("recovery-{}", std::process::id())) }
    }

    /// Copies the document into a snapshot, which another thread can write.
    ///
    /// # Errors
    /// Returns an error if the scene cannot be written as text.
    pub fn prepare(&self, document: &Document) -> Result<Snapshot> {
        let painted = document.painted();
        let header = Header {
            name: document.name.clone(),
            base_dir: document.base_dir.clone(),
            path: document.path.clone(),
            heights: painted.heights.is_some(),
            colors: painted.colors.is_some(),
            slots: painted.slots.is_some(),
            scene: document.scene().to_toml()?,
        };
        Ok(Snapshot { stem: self.stem.clone(), header, painted: painted.clone() })
    }

    /// Removes the file, because nothing is unsaved.
    pub fn clear(&self) {
        discard(&self.stem);
    }
}

impl Drop for RecoveryFile {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.clear();
        }
    }
}

/// A copy of a document at one time.
#[derive(Debug)]
pub struct Snapshot {
    stem: PathBuf,
    header: Header,
    painted: Painted,
}

impl Snapshot {
    /// Writes the snapshot.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written. The previous snapshot then remains.
    pub fn write(&self) -> Result<()> {
        if let Some(folder) = self.stem.parent() {
            fs::create_dir_all(folder).map_err(Error::failed)?;
        }
        if let Some(heights) = &self.painted.heights {
            super::files::write_heights(heights, &with(&self.stem, "_heights.exr"))?;
        }
        if let Some(colors) = &self.painted.colors {
            super::files::write_colors(colors, &with(&self.stem, "_colors.exr"))?;
        }
        if let Some(slots) = &self.painted.slots {
            super::files::write_slots(slots, &with(&self.stem, "_materials.png"))?;
        }
        let text = toml::to_string(&self.header).map_err(Error::failed)?;
        replace_file(&with(&self.stem, ".toml"), text.as_bytes())
    }
}

/// A document that an ended process left behind.
#[derive(Debug, Clone)]
pub struct RecoveredDocument {
    stem: PathBuf,
    pub name: String,
    header: Header,
}

impl RecoveredDocument {
    /// Finds the recovery files of ended processes in `folder`.
    pub fn find(folder: &Path) -> Vec<Self> {
        let files = fs::read_dir(folder).into_iter().flatten().flatten();
        let stems = files.filter_map(|file| {
            let path = file.path();
            let stem = path.file_name()?.to_str()?.strip_suffix(".toml")?;
            let process: u32 = stem.strip_prefix("recovery-")?.parse().ok()?;
            (process != std::process::id() && !is_running_editor(process)).then(|| path.with_file_name(stem))
        });
        let open = |stem: PathBuf| {
            let text = regular_file::read(&with(&stem, ".toml")).ok()?;
            let header: Header = toml::from_slice(&text).ok()?;
            Some(Self { stem, name: header.name.clone(), header })
        };
        stems.filter_map(open).collect()
    }

    /// Restores the document, which counts as unsaved.
    ///
    /// # Errors
    /// Returns an error if the recovery file is damaged.
    pub fn restore(&self) -> Result<Document> {
        let scene = scene::parse(&self.header.scene)?;
        let image = |suffix: &str| with(&self.stem, suffix);
        let mut painted = Painted::default();
        if self.header.heights {
            let file = image("_heights.exr");
            painted.heights = Some(crate::geometry::image_file::read_heights(Path::new(""), &file)?.into());
        }
        if self.header.colors {
            let file = image("_colors.exr");
            painted.colors = Some(crate::geometry::image_file::read_colors(Path::new(""), &file)?.into());
        }
        if self.header.slots {
            let file = image("_materials.png");
            painted.slots = Some(crate::geometry::image_file::read_slots(Path::new(""), &file)?.into());
        }
        let loaded = LoadedScene { scene, base_dir: self.header.base_dir.clone(), name: self.name.clone(), painted };
        let mut document = Document::new(loaded, self.header.path.clone());
        document.saved = None;
        Ok(document)
    }

    pub fn discard(&self) {
        discard(&self.stem);
    }
}

fn with(stem: &Path, suffix: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

fn discard(stem: &Path) {
    for suffix in [".toml", "_heights.exr", "_colors.exr", "_materials.png"] {
        // A missing file is not an error.
        let _ = fs::remove_file(with(stem, suffix));
    }
}

/// Returns true if the process is a running editor. A zombie process does not count, and neither does another program
/// that has the same process id. Returns false on systems without `/proc`.
fn is_running_editor(process: u32) -> bool {
    let stat = |id: &str| fs::read_to_string(format!("/proc/{id}/stat")).ok();
    let (Some(other), Some(own)) = (stat(&process.to_string()), stat("self")) else { return false };
    let (Some(other), Some(own)) = (name_and_state(&other), name_and_state(&own)) else { return false };
    other.0 == own.0 && !matches!(other.1, 'Z' | 'X')
}

/// Parses name and state from a line of `/proc/*/stat`, such as `4194 (bi) scale) S ...`.
fn name_and_state(stat: &str) -> Option<(&str, char)> {
    let (name, rest) = stat.split_once('(')?.1.rsplit_once(')')?;
    Some((name, rest.trim_start().chars().next()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_is_a_running_editor_and_an_ended_or_other_process_is_not() {
        assert_eq!(name_and_state("4194 (bi) scale) S 1 4194"), Some(("bi) scale", 'S')));
        if cfg!(target_os = "linux") {
            assert!(is_running_editor(std::process::id()));
            let mut other = std::process::Command::new("sleep").arg("60").spawn().unwrap();
            assert!(!is_running_editor(other.id()), "another program is not an editor");
            other.kill().unwrap();
            other.wait().unwrap();
        }
        assert!(!is_running_editor(4_194_399));
    }
}
