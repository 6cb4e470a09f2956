//! The edited document: a scene, painted images, file paths and history. This module is independent of the window.

mod files;
mod history;
mod images;
mod naming;
mod recovery;
mod settings;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::base::Result;
use crate::scene;
use crate::scene::{LoadedScene, Painted, Scene};

use files::FileStamp;
pub use files::{make_absolute, write_colors, write_heights, write_slots};
pub use history::{Change, ImagePatch};
pub use recovery::{RecoveredDocument, RecoveryFile, Snapshot};
pub use settings::EditorSettings;

use history::{History, State};

/// Maximum memory of a document's history [bytes].
const HISTORY_BYTES: usize = 64 << 20;

/// An open scene with its painted images, paths and history.
#[derive(Debug)]
pub struct Document {
    state: State,
    history: History,
    /// Folder that relative paths of the scene refer to.
    pub base_dir: PathBuf,
    /// File of the scene, if it has one.
    pub path: Option<PathBuf>,
    /// Stem of the file, or the name of the shipped scene.
    pub name: String,
    /// Identifier of the saved state.
    saved: Option<u64>,
    /// The state when the document was opened.
    opened: State,
    /// Stamp of the file when it was last read or written.
    stamp: Option<FileStamp>,
    version: u64,
}

impl Document {
    /// Makes a document of a loaded scene. `path` is its file, if it has one.
    pub fn new(loaded: LoadedScene, path: Option<PathBuf>) -> Self {
        let LoadedScene { scene, base_dir, name, painted } = loaded;
        let stamp = path.as_deref().and_then(FileStamp::of);
        let history = History::new(HISTORY_BYTES);
        let saved = Some(history.state());
        let state = State { scene: Arc::new(scene), painted };
        Self { opened: state.clone(), state, history, base_dir, path, name, saved, stamp, version: 1 }
    }

    /// Opens a scene file, a shipped scene by name, or standard input (`-`). Only a scene file has a path.
    pub fn open(path_or_name: &str) -> Result<Self> {
        let loaded = scene::open_argument(path_or_name, &[])?;
        let path = Path::new(path_or_name);
        Ok(Self::new(loaded, path.is_file().then(|| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))))
    }

    /// The file or the shipped name that holds the scene; `None` if neither does. A shipped scene may have another view.
    pub fn base_name(&self) -> Option<String> {
        match &self.path {
            Some(path) if !self.is_dirty() => path.to_str().map(str::to_owned),
            None if !self.has_work() => scene::shipped::names().find(|name| *name == self.name).map(str::to_owned),
            _ => None,
        }
    }

    pub fn scene(&self) -> &Arc<Scene> {
        &self.state.scene
    }

    pub fn painted(&self) -> &Painted {
        &self.state.painted
    }

    /// Returns the scene as the stages of the pipeline read it.
    pub fn loaded(&self) -> LoadedScene {
        LoadedScene {
            scene: (*self.state.scene).clone(),
            base_dir: self.base_dir.clone(),
            name: self.name.clone(),
            painted: self.state.painted.clone(),
        }
    }

    /// Sets the version, so that it follows the versions of the previous document.
    pub fn start_at(&mut self, version: u64) {
        self.version = version;
    }

    /// Version of the document, which grows with every change.
    pub fn version(&self) -> u64 {
        self.version
    }

    pub fn is_dirty(&self) -> bool {
        self.saved != Some(self.history.state())
    }

    /// Returns true if closing the document would lose work. Turning a shipped scene or its light is not work.
    pub fn has_work(&self) -> bool {
        self.is_dirty() && (self.path.is_some() || self.saved.is_none() || !self.is_unchanged_except_view())
    }

    fn is_unchanged_except_view(&self) -> bool {
        let mut original = (*self.opened.scene).clone();
        original.camera.clone_from(&self.state.scene.camera);
        original.light.rotation_deg = self.state.scene.light.rotation_deg;
        original == *self.state.scene && self.opened.painted == self.state.painted
    }

    /// Applies an edited scene. The name of the history entry is the first difference. Consecutive edits of one control
    /// form one entry until [`Document::rest`].
    pub fn edit(&mut self, scene: Scene) {
        if *self.state.scene != scene {
            let name = naming::name_of_edit(&self.state.scene, &scene);
            self.edit_as(&name, scene);
        }
    }

    /// Applies an edited scene under the given entry name.
    pub fn edit_as(&mut self, name: &str, scene: Scene) {
        let after = Arc::new(scene);
        let before = std::mem::replace(&mut self.state.scene, after.clone());
        let mut changes = self.dropped_images(&before, &after);
        changes.insert(0, Change::Scene { before, after });
        self.history.push(name, changes);
        self.version += 1;
    }

    /// Ends the current entry when the pointer is released. Consecutive view changes stay one entry.
    pub fn rest(&mut self) {
        if self.history.undo_name() != Some("Move the view") {
            self.history.close();
        }
    }

    pub fn undo(&mut self) -> Option<String> {
        self.step_history(|history, state| history.undo(state))
    }

    pub fn redo(&mut self) -> Option<String> {
        self.step_history(|history, state| history.redo(state))
    }

    fn step_history(&mut self, step: impl FnOnce(&mut History, &mut State) -> Option<String>) -> Option<String> {
        let name = step(&mut self.history, &mut self.state)?;
        self.version += 1;
        Some(name)
    }

    pub fn undo_name(&self) -> Option<&str> {
        self.history.undo_name()
    }

    pub fn redo_name(&self) -> Option<&str> {
        self.history.redo_name()
    }

    #[cfg(test)]
    pub fn history(&self) -> &History {
        &self.history
    }

    fn push(&mut self, name: &str, changes: Vec<Change>) {
        self.history.close();
        self.history.push(name, changes);
        self.history.close();
        self.version += 1;
    }
}
