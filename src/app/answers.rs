//! The dialog that is open, and what it answers.

use std::path::Path;

use eframe::egui::Context;

use super::actions::Action;
use super::dialogs::export::{self, Answer};
use super::dialogs::{self, Dialog};
use super::document::Recovered;
use super::editor::Editor;
use super::messages::Level;
use super::worker::What;

impl Editor {
    /// Shows the dialog that is open; it goes once it has an answer.
    pub(super) fn dialogs(&mut self, ctx: &Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        let answered = match &mut dialog {
            Dialog::Files(files) => match files.ui(ctx) {
                Some(path) => {
                    if let Some(path) = path {
                        self.chosen(ctx, files.purpose.clone(), path);
                    }
                    true
                }
                None => false,
            },
            Dialog::Unsaved(action) => self.unsaved(ctx, action),
            Dialog::Help => !dialogs::help_ui(ctx),
            Dialog::About => about(ctx),
            Dialog::Recover(found) => self.recover(ctx, found),
            Dialog::ChangedOnDisk { saving } => self.changed_on_disk(ctx, *saving),
            Dialog::Table { path, choice } => {
                let answer = export::table_ui(ctx, path, choice);
                self.exported(answer, path, What::Table(*choice))
            }
            Dialog::Fit { path } => {
                let answer = export::fit_ui(ctx, path);
                self.exported(answer, path, What::Fit)
            }
            Dialog::Tile { path, options } => {
                let answer = export::tile_ui(ctx, path, options);
                self.exported(answer, path, What::Tile(options.clone()))
            }
            Dialog::Image { path, width, height } => {
                let answer = export::image_ui(ctx, path, width, height);
                self.exported(answer, path, What::Image { size: [*width, *height] })
            }
        };
        // An answer may have opened the next one.
        if !answered && self.dialog.is_none() {
            self.dialog = Some(dialog);
        }
    }

    fn unsaved(&mut self, ctx: &Context, action: &Action) -> bool {
        let text = format!("\"{}\" has changes that are not saved.", self.document.name);
        let Some(answer) = dialogs::question(ctx, "Unsaved changes", &text, &["Save", "Discard", "Cancel"]) else {
            return false;
        };
        match answer {
            0 => {
                self.perform_now(ctx, Action::Save);
                if !self.document.is_dirty() {
                    self.perform_now(ctx, action.clone());
                }
            }
            1 => self.perform_now(ctx, action.clone()),
            _ => {}
        }
        true
    }

    fn recover(&mut self, ctx: &Context, found: &[Recovered]) -> bool {
        let names: Vec<&str> = found.iter().map(|one| one.name.as_str()).collect();
        let text = format!("The editor ended without saving: {}.", names.join(", "));
        let answers = ["Recover", "Throw away", "Later"];
        let Some(answer) = dialogs::question(ctx, "Unsaved work was found", &text, &answers) else { return false };
        match (answer, found.first()) {
            (0, Some(first)) => match first.restore() {
                Ok(document) => {
                    self.take_document(document);
                    first.discard();
                }
                Err(error) => self.messages.put(Level::Trouble, "open", error.to_string()),
            },
            (1, _) => found.iter().for_each(Recovered::discard),
            _ => {}
        }
        true
    }

    fn changed_on_disk(&mut self, ctx: &Context, saving: bool) -> bool {
        let reload = if self.document.is_dirty() {
            "Reload shows it, and drops the changes you have not saved. Keep mine goes on with yours"
        } else {
            "Reload shows it. Keep mine goes on with what is open"
        };
        let name = &self.document.name;
        let end = if saving { ", and saves over it." } else { "; the next Save writes over it." };
        let text = format!("The file of \"{name}\" was changed by another program. {reload}{end}");
        let answers = ["Keep mine", "Reload", "Later"];
        let Some(answer) = dialogs::question(ctx, "The file has changed", &text, &answers) else { return false };
        match (answer, self.document.path.clone()) {
            (0, Some(path)) if saving => self.save(&path),
            (0, _) => self.document.accept_disk(),
            (1, Some(path)) => self.open(&path.to_string_lossy()),
            _ => {}
        }
        true
    }

    fn exported(&mut self, answer: Option<Answer>, path: &Path, what: What) -> bool {
        if answer == Some(Answer::Export) {
            self.export(path.to_owned(), what);
        }
        answer.is_some()
    }
}

fn about(ctx: &Context) -> bool {
    let text = format!(
        "Version {}. The effective BRDF of tiny structures, after Wu, Dorsey and Rushmeier 2011. MIT or Apache-2.0.",
        env!("CARGO_PKG_VERSION")
    );
    dialogs::question(ctx, "biscale", &text, &["Close"]).is_some()
}
