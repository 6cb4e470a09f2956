//! What the editor remembers between runs: theme, recent files, sizes. One small file, written beside and renamed.

use std::path::{Path, PathBuf};

use crate::base::replace_file;
use serde::{Deserialize, Serialize};

const RECENT: usize = 10;

/// Everything remembered. Unknown or broken files give the defaults: settings are never a reason not to start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    pub dark: bool,
    /// Scale of the whole interface.
    pub zoom: f32,
    pub window: [f32; 2],
    pub recent: Vec<PathBuf>,
    /// Where a file was chosen last.
    pub files: Option<PathBuf>,
    pub gallery: bool,
    pub gallery_width: f32,
    pub parameters_width: f32,
    pub side_width: f32,
    /// Whether the first-steps card has been closed.
    pub welcomed: bool,
}

impl Default for Settings {
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

impl Settings {
    /// The person's folder for such things, by the habit of the system.
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
        let text = folder.and_then(|folder| std::fs::read_to_string(folder.join("editor.toml")).ok());
        let mut settings: Self = text.and_then(|text| toml::from_str(&text).ok()).unwrap_or_default();
        settings.zoom = if settings.zoom.is_finite() { settings.zoom.clamp(0.5, 3.0) } else { 1.0 };
        settings.window = settings.window.map(|side| if side.is_finite() { side.clamp(640.0, 8192.0) } else { 1000.0 });
        settings
    }

    /// Failure is silent: what is lost is a convenience.
    pub fn save(&self, folder: Option<&Path>) {
        if let (Some(folder), Ok(text)) = (folder, toml::to_string(self)) {
            let _ = std::fs::create_dir_all(folder);
            let _ = replace_file(&folder.join("editor.toml"), text.as_bytes());
        }
    }

    pub fn add_recent(&mut self, path: &Path) {
        self.recent.retain(|other| other != path);
        self.recent.insert(0, path.to_owned());
        self.recent.truncate(RECENT);
    }
}
