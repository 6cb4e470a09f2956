//! The editor: what is open, the views, the workers, and one frame of it all.

use std::path::PathBuf;

use crate::cache::Cache;
use crate::scene::{MaterialSpec, Scene};
use eframe::egui::{self, CentralPanel, Context, Panel, ScrollArea, Ui, ViewportCommand};

use super::actions::{self, Action};
use super::background::Background;
use super::dialogs::Dialog;
use super::document::{Document, Recovered, RecoveryFile, Settings};
use super::messages::{Level, Messages};
use super::paint::Stroke;
use super::panels::{self, materials};
use super::theme;
use super::views::gallery::Gallery;
use super::views::hand::Hand;
use super::views::lobe::LobeState;
use super::views::object::ObjectView;
use super::views::tile::TileState;

/// What a person reads at the first start, until it is closed.
const WELCOME: &str = "welcome";
const WELCOME_TEXT: &str = "New here? Start from a material of the gallery (left) and change its surface and materials \
                            (right). F1 has the first steps of usual tasks, and all shortcuts.";

/// Width of the smaller view, and what panels leave of the window's width to the large one, points.
const SIDE: [f32; 2] = [240.0, 900.0];
const MIN_VIEW: f32 = 260.0;

/// Everything but the window.
pub struct Editor {
    pub document: Document,
    pub settings: Settings,
    /// Where settings and recovery files are; none in tests.
    pub folder: Option<PathBuf>,
    pub recovery: Option<RecoveryFile>,
    /// Results of earlier runs; off in tests.
    cache: Cache,
    pub messages: Messages,
    pub dialog: Option<Dialog>,
    pub object: ObjectView,
    pub tile: TileState,
    pub lobe: LobeState,
    pub accuracy: panels::AccuracyState,
    /// The tile is in the large view.
    pub exchanged: bool,
    pub(super) stroke: Option<Stroke>,
    pub title: String,
    /// The window has the focus again, and others may have written the file meanwhile.
    came_back: bool,
    /// The window may go.
    pub leaving: bool,
    pub(super) background: Background,
    /// The part of an export that is done, and what is being done.
    pub(super) exporting: Option<(f32, &'static str)>,
    pub gallery: Gallery,
    pub(super) slots: Vec<String>,
    /// Pixels of the object view.
    pub(super) size: [usize; 2],
    /// What the hand did on the tile in this frame.
    pub(super) hand: Vec<Hand>,
    pub(super) from_view: Option<Action>,
    pub(super) copied: Option<MaterialSpec>,
    /// Why pictures are not made on the device any more, as it was said.
    pub(super) device_trouble: Option<String>,
}

impl Editor {
    /// `folder`: where settings are kept; without one nothing is remembered. `cache`: where results are.
    pub fn new(ctx: &Context, document: Document, folder: Option<PathBuf>, cache: Cache) -> Self {
        let settings = Settings::load(folder.as_deref());
        theme::install(ctx);
        ctx.set_theme(if settings.dark { egui::Theme::Dark } else { egui::Theme::Light });
        ctx.set_zoom_factor(settings.zoom);
        let mut messages = Messages::default();
        let background = Background::new(ctx, &cache);
        if background.images.is_none() {
            messages.put(Level::Trouble, "worker", "The system gave no thread to compute on: nothing will be drawn.");
        }
        if !settings.welcomed && folder.is_some() {
            messages.put(Level::Guide, WELCOME, WELCOME_TEXT);
        }
        let recovered = folder.as_deref().map(Recovered::find).unwrap_or_default();
        let dialog = (!recovered.is_empty()).then_some(Dialog::Recover(recovered));
        Self {
            recovery: folder.as_deref().map(RecoveryFile::new),
            cache,
            slots: materials::slots_of(document.scene()),
            document,
            settings,
            folder,
            messages,
            dialog,
            object: ObjectView::default(),
            tile: TileState::default(),
            lobe: LobeState::default(),
            accuracy: panels::AccuracyState::default(),
            exchanged: false,
            stroke: None,
            title: String::new(),
            came_back: false,
            leaving: false,
            background,
            exporting: None,
            gallery: Gallery::default(),
            copied: None,
            device_trouble: None,
            size: [64, 64],
            hand: Vec::new(),
            from_view: None,
        }
    }

    /// Goes on in another window, with all its pictures to be made anew.
    pub fn move_to(&mut self, ctx: &Context) {
        theme::install(ctx);
        ctx.set_theme(if self.settings.dark { egui::Theme::Dark } else { egui::Theme::Light });
        ctx.set_zoom_factor(self.settings.zoom);
        std::mem::replace(&mut self.background, Background::new(ctx, &self.cache)).finish();
        self.object.move_to(ctx);
        self.tile.move_to();
        self.lobe.move_to();
        self.gallery = Gallery::default();
        self.accuracy = panels::AccuracyState::default();
        self.exporting = None;
        self.title.clear();
        let text = "The graphics device of the window was lost, so a new window was opened. Your document is as it was; \
                    if this happens again, save, and update the graphics driver.";
        self.messages.put(Level::Trouble, "window", text);
    }

    /// After the window is gone.
    pub fn finish(self) {
        self.background.finish();
        // What could not be kept is made again.
        let _ = self.cache.finish();
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
        self.came_back |= ctx.input(|input| input.events.contains(&egui::Event::WindowFocused(true)));
        // Not over another question: the file is looked at once that is answered.
        if self.came_back && self.dialog.is_none() {
            self.came_back = false;
            if self.document.changed_on_disk() {
                self.dialog = Some(Dialog::ChangedOnDisk { saving: false });
            }
        }
        if let Some(rect) = ctx.input(|input| input.viewport().inner_rect) {
            self.settings.window = rect.size().into();
        }
        self.frame(ui);
        let dirty = if self.document.is_dirty() { "*" } else { "" };
        let title = format!("{}{dirty} - biscale", self.document.name);
        if title != self.title {
            self.title.clone_from(&title);
            ctx.send_viewport_cmd(ViewportCommand::Title(title));
        }
        if self.leaving {
            self.close();
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
        let from_gallery = self.gallery_ui(ui);
        let mut scene = (**self.document.scene()).clone();
        let widest = (ui.available_width() - SIDE[0] - MIN_VIEW).clamp(260.0, 620.0);
        let parameters = Panel::right("parameters")
            .default_size(self.settings.parameters_width)
            .size_range(260.0..=widest)
            .show(ui, |ui| {
                let painted = self.document.painted().clone();
                ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                    let effects = self.object.made.as_ref().map_or(&[][..], |made| &made.effects);
                    let version = self.document.version();
                    let shown = panels::Shown { accuracy: &mut self.accuracy, effects, version };
                    panels::ui(ui, &mut scene, &painted, &self.document.name, &self.slots, shown)
                })
            });
        self.settings.parameters_width = parameters.response.rect.width();
        let asked = parameters.inner.inner;
        let widest = (ui.available_width() - MIN_VIEW).clamp(SIDE[0], SIDE[1]);
        let side = Panel::right("side").default_size(self.settings.side_width).size_range(SIDE[0]..=widest);
        let side = side.show(ui, |ui| self.side_ui(ui, &mut scene)).response.rect.width();
        self.settings.side_width = side;
        let large = CentralPanel::no_frame().show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            if self.exchanged {
                self.tile_ui(ui, &scene, 0.0);
            } else {
                self.object_ui(ui, &mut scene);
            }
        });
        if self.messages.ui(&ctx, large.response.rect) == Some(WELCOME) {
            self.settings.welcomed = true;
            self.settings.save(self.folder.as_deref());
        }
        self.take_scene(scene);
        self.take_asked(&ctx, asked);
        if let Some(action) = self.from_view.take() {
            self.perform(&ctx, action);
        }
        self.take_hand();
        self.brush_keys(&ctx);
        self.take_pasted(&ctx);
        for action in action.into_iter().chain(from_menu).chain(from_gallery) {
            self.perform(&ctx, action);
        }
        self.dialogs(&ctx);
        if !ctx.input(|input| input.pointer.any_down()) && !ctx.text_edit_focused() {
            self.document.rest();
        }
        self.request(&ctx);
        self.keep_recovery(&ctx);
        self.fill_gallery();
        self.measure_accuracy();
    }

    /// Strokes come after the panels: what they edit is the scene as it is then.
    fn take_hand(&mut self) {
        for hand in std::mem::take(&mut self.hand) {
            self.paint(hand);
        }
        if !self.tile.painting {
            self.end_stroke();
        }
    }

    /// The scene as the panels and views left it, if it can be.
    pub(super) fn take_scene(&mut self, scene: Scene) {
        if scene == **self.document.scene() {
            return;
        }
        match scene.validate() {
            Ok(()) => {
                self.messages.clear("edit");
                self.slots = materials::slots_of(&scene);
                self.document.edit(scene);
            }
            Err(error) => self.messages.put(Level::Trouble, "edit", format!("Not taken over: {error}")),
        }
    }

    /// As from a menu.
    #[cfg(test)]
    pub fn action(&mut self, ctx: &Context, action: Action) {
        self.perform(ctx, action);
    }
}
