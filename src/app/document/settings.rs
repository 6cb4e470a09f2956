//! Settings that the editor stores between runs, in one file that is replaced atomically.

use std::path::{Path, PathBuf};

use crate::base::{regular_file, replace_file};
use serde::{Deserialize, Serialize};

/// Maximum number of recent files.
const MAX_RECENT: usize = 10;

/// The stored settings. A missing or damaged file gives the defaults, so that the editor always starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EditorSettings {
    pub dark: bool,
    /// Scale of the whole interface.
    pub zoom: f32,
    pub window: [f32; 2],
    pub recent: Vec<PathBuf>,
    /// Folder of the last chosen file.
    pub files: Option<PathBuf>,
    pub gallery: bool,
    pub gallery_width: f32,
    pub parameters_width: f32,
    pub side_width: f32,
    /// True once the user has closed the first-steps card.
    pub welcomed: bool,
}

impl Default for EditorSettings {
    fn default() -> Self {
        Self {
            dark: true,
            zoom: 1.0,
            window: [1440.0, 900.0],
            recent: Vec::new(),
            files: None,
            gallery: true,
            gallery_width: 132.0,
            parameters_width: 348.0,
            side_width: 372.0,
            welcomed: false,
        }
    }
}

impl EditorSettings {
    /// Returns the user's folder for application state, by the convention of the system.
    pub fn folder() -> Option<PathBuf> {
        let var = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let base = if cfg!(windows) {
            var("APPDATA")
        } else if cfg!(target_os = "macos") {
            var("HOME").map(|home| home.join("Library/Application Support"))
        } else {
            var("XDG_STATE_HOME").or_else(|| var("HOME").map(|home| home.join(".local/state")))
        };
        base.map(|base| base.join("biscale"))
    }

    pub fn load(folder: Option<&Path>) -> Self {
        let text = folder.and_then(|folder| regular_file::read(&folder.join("editor.toml")).ok());
        let mut settings: Self = text.and_then(|text| toml::from_slice(&text).ok()).unwrap_or_default();
        settings.zoom = if settings.zoom.is_finite() { settings.zoom.clamp(0.5, 3.0) } else { 1.0 };
        settings.window = settings.window.map(|side| if side.is_finite() { side.clamp(640.0, 8192.0) } else { 1000.0 });
        settings
    }

    /// Writes the settings. Errors are ignored, because only conveniences are lost.
    pub fn save(&self, folder: Option<&Path>) {
        if let (Some(folder), Ok(text)) = (folder, toml::to_string(self)) {
            let _ = std::fs::create_dir_all(folder);
            let _ = replace_file(&folder.join("editor.toml"), text.as_bytes());
        }
    }

    pub fn add_recent(&mut self, path: &Path) {
        self.recent.retain(|other| other != path);
        self.recent.insert(0, path.to_owned());
        self.recent.truncate(MAX_RECENT);
    }
}
