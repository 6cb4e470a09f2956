//! The window: opens it, or says what is missing. A lost graphics device takes the window with it, not the document.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::gpu::{Gpu, GpuError};
use anyhow::{Result, anyhow};
use eframe::egui::{self, Context, ViewportBuilder, ViewportCommand};

use super::document::{Document, Settings};
use super::editor::Editor;
use super::start_times::{FirstFrames, StartTimes};
use super::worker::{Devices, Screen};
use crate::cli::cache;

const NO_WINDOW: &str = "the editor needs a desktop (X11 or Wayland) and a Vulkan driver. \
    Debian, Ubuntu: `apt install mesa-vulkan-drivers libxkbcommon-x11-0 libwayland-client0`; \
    Fedora: `dnf install mesa-vulkan-drivers libxkbcommon-x11 libwayland-client`. \
    Without a desktop, `biscale render SCENE -o picture.png` makes the same picture";

/// A window that is lost sooner than this is not opened a further time.
const SHORTEST: Duration = Duration::from_secs(3);

/// The editor, kept while windows come and go.
type Kept = Rc<RefCell<Option<Editor>>>;

/// Opens the editor on a scene, a file or a shipped name.
///
/// # Errors
/// A scene that cannot be read, no display, no adapter: with what to do about it.
pub fn run(scene: Option<&str>, times: StartTimes) -> Result<()> {
    let document = Document::open(scene.unwrap_or("default"))?;
    times.note("scene read");
    // The first picture is computed while desktop, device and window are still to be had.
    let ctx = context();
    let mut editor = Editor::new(&ctx, document, Settings::folder(), cache::open());
    editor.ask_early();
    let mut first = Some((ctx, editor));
    let kept = Kept::default();
    loop {
        let (opened_at, lost) = (Instant::now(), Arc::new(AtomicBool::new(false)));
        let opened = catch_unwind(AssertUnwindSafe(|| open(&kept, &lost, first.take(), times)));
        let has_left = kept.borrow().as_ref().is_none_or(|editor| editor.leaving);
        match opened {
            Ok(Ok(())) if has_left => {
                if let Some(editor) = kept.borrow_mut().take() {
                    editor.finish();
                }
                return Ok(());
            }
            Ok(Ok(())) if lost.load(Ordering::Relaxed) && opened_at.elapsed() > SHORTEST => {
                eprintln!("biscale: the window's graphics device was lost; a new window is opened");
            }
            Ok(Ok(())) => return Err(given_up(&kept, "it closed by itself")),
            Ok(Err(error)) if kept.borrow().is_none() => return Err(anyhow!("{NO_WINDOW} ({error})")),
            Ok(Err(error)) => return Err(given_up(&kept, &error.to_string())),
            Err(_) => {
                let told = given_up(&kept, "a fault in the program");
                // What a panic left of this process' windows is no ground for another one.
                if opened_at.elapsed() > SHORTEST && start_again().is_ok() {
                    eprintln!("biscale: {told}; a new editor is started");
                    return Ok(());
                }
                return Err(told);
            }
        }
    }
}

/// One window, from its opening to its end.
fn open(kept: &Kept, lost: &Arc<AtomicBool>, first: Option<(Context, Editor)>, times: StartTimes) -> eframe::Result {
    let settings = Settings::load(Settings::folder().as_deref());
    let options = eframe::NativeOptions {
        wgpu_options: noting(times),
        window_builder: Some(Box::new(move |builder| {
            times.note("desktop found");
            builder
        })),
        viewport: ViewportBuilder::default()
            .with_inner_size(settings.window)
            .with_min_inner_size([800.0, 560.0])
            .with_title("biscale")
            .with_app_id("biscale"),
        ..eframe::NativeOptions::default()
    };
    let (kept, lost) = (kept.clone(), lost.clone());
    let (ctx, first) = first.map_or_else(|| (context(), None), |(ctx, editor)| (ctx, Some(editor)));
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        times.note("device and the interface's pipelines built");
        let gpu = watch_device(creation, &lost);
        let mut editor = kept.borrow_mut();
        match (editor.as_mut(), first) {
            (Some(editor), _) => editor.move_to(&creation.egui_ctx),
            (None, first) => *editor = first,
        }
        if let (Some(editor), Some(devices)) = (editor.as_ref(), devices(creation, gpu.as_ref())) {
            editor.tell_devices(devices);
        }
        drop(editor);
        times.note("editor made");
        Ok(Box::new(Window { editor: kept, lost, gpu, first: FirstFrames::new(times) }))
    });
    eframe::run_native_ext("biscale", options, Some(ctx), create)
}

/// A context as eframe makes it, for a window that is still to come.
fn context() -> Context {
    let ctx = Context::default();
    ctx.set_embed_viewports(false);
    if let Ok(passes) = 2.try_into() {
        ctx.options_mut(|options| options.max_passes = passes);
    }
    ctx
}

/// What the window's own instance sees of devices.
fn devices(creation: &eframe::CreationContext, gpu: Option<&Arc<Gpu>>) -> Option<Devices> {
    let state = creation.wgpu_render_state.as_ref()?;
    let adapters: Vec<_> = state.available_adapters.iter().map(wgpu::Adapter::get_info).collect();
    let only_software = adapters.iter().all(|adapter| adapter.device_type == wgpu::DeviceType::Cpu);
    Some(Devices {
        only_software: adapters.first().filter(|_| only_software).map(|adapter| adapter.name.clone()),
        screen: gpu.map(|gpu| Screen::new(gpu.clone(), state.renderer.clone())),
    })
}

/// A device that pictures can be made on, too, and a word when the adapter is found.
fn noting(times: StartTimes) -> eframe::egui_wgpu::WgpuConfiguration {
    let mut options = eframe::egui_wgpu::WgpuConfiguration::default();
    if let eframe::egui_wgpu::WgpuSetup::CreateNew(setup) = &mut options.wgpu_setup {
        setup.device_descriptor = Arc::new(move |adapter| {
            times.note("window and adapter there");
            Gpu::request(adapter)
        });
    }
    options
}

/// Starts the program anew; it offers what the recovery file holds.
fn start_again() -> std::io::Result<()> {
    std::process::Command::new(std::env::current_exe()?).arg("edit").spawn().map(drop)
}

/// No window can be had any more: the document goes to the recovery file, which the next start offers.
fn given_up(kept: &Kept, why: &str) -> anyhow::Error {
    // A panic while it was borrowed leaves it borrowed; the last autosave is what there is then.
    let saved = kept.try_borrow().ok().and_then(|editor| editor.as_ref().map(Editor::keep_now));
    if let Ok(mut editor) = kept.try_borrow_mut()
        && let Some(editor) = editor.take()
    {
        // Not dropped: that would remove the recovery file.
        std::mem::forget(editor);
    }
    let kept = match saved {
        Some(Ok(())) => "Unsaved work is kept and is offered at the next start",
        Some(Err(_)) | None => "The work up to the last seconds is kept and is offered at the next start",
    };
    anyhow!("the window was lost ({why}). {kept}")
}

/// Errors of the window's own device are heard; the default handler would end the program.
fn watch_device(creation: &eframe::CreationContext, lost: &Arc<AtomicBool>) -> Option<Arc<Gpu>> {
    let state = creation.wgpu_render_state.as_ref()?;
    let (lost, ctx) = (lost.clone(), creation.egui_ctx.clone());
    let gpu = Gpu::of_window(state.adapter.get_info(), state.device.clone(), state.queue.clone(), move || {
        lost.store(true, Ordering::Relaxed);
        ctx.request_repaint();
    });
    gpu.device.on_uncaptured_error(Arc::new(|error| eprintln!("biscale: the window's device complains: {error}")));
    #[cfg(debug_assertions)]
    lose_for_tests(&gpu.device, &creation.egui_ctx);
    Some(Arc::new(gpu))
}

/// `BISCALE_LOSE_DEVICE=5` in a debug build: the device is lost after so many seconds, once.
#[cfg(debug_assertions)]
fn lose_for_tests(device: &wgpu::Device, ctx: &egui::Context) {
    static ONCE: AtomicBool = AtomicBool::new(true);
    let seconds = std::env::var("BISCALE_LOSE_DEVICE").ok().and_then(|text| text.parse().ok());
    if let (Some(seconds), true) = (seconds, ONCE.swap(false, Ordering::Relaxed)) {
        let (device, ctx) = (device.clone(), ctx.clone());
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_secs(seconds));
            device.destroy();
            ctx.request_repaint();
        });
    }
}

/// What eframe runs.
struct Window {
    editor: Kept,
    lost: Arc<AtomicBool>,
    gpu: Option<Arc<Gpu>>,
    first: FirstFrames,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let mut editor = self.editor.borrow_mut();
        let Some(editor) = editor.as_mut() else { return };
        let ctx = ui.ctx().clone();
        // A device that is gone says so when it is asked.
        let gone =
            self.gpu.as_ref().is_some_and(|gpu| matches!(gpu.poll(wgpu::PollType::Poll), Err(GpuError::Lost(_))));
        self.lost.fetch_or(gone, Ordering::Relaxed);
        if self.lost.load(Ordering::Relaxed) {
            // Nothing is drawn on a device that is gone: that would panic.
            ctx.send_viewport_cmd(ViewportCommand::Close);
            return;
        }
        editor.leaving |= self.first.before();
        editor.window_frame(ui);
        if self.first.are_followed() {
            self.first.after(editor.object.made.as_deref());
            if self.first.is_told_by_the_next() {
                ctx.request_repaint();
            }
        }
    }
}
