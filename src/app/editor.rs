//! The editor: the document, the views, the workers, and the order of work in one frame.

use std::path::PathBuf;

use crate::cache::Cache;
use crate::scene::{MaterialSpec, Scene};
use eframe::egui::{self, Context, Panel, Ui, ViewportCommand};

use super::actions::{self, Action};
use super::background::BackgroundJobs;
use super::dialogs::Dialog;
use super::document::{Document, EditorSettings, RecoveredDocument, RecoveryFile};
use super::messages::{Level, Messages};
use super::paint::Stroke;
use super::panels::{self, materials};
use super::theme;
use super::views::capture::CaptureState;
use super::views::gallery::Gallery;
use super::views::lobe::LobeState;
use super::views::methods::MethodsState;
use super::views::object::ObjectView;
use super::views::pointer::Pointer;
use super::views::slab_lobe::SlabLobeState;
use super::views::thumbnails::Thumbnails;
use super::views::tile::TileState;
use super::views::zoom::TileScale;

/// Message of the first start, shown until the user closes it.
const WELCOME: &str = "welcome";
const WELCOME_TEXT: &str = "New here? Start from a material of the gallery (press G if it is hidden) and change its surface \
                            and materials (right). F1 explains common tasks and lists all shortcuts.";

/// The state of the editor, independent of its window.
pub struct Editor {
    pub document: Document,
    pub settings: EditorSettings,
    /// Folder of settings and recovery files; absent in tests.
    pub folder: Option<PathBuf>,
    pub recovery: Option<RecoveryFile>,
    /// Results of earlier runs; disabled in tests.
    cache: Cache,
    pub messages: Messages,
    pub dialog: Option<Dialog>,
    pub object: ObjectView,
    pub tile: TileState,
    pub lobe: LobeState,
    pub slab_lobe: SlabLobeState,
    pub methods: MethodsState,
    pub accuracy: panels::AccuracyState,
    pub targets: panels::TargetState,
    pub capture: CaptureState,
    /// The sections that the parameters show.
    pub tab: panels::Tab,
    /// Title of a section of the parameters that unfolds and comes into view.
    pub(super) reveal: Option<&'static str>,
    pub color_map: panels::ColorMapState,
    /// The document was opened in this frame.
    pub(super) is_new: bool,
    /// The tile is in the large view.
    pub exchanged: bool,
    /// The stroke that the user is drawing.
    pub(super) stroke: Option<Stroke>,
    pub title: String,
    /// The window got the focus, so that another program may have changed the file.
    got_focus: bool,
    /// The window may close.
    pub leaving: bool,
    pub(super) background: BackgroundJobs,
    /// The finished fraction of an export, and its current work.
    pub(super) exporting: Option<(f32, &'static str)>,
    pub gallery: Gallery,
    pub(super) thumbnails: Thumbnails,
    pub(super) slots: Vec<String>,
    /// Size of the object view in pixels.
    pub(super) size: [usize; 2],
    /// Pointer input on the tile in this frame.
    pub(super) pointer: Vec<Pointer>,
    /// The action that the object view's toolbar started in this frame.
    pub(super) from_view: Option<Action>,
    pub(super) copied: Option<MaterialSpec>,
    /// Width of the window in the last frame [points].
    pub(super) window_width: f32,
    /// The gallery lies over the object in a narrow window.
    pub(super) drawer: bool,
    /// True once a message names the effects that the scene leaves out.
    pub(super) noted_left_out: bool,
    /// Version of the document when it was opened.
    pub(super) opened: u64,
    /// The GPU failure that was reported last.
    pub(super) gpu_error: Option<String>,
}

impl Editor {
    /// Creates an editor. `folder` stores the settings; without a folder they are not saved. `cache` stores results.
    pub fn new(ctx: &Context, document: Document, folder: Option<PathBuf>, cache: Cache) -> Self {
        let settings = EditorSettings::load(folder.as_deref());
        theme::install(ctx);
        ctx.set_theme(if settings.dark { egui::Theme::Dark } else { egui::Theme::Light });
        ctx.set_zoom_factor(settings.zoom);
        let mut messages = Messages::default();
        let background = BackgroundJobs::new(ctx, &cache);
        if background.images.is_none() {
            messages.put(Level::Error, "worker", "The system provides no threads, so no image can be computed.");
        }
        if !settings.welcomed && folder.is_some() {
            messages.put(Level::Guide, WELCOME, WELCOME_TEXT);
        }
        let recovered = folder.as_deref().map(RecoveredDocument::find).unwrap_or_default();
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
            slab_lobe: SlabLobeState::default(),
            methods: MethodsState::default(),
            accuracy: panels::AccuracyState::default(),
            targets: panels::TargetState::default(),
            capture: CaptureState::default(),
            tab: panels::Tab::default(),
            reveal: None,
            color_map: panels::ColorMapState::default(),
            is_new: false,
            exchanged: false,
            stroke: None,
            title: String::new(),
            got_focus: false,
            leaving: false,
            background,
            exporting: None,
            gallery: Gallery::default(),
            thumbnails: Thumbnails::default(),
            copied: None,
            window_width: 0.0,
            drawer: false,
            noted_left_out: false,
            opened: 0,
            gpu_error: None,
            size: [64, 64],
            pointer: Vec::new(),
            from_view: None,
        }
    }

    /// Moves to another window, in which all images are rendered again.
    pub fn move_to(&mut self, ctx: &Context) {
        theme::install(ctx);
        ctx.set_theme(if self.settings.dark { egui::Theme::Dark } else { egui::Theme::Light });
        ctx.set_zoom_factor(self.settings.zoom);
        std::mem::replace(&mut self.background, BackgroundJobs::new(ctx, &self.cache)).finish();
        self.object.move_to(ctx);
        self.tile.move_to();
        self.lobe.move_to();
        self.slab_lobe.move_to();
        self.methods.move_to();
        self.thumbnails = Thumbnails::default();
        self.accuracy = panels::AccuracyState::default();
        self.targets = panels::TargetState::default();
        self.capture = CaptureState::default();
        self.color_map = panels::ColorMapState::default();
        self.exporting = None;
        self.title.clear();
        let text = "The window's GPU was lost, so a new window was opened. Your document is unchanged. If this happens \
                    again, save, and update the graphics driver.";
        self.messages.put(Level::Error, "window", text);
    }

    /// Ends the workers after the window has closed.
    pub fn finish(self) {
        self.background.finish();
        // A result that could not be stored is computed again by the next run.
        let _ = self.cache.finish();
    }

    /// Runs one frame in a window: dropped files, closing, title.
    pub fn window_frame(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        for file in ctx.input(|input| input.raw.dropped_files.clone()) {
            self.dropped(&ctx, file.path().to_owned());
        }
        if ctx.input(|input| input.viewport().close_requested()) && !self.leaving {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.execute(&ctx, Action::Quit);
        }
        self.got_focus |= ctx.input(|input| input.events.contains(&egui::Event::WindowFocused(true)));
        // An open dialog postpones the check of the file.
        if self.got_focus && self.dialog.is_none() {
            self.got_focus = false;
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

    /// Runs one frame without a window.
    pub fn frame(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.receive_results(&ctx);
        let action = if self.dialog.as_ref().is_some_and(Dialog::is_modal) { None } else { actions::pressed(&ctx) };
        let from_menu = Panel::top("menu").show(ui, |ui| self.menu_ui(ui)).inner;
        Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
        let window = self.measure_window(ui);
        let from_gallery = self.gallery_ui(ui, window);
        let mut scene = (**self.document.scene()).clone();
        let height = self.size[1] as f32;
        self.color_map.scale =
            self.object.preview.as_ref().map(|preview| TileScale { framing: preview.distance, height });
        let requests = self.parameters_ui(ui, &mut scene, window);
        let large = self.views_ui(ui, &mut scene, window);
        let reply = self.messages.ui(&ctx, large);
        if reply.is_some_and(|reply| reply.source == WELCOME) {
            self.settings.welcomed = true;
            self.settings.save(self.folder.as_deref());
        }
        self.apply_edit(scene);
        reply.iter().for_each(|reply| self.answer_left_out(reply));
        self.note_left_out();
        self.apply_requests(&ctx, requests);
        if let Some(action) = self.from_view.take() {
            self.execute(&ctx, action);
        }
        self.apply_pointer_events();
        self.brush_keys(&ctx);
        self.paste_clipboard(&ctx);
        for action in action.into_iter().chain(from_menu).chain(from_gallery) {
            self.execute(&ctx, action);
        }
        self.capture.ui(&ctx);
        self.read_capture();
        self.dialogs(&ctx);
        if !ctx.input(|input| input.pointer.any_down()) && !ctx.text_edit_focused() {
            self.document.rest();
        }
        self.submit_jobs(&ctx);
        self.update_recovery(&ctx);
        self.render_thumbnails();
        self.search_for_targets();
        self.measure_accuracy();
        self.compare_methods();
    }

    /// Applies strokes after the panels, so that they edit the scene of this frame.
    fn apply_pointer_events(&mut self) {
        for pointer in std::mem::take(&mut self.pointer) {
            self.paint(pointer);
        }
        if !self.tile.painting {
            self.end_stroke();
        }
    }

    /// Takes the scene over that the panels and views edited, if it is valid.
    pub(super) fn apply_edit(&mut self, scene: Scene) {
        if scene == **self.document.scene() {
            return;
        }
        match scene.validate() {
            Ok(()) => {
                self.messages.clear("edit");
                // After an edit, a file that could not be opened is no longer of interest.
                self.messages.clear("open");
                self.slots = materials::slots_of(&scene);
                self.document.edit(scene);
            }
            Err(error) => self.messages.put(Level::Error, "edit", format!("Edit rejected: {error}")),
        }
    }

    /// Executes an action like a menu does.
    #[cfg(test)]
    pub fn action(&mut self, ctx: &Context, action: Action) {
        self.execute(ctx, action);
    }
}
