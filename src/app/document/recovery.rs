//! The recovery file: what was not saved, kept beside the settings until the document is saved or closed.

use std::fs;
use std::path::{Path, PathBuf};

use crate::base::{Error, Result, replace_file};
use crate::scene;
use crate::scene::{LoadedScene, Painted};
use serde::{Deserialize, Serialize};

use super::Document;

/// What a recovery needs to know besides the scene.
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

/// The place of this process' recovery file. Removed when it goes: what is left behind was left by a crash.
#[derive(Debug)]
pub struct RecoveryFile {
    stem: PathBuf,
}

impl RecoveryFile {
    pub fn new(folder: &Path) -> Self {
        Self { stem: folder.join(format!("recovery-{}", std::process::id())) }
    }

    /// Everything needed to write, apart from the document: may go to another thread.
    ///
    /// # Errors
    /// A scene that cannot be written as text.
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

    /// Nothing is unsaved any more.
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

/// A document at one moment.
#[derive(Debug)]
pub struct Snapshot {
    stem: PathBuf,
    header: Header,
    painted: Painted,
}

impl Snapshot {
    /// # Errors
    /// A place that cannot be written; what was recovered before stays.
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

/// What a process that is gone left behind.
#[derive(Debug, Clone)]
pub struct Recovered {
    stem: PathBuf,
    pub name: String,
    header: Header,
}

impl Recovered {
    /// What lies in `folder` from processes that do not live any more.
    pub fn find(folder: &Path) -> Vec<Self> {
        let files = fs::read_dir(folder).into_iter().flatten().flatten();
        let stems = files.filter_map(|file| {
            let path = file.path();
            let stem = path.file_name()?.to_str()?.strip_suffix(".toml")?;
            let process: u32 = stem.strip_prefix("recovery-")?.parse().ok()?;
            (process != std::process::id() && !lives(process)).then(|| path.with_file_name(stem))
        });
        let open = |stem: PathBuf| {
            let text = fs::read_to_string(with(&stem, ".toml")).ok()?;
            let header: Header = toml::from_str(&text).ok()?;
            Some(Self { stem, name: header.name.clone(), header })
        };
        stems.filter_map(open).collect()
    }

    /// The document as it was; it counts as unsaved.
    ///
    /// # Errors
    /// A recovery file that is damaged.
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
        // Not there is as good as gone.
        let _ = fs::remove_file(with(stem, suffix));
    }
}

/// Whether an editor of this number is there; where that cannot be asked, it is taken as gone. One that has ended and that
/// nobody has taken note of yet is gone, and so is one whose number another program has now.
fn lives(process: u32) -> bool {
    let stat = |of: &str| fs::read_to_string(format!("/proc/{of}/stat")).ok();
    let (Some(its), Some(ours)) = (stat(&process.to_string()), stat("self")) else { return false };
    let (Some(its), Some(ours)) = (name_and_state(&its), name_and_state(&ours)) else { return false };
    its.0 == ours.0 && !matches!(its.1, 'Z' | 'X')
}

/// Of a line of `/proc/*/stat`: `4194 (bi) scale) S ...`.
fn name_and_state(stat: &str) -> Option<(&str, char)> {
    let (name, rest) = stat.split_once('(')?.1.rsplit_once(')')?;
    Some((name, rest.trim_start().chars().next()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_lives_and_one_that_ended_or_is_another_program_does_not() {
        assert_eq!(name_and_state("4194 (bi) scale) S 1 4194"), Some(("bi) scale", 'S')));
        if cfg!(target_os = "linux") {
            assert!(lives(std::process::id()));
            let mut other = std::process::Command::new("sleep").arg("60").spawn().unwrap();
            assert!(!lives(other.id()), "not an editor");
            other.kill().unwrap();
            other.wait().unwrap();
        }
        assert!(!lives(4_194_399));
    }
}
