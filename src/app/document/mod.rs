//! What is being edited: a scene, the images painted over its files, where it is saved, and its history. No window here.

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

use files::Stamp;
pub use files::{make_absolute, write_colors, write_heights, write_slots};
pub use history::{Change, ScenePatch};
pub use recovery::{Recovered, RecoveryFile, Snapshot};
pub use settings::Settings;

use history::{History, State};

/// Bytes of undo that a document keeps.
const HISTORY_BYTES: usize = 64 << 20;

/// A scene with all that belongs to it while it is open.
#[derive(Debug)]
pub struct Document {
    state: State,
    history: History,
    /// Where relative paths of the scene start.
    pub base_dir: PathBuf,
    /// Where it was opened from or saved to.
    pub path: Option<PathBuf>,
    /// The file's stem or the shipped name.
    pub name: String,
    /// The state that is on disk.
    saved: Option<u64>,
    /// What was there at first.
    opened: State,
    /// The file as it was last read or written.
    stamp: Option<Stamp>,
    version: u64,
}

impl Document {
    /// A document of a loaded scene; `path` is its file, if it has one of its own.
    pub fn new(loaded: LoadedScene, path: Option<PathBuf>) -> Self {
        let LoadedScene { scene, base_dir, name, painted } = loaded;
        let stamp = path.as_deref().and_then(Stamp::of);
        let history = History::new(HISTORY_BYTES);
        let saved = Some(history.state());
        let state = State { scene: Arc::new(scene), painted };
        Self { opened: state.clone(), state, history, base_dir, path, name, saved, stamp, version: 1 }
    }

    /// Opens a scene file, or a shipped scene by name (which has no file of its own).
    pub fn open(what: &str) -> Result<Self> {
        let loaded = scene::open(what, &[])?;
        let path = Path::new(what);
        Ok(Self::new(loaded, path.is_file().then(|| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))))
    }

    pub fn scene(&self) -> &Arc<Scene> {
        &self.state.scene
    }

    pub fn painted(&self) -> &Painted {
        &self.state.painted
    }

    /// What the stages work on.
    pub fn loaded(&self) -> LoadedScene {
        LoadedScene {
            scene: (*self.state.scene).clone(),
            base_dir: self.base_dir.clone(),
            name: self.name.clone(),
            painted: self.state.painted.clone(),
        }
    }

    /// Counts versions on from another document's.
    pub fn start_at(&mut self, version: u64) {
        self.version = version;
    }

    /// Grows with every change.
    pub fn version(&self) -> u64 {
        self.version
    }

    pub fn is_dirty(&self) -> bool {
        self.saved != Some(self.history.state())
    }

    /// Whether something would be missed. Who only turned a shipped scene and its light has nothing to save.
    pub fn has_work(&self) -> bool {
        self.is_dirty() && (self.path.is_some() || self.saved.is_none() || !self.is_as_opened_but_for_the_view())
    }

    fn is_as_opened_but_for_the_view(&self) -> bool {
        let mut turned = (*self.opened.scene).clone();
        turned.camera.clone_from(&self.state.scene.camera);
        turned.light.rotation_deg = self.state.scene.light.rotation_deg;
        turned == *self.state.scene && self.opened.painted == self.state.painted
    }

    /// Takes the scene as the person left it, under the name of what differs. Edits of one control are one entry until
    /// [`Document::rest`].
    pub fn edit(&mut self, scene: Scene) {
        if *self.state.scene != scene {
            let name = naming::name_of_edit(&self.state.scene, &scene);
            self.edit_as(&name, scene);
        }
    }

    /// As [`Document::edit`], under a name of its own.
    pub fn edit_as(&mut self, name: &str, scene: Scene) {
        let after = Arc::new(scene);
        let before = std::mem::replace(&mut self.state.scene, after.clone());
        let mut changes = self.dropped_images(&before, &after);
        changes.insert(0, Change::Scene { before, after });
        self.history.push(name, changes);
        self.version += 1;
    }

    /// The hand rests: what follows is an entry of its own. (Views turned one after the other stay one.)
    pub fn rest(&mut self) {
        if self.history.undo_name() != Some("Move the view") {
            self.history.close();
        }
    }

    pub fn undo(&mut self) -> Option<String> {
        self.moved_in_history(|history, state| history.undo(state))
    }

    pub fn redo(&mut self) -> Option<String> {
        self.moved_in_history(|history, state| history.redo(state))
    }

    fn moved_in_history(&mut self, step: impl FnOnce(&mut History, &mut State) -> Option<String>) -> Option<String> {
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
