//! Windows over the editor: files, questions, help.

pub mod export;
mod files;
mod formats;
mod help;

use std::path::PathBuf;

use crate::export::tile::TileOptions;
use eframe::egui::{self, Context};

pub use files::{FileDialog, Purpose};
pub use help::help_ui;

use super::actions::Action;
use super::document::Recovered;
use super::worker::TableChoice;

/// The one that is open.
#[derive(Debug)]
pub enum Dialog {
    Files(FileDialog),
    /// Unsaved changes stand before this action.
    Unsaved(Action),
    Help,
    About,
    /// What a crash left behind.
    Recover(Vec<Recovered>),
    /// The file was written by someone else; noticed while saving, or on coming back to the window.
    ChangedOnDisk {
        saving: bool,
    },
    /// Table export: where to, and how fine.
    Table {
        path: PathBuf,
        choice: TableChoice,
    },
    /// Export of a few parameters that are fitted.
    Fit {
        path: PathBuf,
    },
    Tile {
        path: PathBuf,
        options: TileOptions,
    },
    Image {
        path: PathBuf,
        width: usize,
        height: usize,
    },
}

/// A question with its answers. The first is what Enter means; leaving is `None`-less: it returns the last.
pub fn question(ctx: &Context, title: &str, text: &str, answers: &[&str]) -> Option<usize> {
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique(("question", title))).show(ctx, |ui| {
        ui.set_width(420.0);
        ui.heading(title);
        ui.add_space(4.0);
        ui.label(text);
        ui.add_space(10.0);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for (at, word) in answers.iter().enumerate() {
                if ui.button(*word).clicked() {
                    answer = Some(at);
                }
            }
        });
    });
    if modal.should_close() && answer.is_none() {
        answer = Some(answers.len() - 1);
    }
    answer
}
