//! The window: opens it, or says what is missing.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Result, anyhow};
use eframe::egui::{self, ViewportBuilder, ViewportCommand};

use super::document::{Document, Settings};
use super::editor::Editor;

const NO_WINDOW: &str = "the editor needs a desktop (X11 or Wayland) and a Vulkan driver. \
    Debian, Ubuntu: `apt install mesa-vulkan-drivers libxkbcommon-x11-0 libwayland-client0`; \
    Fedora: `dnf install mesa-vulkan-drivers libxkbcommon-x11 libwayland-client`. \
    Without a desktop, `biscale render SCENE -o picture.png` makes the same picture";

/// Opens the editor on a scene, a file or a shipped name.
///
/// # Errors
/// A scene that cannot be read, no display, no adapter: with what to do about it.
pub fn run(scene: Option<&str>) -> Result<()> {
    let document = Document::open(scene.unwrap_or("default"))?;
    let folder = Settings::folder();
    let settings = Settings::load(folder.as_deref());
    let kept: Rc<RefCell<Option<Editor>>> = Rc::default();
    let mut document = Some(document);
    loop {
        let lost = Arc::new(AtomicBool::new(false));
        let size = settings.window;
        let options = eframe::NativeOptions {
            viewport: ViewportBuilder::default()
                .with_inner_size(size)
                .with_min_inner_size([800.0, 560.0])
                .with_title("biscale")
                .with_app_id("biscale"),
            ..eframe::NativeOptions::default()
        };
        let (kept_inside, lost_inside, folder) = (kept.clone(), lost.clone(), folder.clone());
        let first = document.take();
        let opened = eframe::run_native(
            "biscale",
            options,
            Box::new(move |creation| {
                watch_device(creation, &lost_inside);
                if let Some(document) = first {
                    *kept_inside.borrow_mut() = Some(Editor::new(&creation.egui_ctx, document, folder));
                }
                Ok(Box::new(Window { editor: kept_inside, lost: lost_inside }))
            }),
        );
        if let Err(error) = opened {
            return Err(anyhow!("{NO_WINDOW} ({error})"));
        }
        // A lost device takes the window with it, not the document.
        if !lost.load(Ordering::Relaxed) {
            if let Some(editor) = kept.borrow_mut().take() {
                editor.finish();
            }
            return Ok(());
        }
    }
}

/// Errors of the window's own device are heard; the default handler would end the program.
fn watch_device(creation: &eframe::CreationContext, lost: &Arc<AtomicBool>) {
    if let Some(state) = &creation.wgpu_render_state {
        let (lost, ctx) = (lost.clone(), creation.egui_ctx.clone());
        state.device.set_device_lost_callback(move |reason, _| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost.store(true, Ordering::Relaxed);
                ctx.request_repaint();
            }
        });
        state
            .device
            .on_uncaptured_error(Arc::new(|error| eprintln!("biscale: the window's device complains: {error}")));
    }
}

/// What eframe runs.
struct Window {
    editor: Rc<RefCell<Option<Editor>>>,
    lost: Arc<AtomicBool>,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let mut editor = self.editor.borrow_mut();
        let Some(editor) = editor.as_mut() else { return };
        let ctx = ui.ctx().clone();
        if self.lost.load(Ordering::Relaxed) {
            ctx.send_viewport_cmd(ViewportCommand::Close);
            return;
        }
        editor.window_frame(ui);
    }
}
