//! The menu bar.

use crate::scene::shipped;
use eframe::egui::{self, Button, MenuBar, RichText, Ui};

use super::actions::{self, Action};
use super::editor::Editor;

impl Editor {
    /// Shows the bar and returns the chosen action.
    pub(super) fn menu_ui(&mut self, ui: &mut Ui) -> Option<Action> {
        let mut chosen = None;
        MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| self.file_menu(ui, &mut chosen));
            ui.menu_button("Edit", |ui| {
                let undo = self.document.undo_name().map(str::to_owned);
                let redo = self.document.redo_name().map(str::to_owned);
                named_item(ui, Action::Undo, undo.as_deref(), &mut chosen);
                named_item(ui, Action::Redo, redo.as_deref(), &mut chosen);
                ui.separator();
                items(ui, &[Action::CopyMaterial, Action::PasteMaterial], &mut chosen);
                ui.separator();
                items(ui, &[Action::Vary, Action::CopyPython], &mut chosen);
            });
            ui.menu_button("View", |ui| {
                items(ui, &[Action::Frame, Action::Exchange, Action::Paint, Action::Gallery], &mut chosen);
                ui.separator();
                items(ui, &[Action::SceneTab, Action::CostTab], &mut chosen);
                ui.separator();
                items(ui, &[Action::Snapshot, Action::Methods, Action::Pick], &mut chosen);
                ui.separator();
                items(ui, &[Action::Theme, Action::ZoomIn, Action::ZoomOut, Action::ZoomReset], &mut chosen);
            });
            ui.menu_button("Help", |ui| items(ui, &[Action::Help, Action::About], &mut chosen));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let dirty = if self.document.is_dirty() { "• " } else { "" };
                ui.label(RichText::new(format!("{dirty}{}", self.document.name)).strong());
            });
        });
        chosen
    }

    fn file_menu(&mut self, ui: &mut Ui, chosen: &mut Option<Action>) {
        items(ui, &[Action::New, Action::Open], chosen);
        ui.menu_button("Open recent", |ui| {
            for path in &self.settings.recent {
                if ui.button(path.display().to_string()).clicked() {
                    *chosen = Some(Action::OpenFile(path.clone()));
                    ui.close();
                }
            }
            if self.settings.recent.is_empty() {
                ui.weak("No recent files");
            }
        });
        ui.menu_button("Open a shipped scene", |ui| {
            egui::ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
                for name in shipped::names() {
                    let tip = shipped::description(name).unwrap_or_default();
                    if ui.button(name).on_hover_text(tip).clicked() {
                        *chosen = Some(Action::OpenShipped(name.to_owned()));
                        ui.close();
                    }
                }
            });
        });
        items(ui, &[Action::OpenCapture], chosen);
        ui.add_enabled_ui(self.document.path.is_some(), |ui| items(ui, &[Action::Reload], chosen));
        ui.separator();
        items(ui, &[Action::Save, Action::SaveAs], chosen);
        ui.separator();
        items(ui, &[Action::ExportTable, Action::ExportTile, Action::ExportImage, Action::Sweep], chosen);
        ui.separator();
        items(ui, &[Action::Quit], chosen);
    }
}

fn items(ui: &mut Ui, list: &[Action], chosen: &mut Option<Action>) {
    for action in list {
        if let Some(entry) = actions::entry_of(action) {
            item(ui, entry.name.to_owned(), entry, true, chosen);
        }
    }
}

/// Adds Undo or Redo with the name of the edit; disabled without an edit.
fn named_item(ui: &mut Ui, action: Action, edit: Option<&str>, chosen: &mut Option<Action>) {
    if let Some(entry) = actions::entry_of(&action) {
        let name = edit.map_or_else(|| entry.name.to_owned(), |edit| format!("{}: {edit}", entry.name));
        item(ui, name, entry, edit.is_some(), chosen);
    }
}

fn item(ui: &mut Ui, name: String, entry: &actions::ActionEntry, enabled: bool, chosen: &mut Option<Action>) {
    let mut button = Button::new(name);
    if let Some(keys) = &entry.keys {
        button = button.shortcut_text(ui.ctx().format_shortcut(keys));
    }
    if ui.add_enabled(enabled, button).clicked() {
        *chosen = Some(entry.action.clone());
        ui.close();
    }
}
