//! The open dialog and its result.

use std::path::Path;

use eframe::egui::Context;

use super::actions::Action;
use super::dialogs::export::{self, ExportDecision};
use super::dialogs::{self, Dialog, Offer};
use super::document::RecoveredDocument;
use super::editor::Editor;
use super::messages::Level;
use super::worker::ExportKind;

impl Editor {
    /// Shows the open dialog and closes it when it has a result.
    pub(super) fn dialogs(&mut self, ctx: &Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        let left_out = self.left_out_line();
        let is_closed = match &mut dialog {
            Dialog::Files(files) => match files.ui(ctx) {
                Some(path) => {
                    if let Some(path) = path {
                        self.use_file(ctx, files.purpose.clone(), path);
                    }
                    true
                }
                None => false,
            },
            Dialog::Unsaved(action) => self.unsaved(ctx, action),
            Dialog::Offer(offer) => self.offered(ctx, offer),
            Dialog::Help => !dialogs::help_ui(ctx),
            Dialog::About => about(ctx),
            Dialog::Recover(found) => self.recover(ctx, found),
            Dialog::ChangedOnDisk { saving } => self.changed_on_disk(ctx, *saving),
            Dialog::Table { path, choice } => {
                let result = export::table_ui(ctx, path, choice, left_out.as_deref());
                self.exported(result, path, ExportKind::Table(*choice))
            }
            Dialog::Fit { path } => {
                let result = export::fit_ui(ctx, path);
                self.exported(result, path, ExportKind::Fit)
            }
            Dialog::Tile { path, options } => {
                let result = export::tile_ui(ctx, path, options);
                self.exported(result, path, ExportKind::Tile(options.clone()))
            }
            Dialog::Sweep { path, sweep } => {
                let result = sweep.ui(ctx, path);
                if result == Some(ExportDecision::Export) {
                    match sweep.write(path) {
                        Ok(command) => {
                            let text = format!("The command that makes the data set is in the clipboard: {command}");
                            ctx.copy_text(command);
                            self.messages.put(Level::Note, "sweep", text);
                        }
                        Err(error) => self.messages.put(Level::Error, "sweep", error.to_string()),
                    }
                }
                result.is_some()
            }
            Dialog::Vary(variants) => match variants.ui(ctx) {
                Some(taken) => {
                    if let Some(scene) = taken {
                        self.document.edit_as("Vary", scene);
                        self.scene_changed();
                    }
                    true
                }
                None => false,
            },
            Dialog::Image { path, width, height } => {
                let result = export::image_ui(ctx, path, width, height);
                self.exported(result, path, ExportKind::Image { size: [*width, *height] })
            }
        };
        // A result may have opened the next dialog.
        if !is_closed && self.dialog.is_none() {
            self.dialog = Some(dialog);
        }
    }

    fn unsaved(&mut self, ctx: &Context, action: &Action) -> bool {
        let text = format!("\"{}\" has changes that are not saved.", self.document.name);
        let Some(result) = dialogs::question(ctx, "Unsaved changes", &text, &["Save", "Discard", "Cancel"]) else {
            return false;
        };
        match result {
            0 => {
                self.execute_now(ctx, Action::Save);
                if !self.document.is_dirty() {
                    self.execute_now(ctx, action.clone());
                }
            }
            1 => self.execute_now(ctx, action.clone()),
            _ => {}
        }
        true
    }

    fn offered(&mut self, ctx: &Context, offer: &Offer) -> bool {
        let name = offer.path.file_name().unwrap_or_default().to_string_lossy();
        let text = format!("{name} is {}. The open scene can use it.", offer.kind);
        let answers: Vec<&str> = offer.uses.iter().map(|(button, _)| *button).chain(["Cancel"]).collect();
        let Some(chosen) = dialogs::question(ctx, "Not a scene", &text, &answers) else { return false };
        if let Some((_, used)) = offer.uses.get(chosen) {
            self.use_as(ctx, &offer.path, *used);
        }
        true
    }

    fn recover(&mut self, ctx: &Context, found: &[RecoveredDocument]) -> bool {
        let names: Vec<&str> = found.iter().map(|one| one.name.as_str()).collect();
        let text = format!("The editor ended without saving: {}.", names.join(", "));
        let buttons = ["Recover", "Discard", "Later"];
        let Some(result) = dialogs::question(ctx, "Unsaved work was found", &text, &buttons) else { return false };
        match (result, found.first()) {
            (0, Some(first)) => match first.restore() {
                Ok(document) => {
                    self.set_document(document);
                    first.discard();
                }
                Err(error) => self.messages.put(Level::Error, "open", error.to_string()),
            },
            (1, _) => found.iter().for_each(RecoveredDocument::discard),
            _ => {}
        }
        true
    }

    fn changed_on_disk(&mut self, ctx: &Context, saving: bool) -> bool {
        let reload = if self.document.is_dirty() {
            "Reload opens it and drops the changes you have not saved. Keep mine continues with your changes"
        } else {
            "Reload opens it. Keep mine continues with the open document"
        };
        let name = &self.document.name;
        let end = if saving { " and overwrites the file." } else { "; the next Save overwrites the file." };
        let text = format!("The file of \"{name}\" was changed by another program. {reload}{end}");
        let buttons = ["Keep mine", "Reload", "Later"];
        let Some(result) = dialogs::question(ctx, "The file has changed", &text, &buttons) else { return false };
        match (result, self.document.path.clone()) {
            (0, Some(path)) if saving => self.save(&path),
            (0, _) => self.document.accept_disk(),
            (1, Some(path)) => self.open(&path.to_string_lossy()),
            _ => {}
        }
        true
    }

    fn exported(&mut self, result: Option<ExportDecision>, path: &Path, kind: ExportKind) -> bool {
        if result == Some(ExportDecision::Export) {
            self.export(path.to_owned(), kind);
        }
        result.is_some()
    }
}

fn about(ctx: &Context) -> bool {
    let text = format!(
        "Version {}. The effective BRDF of tiny structures, after Wu, Dorsey and Rushmeier 2011. MIT or Apache-2.0.",
        env!("CARGO_PKG_VERSION")
    );
    dialogs::question(ctx, "biscale", &text, &["Close"]).is_some()
}
