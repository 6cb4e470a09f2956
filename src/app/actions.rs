//! The actions of menus and keys, with names and shortcuts in one table.

use std::path::PathBuf;

use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

/// An action that a menu or a key starts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    New,
    Open,
    OpenFile(PathBuf),
    OpenShipped(String),
    OpenCapture,
    Reload,
    Save,
    SaveAs,
    ExportTable,
    ExportImage,
    ExportTile,
    Sweep,
    Quit,
    Undo,
    Redo,
    CopyMaterial,
    PasteMaterial,
    CopyPython,
    Vary,
    Frame,
    Exchange,
    Paint,
    Gallery,
    SceneTab,
    CostTab,
    Snapshot,
    BackToA,
    Methods,
    Pick,
    Theme,
    ZoomIn,
    ZoomOut,
    ZoomReset,
    Help,
    About,
}

/// An action with its name in menus and its shortcut.
pub struct ActionEntry {
    pub action: Action,
    pub name: &'static str,
    pub keys: Option<KeyboardShortcut>,
}

const fn entry(action: Action, name: &'static str, keys: Option<KeyboardShortcut>) -> ActionEntry {
    ActionEntry { action, name, keys }
}

const fn command(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND, key))
}

const fn shifted(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), key))
}

const fn plain(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

/// The table that menus, keys and the help window read.
pub const ENTRIES: &[ActionEntry] = &[
    entry(Action::New, "New", command(Key::N)),
    entry(Action::Open, "Open…", command(Key::O)),
    entry(Action::OpenCapture, "Open a capture folder…", None),
    entry(Action::Reload, "Reload from disk", None),
    entry(Action::Save, "Save", command(Key::S)),
    entry(Action::SaveAs, "Save as…", shifted(Key::S)),
    entry(Action::ExportTable, "Export the material…", command(Key::E)),
    entry(Action::ExportImage, "Export the image…", shifted(Key::E)),
    entry(Action::ExportTile, "Export the tile (print, fold)…", None),
    entry(Action::Sweep, "Sweep parameters…", None),
    entry(Action::Quit, "Quit", command(Key::Q)),
    entry(Action::Undo, "Undo", command(Key::Z)),
    entry(Action::Redo, "Redo", shifted(Key::Z)),
    entry(Action::CopyMaterial, "Copy material", shifted(Key::C)),
    entry(Action::PasteMaterial, "Paste material", shifted(Key::V)),
    entry(Action::CopyPython, "Copy as Python", None),
    entry(Action::Vary, "Vary…", plain(Key::V)),
    entry(Action::Frame, "Frame the object", plain(Key::F)),
    entry(Action::Exchange, "Exchange the two views", plain(Key::X)),
    entry(Action::Paint, "Paint on the tile", plain(Key::P)),
    entry(Action::Gallery, "Gallery", plain(Key::G)),
    entry(Action::SceneTab, "Parameters of the scene", plain(Key::F5)),
    entry(Action::CostTab, "Accuracy, time and effects", plain(Key::F6)),
    entry(Action::Snapshot, "Compare with the current image (A/B)", plain(Key::B)),
    entry(Action::BackToA, "Back to A", None),
    entry(Action::Methods, "Compare methods", plain(Key::M)),
    entry(Action::Pick, "Pick on the object", plain(Key::I)),
    entry(Action::Theme, "Light or dark", None),
    entry(Action::ZoomIn, "Larger interface", command(Key::Plus)),
    entry(Action::ZoomOut, "Smaller interface", command(Key::Minus)),
    entry(Action::ZoomReset, "Default interface size", command(Key::Num0)),
    entry(Action::Help, "Help and shortcuts", plain(Key::F1)),
    entry(Action::About, "About biscale", None),
];

/// Returns the table's entry of an action.
pub fn entry_of(action: &Action) -> Option<&'static ActionEntry> {
    ENTRIES.iter().find(|entry| entry.action == *action)
}

/// The action whose keys were pressed. While the user types a text, plain keys are letters and start no action.
///
/// Shortcuts with Shift are checked first, because Ctrl+S also matches Shift+Ctrl+S.
pub fn pressed(ctx: &Context) -> Option<Action> {
    let typing = ctx.text_edit_focused();
    let mut entries: Vec<&ActionEntry> = ENTRIES.iter().filter(|entry| entry.keys.is_some()).collect();
    entries.sort_by_key(|entry| std::cmp::Reverse(entry.keys.map(|keys| keys.modifiers.shift)));
    let is_pressed = |entry: &&&ActionEntry| {
        entry.keys.is_some_and(|keys| {
            let is_plain = keys.modifiers == Modifiers::NONE;
            let edits_text = matches!(entry.action, Action::Undo | Action::Redo);
            !(typing && (is_plain || edits_text)) && ctx.input_mut(|input| input.consume_shortcut(&keys))
        })
    };
    entries.iter().find(is_pressed).map(|entry| entry.action.clone())
}
