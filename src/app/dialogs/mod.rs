//! Dialogs of the editor: files, questions, help.

pub mod export;
mod files;
mod formats;
mod help;
mod offer;
mod sweep;
mod vary;

use std::path::PathBuf;

use crate::export::tile::TileOptions;
use eframe::egui::{self, Context};

pub use files::{FileDialog, Purpose};
pub use help::help_ui;
pub use offer::{FileUse, Offer};
pub use sweep::Sweep;
pub use vary::Variants;

use super::actions::Action;
use super::document::RecoveredDocument;
use super::worker::TableChoice;

/// A width (`axis` 0) or a height (`axis` 1) that leaves `rest` of the window free, at most `most` [points].
fn within(ctx: &Context, most: f32, rest: f32, axis: usize) -> f32 {
    most.min(ctx.content_rect().size()[axis] - rest).max(60.0)
}

/// The open dialog.
#[derive(Debug)]
pub enum Dialog {
    Files(FileDialog),
    /// The question about unsaved changes before this action.
    Unsaved(Action),
    /// A file that the open scene can use.
    Offer(Offer),
    Help,
    About,
    /// Documents that a crash left behind.
    Recover(Vec<RecoveredDocument>),
    /// Another program changed the open file. The editor checks when it saves and when the window gets the focus.
    ChangedOnDisk {
        saving: bool,
    },
    /// Export of a table.
    Table {
        path: PathBuf,
        choice: TableChoice,
    },
    /// Export of a fit.
    Fit {
        path: PathBuf,
    },
    Tile {
        path: PathBuf,
        options: TileOptions,
    },
    Sweep {
        path: PathBuf,
        sweep: Sweep,
    },
    Vary(Box<Variants>),
    Image {
        path: PathBuf,
        width: usize,
        height: usize,
    },
}

impl Dialog {
    /// Returns true if the editor waits for an answer: nothing else takes keys until then.
    pub fn is_modal(&self) -> bool {
        !matches!(self, Self::Help)
    }
}

/// Draws a question. Returns the index of the chosen answer; closing the dialog chooses the last one. The first answer has
/// the focus, so that Enter chooses it.
pub fn question(ctx: &Context, title: &str, text: &str, answers: &[&str]) -> Option<usize> {
    let mut chosen = None;
    let mut buttons = Vec::new();
    let modal = egui::Modal::new(egui::Id::unique(("question", title))).show(ctx, |ui| {
        ui.set_width(420.0);
        ui.heading(title);
        ui.add_space(4.0);
        ui.label(text);
        ui.add_space(10.0);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for (at, label) in answers.iter().enumerate() {
                let button = ui.button(*label);
                if button.clicked() {
                    chosen = Some(at);
                }
                buttons.push(button);
            }
        });
    });
    // The control that had the focus when the question came must not receive keys.
    if let Some(first) = buttons.first().filter(|_| !buttons.iter().any(|button| button.has_focus())) {
        first.request_focus();
    }
    if modal.should_close() && chosen.is_none() {
        chosen = Some(answers.len() - 1);
    }
    chosen
}
