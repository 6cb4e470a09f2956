//! The editor: what is open, the views, the workers, and one frame of it all.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use biscale::scene::{Material, Scene};
use eframe::egui::{self, CentralPanel, Context, Panel, ScrollArea, Ui, ViewportCommand};

use super::actions::{self, Action};
use super::dialogs::Dialog;
use super::document::{Document, Recovered, RecoveryFile, Settings};
use super::messages::{Level, Messages};
use super::panels::{self, materials};
use super::theme;
use super::views::object::ObjectView;
use super::worker::{PictureAnswer, PictureJob, Worker, spawn_picture};

/// Everything but the window.
pub struct Editor {
    pub document: Document,
    pub settings: Settings,
    /// Where settings and recovery files are; none in tests.
    pub folder: Option<PathBuf>,
    pub recovery: Option<RecoveryFile>,
    pub messages: Messages,
    pub dialog: Option<Dialog>,
    pub object: ObjectView,
    pub title: String,
    /// The window may go.
    pub leaving: bool,
    pub(super) pictures: Option<Worker<PictureJob>>,
    answers: Receiver<PictureAnswer>,
    pub(super) slots: Vec<String>,
    pub(super) copied: Option<Material>,
}

impl Editor {
    /// `folder`: where settings are kept; without one nothing is remembered.
    pub fn new(ctx: &Context, document: Document, folder: Option<PathBuf>) -> Self {
        let settings = Settings::load(folder.as_deref());
        theme::install(ctx);
        ctx.set_theme(if settings.dark { egui::Theme::Dark } else { egui::Theme::Light });
        ctx.set_zoom_factor(settings.zoom);
        let mut messages = Messages::default();
        let (to_us, answers) = channel();
        let wake = ctx.clone();
        let pictures = spawn_picture(move |answer| {
            // Nobody listens any more only when the editor is gone.
            let _ = to_us.send(answer);
            wake.request_repaint();
        });
        if pictures.is_none() {
            messages.put(Level::Trouble, "worker", "The system gave no thread to compute on: nothing will be drawn.");
        }
        let recovered = folder.as_deref().map(Recovered::find).unwrap_or_default();
        let dialog = (!recovered.is_empty()).then_some(Dialog::Recover(recovered));
        Self {
            recovery: folder.as_deref().map(RecoveryFile::new),
            slots: materials::slots_of(&document.scene().tile.geometry),
            document,
            settings,
            folder,
            messages,
            dialog,
            object: ObjectView::default(),
            title: String::new(),
            leaving: false,
            pictures,
            answers,
            copied: None,
        }
    }

    /// One frame in a window: title, files dropped, the way out.
    pub fn window_frame(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        for file in ctx.input(|input| input.raw.dropped_files.clone()) {
            self.dropped(&ctx, file.path().to_owned());
        }
        if ctx.input(|input| input.viewport().close_requested()) && !self.leaving {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.perform(&ctx, Action::Quit);
        }
        self.frame(ui);
        let dirty = if self.document.is_dirty() { "*" } else { "" };
        let title = format!("{}{dirty} - biscale", self.document.name);
        if title != self.title {
            self.title.clone_from(&title);
            ctx.send_viewport_cmd(ViewportCommand::Title(title));
        }
        if self.leaving {
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
    }

    /// One frame.
    pub fn frame(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.take_answers(&ctx);
        let action = actions::pressed(&ctx);
        let from_menu = Panel::top("menu").show(ui, |ui| self.menu_ui(ui)).inner;
        Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
        let mut scene = (**self.document.scene()).clone();
        let asked = Panel::right("parameters")
            .default_size(self.settings.parameters_width)
            .size_range(260.0..=620.0)
            .show(ui, |ui| {
                let painted = self.document.painted().clone();
                ScrollArea::vertical()
                    .auto_shrink([false, false])
                    .show(ui, |ui| panels::ui(ui, &mut scene, &painted, &self.document.name, &self.slots))
            })
            .inner
            .inner;
        let size = CentralPanel::no_frame()
            .show(ui, |ui| {
                self.messages.ui(ui);
                self.object.ui(ui, &mut scene)
            })
            .inner;
        self.take_scene(scene);
        self.take_asked(&ctx, asked);
        for action in action.into_iter().chain(from_menu) {
            self.perform(&ctx, action);
        }
        self.dialogs(&ctx);
        if !ctx.input(|input| input.pointer.any_down()) && !ctx.text_edit_focused() {
            self.document.rest();
        }
        self.request_picture(size);
    }

    /// The scene as the panels and views left it, if it can be.
    fn take_scene(&mut self, scene: Scene) {
        if scene == **self.document.scene() {
            return;
        }
        match scene.validate() {
            Ok(()) => {
                self.messages.clear("edit");
                self.slots = materials::slots_of(&scene.tile.geometry);
                self.document.edit(scene);
            }
            Err(error) => self.messages.put(Level::Trouble, "edit", format!("Not taken over: {error}")),
        }
    }

    /// Asks for the picture of what is shown, once for every state and size.
    fn request_picture(&mut self, size: [usize; 2]) {
        let wanted = (self.document.version(), size);
        if self.object.asked == Some(wanted) {
            return;
        }
        self.object.asked = Some(wanted);
        self.object.since.get_or_insert_with(Instant::now);
        if let Some(worker) = &self.pictures {
            let loaded = Arc::new(self.document.loaded());
            worker.ask(PictureJob { version: wanted.0, loaded, size, asked: Instant::now() });
        }
    }

    fn take_answers(&mut self, ctx: &Context) {
        while let Ok(answer) = self.answers.try_recv() {
            match answer {
                PictureAnswer::Made(made) => {
                    self.messages.clear("picture");
                    self.object.since = None;
                    self.object.take(ctx, made);
                }
                PictureAnswer::Doing(version, what) if version == self.document.version() => {
                    self.object.doing = Some(what);
                }
                PictureAnswer::Doing(..) => {}
                PictureAnswer::Failed(_, text) => {
                    self.object.doing = None;
                    self.object.since = None;
                    self.messages.put(Level::Trouble, "picture", text);
                }
                PictureAnswer::Fault(text) => {
                    self.object.doing = None;
                    self.object.since = None;
                    let text =
                        format!("A fault in the program while computing ({text}). Your document is kept; edit on.");
                    self.messages.put(Level::Trouble, "picture", text);
                }
            }
        }
    }

    /// Whether anything is being computed.
    #[cfg(test)]
    pub fn is_busy(&self) -> bool {
        use super::worker::Grade;
        self.object.made.as_ref().is_none_or(|made| {
            made.grade != Grade::Final || Some(made.version) != self.object.asked.map(|(version, _)| version)
        })
    }

    pub fn action(&mut self, ctx: &Context, action: Action) {
        self.perform(ctx, action);
    }
}
