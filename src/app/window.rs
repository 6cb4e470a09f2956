//! The editor's window. If a window cannot be opened, the error says what is missing. If the window's GPU is lost, the
//! editor opens a new window with the same document.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::base::print_on_stderr;
use crate::gpu::{Gpu, GpuError};
use anyhow::{Result, anyhow};
use eframe::egui::{self, Context, ViewportBuilder, ViewportCommand};

use super::document::{Document, EditorSettings};
use super::editor::Editor;
use super::event_queue::EventQueue;
use super::start_times::{FirstFrames, StartTimes};
use super::worker::{GpuShare, Screen};
use crate::cli::cache;

const NO_WINDOW: &str = "the editor needs a desktop (X11 or Wayland) and a Vulkan driver. \
    Debian, Ubuntu: `apt install mesa-vulkan-drivers libxkbcommon-x11-0 libwayland-client0`; \
    Fedora: `dnf install mesa-vulkan-drivers libxkbcommon-x11 libwayland-client`. \
    Without a desktop, `biscale render SCENE -o image.png` renders the same image";

/// Minimum lifetime of a lost window. If a window is lost sooner, no new one is opened.
const MIN_LIFETIME: Duration = Duration::from_secs(3);

/// The editor, which outlives its windows.
type SharedEditor = Rc<RefCell<Option<Editor>>>;

/// Opens the editor on a scene: a file or the name of a shipped scene.
///
/// # Errors
/// An unreadable scene, no display, or no adapter; the message names a remedy.
pub fn run(scene: Option<&str>, times: StartTimes) -> Result<()> {
    let document = Document::open(scene.unwrap_or("default"))?;
    times.note("scene read");
    // The first image is computed while desktop, GPU and window are being opened.
    let ctx = context();
    let mut editor = Editor::new(&ctx, document, EditorSettings::folder(), cache::open());
    editor.request_first_image();
    let mut first = Some((ctx, editor));
    let shared = SharedEditor::default();
    loop {
        let (opened_at, lost) = (Instant::now(), Arc::new(AtomicBool::new(false)));
        let opened = catch_unwind(AssertUnwindSafe(|| open(&shared, &lost, first.take(), times)));
        let has_left = shared.borrow().as_ref().is_none_or(|editor| editor.leaving);
        match opened {
            Ok(Ok(())) if has_left => {
                if let Some(editor) = shared.borrow_mut().take() {
                    editor.finish();
                }
                return Ok(());
            }
            Ok(Ok(())) if lost.load(Ordering::Relaxed) && opened_at.elapsed() > MIN_LIFETIME => {
                print_on_stderr("biscale: the window's GPU was lost; a new window is opened");
            }
            Ok(Ok(())) => return Err(give_up(&shared, "it closed by itself")),
            Ok(Err(error)) if shared.borrow().is_none() => return Err(anyhow!("{NO_WINDOW} ({error})")),
            Ok(Err(error)) => return Err(give_up(&shared, &error.to_string())),
            Err(_) => {
                let error = give_up(&shared, "a fault in the program");
                // After a panic, the state of this process's windows is undefined, so a new process is started.
                if opened_at.elapsed() > MIN_LIFETIME && start_again().is_ok() {
                    print_on_stderr(format_args!("biscale: {error}; a new editor is started"));
                    return Ok(());
                }
                return Err(error);
            }
        }
    }
}

/// Runs one window until it closes.
fn open(
    shared: &SharedEditor,
    lost: &Arc<AtomicBool>,
    first: Option<(Context, Editor)>,
    times: StartTimes,
) -> eframe::Result {
    let settings = EditorSettings::load(EditorSettings::folder().as_deref());
    let options = eframe::NativeOptions {
        wgpu_options: wgpu_options(times),
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
    let (shared, lost) = (shared.clone(), lost.clone());
    let (ctx, first) = first.map_or_else(|| (context(), None), |(ctx, editor)| (ctx, Some(editor)));
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        times.note("device and the interface's pipelines built");
        let gpu = watch_device(creation, &lost);
        let mut editor = shared.borrow_mut();
        match (editor.as_mut(), first) {
            (Some(editor), _) => editor.move_to(&creation.egui_ctx),
            (None, first) => *editor = first,
        }
        if let (Some(editor), Some(gpu_share)) = (editor.as_ref(), gpu_share(creation, gpu.as_ref())) {
            editor.share_gpu(gpu_share);
        }
        drop(editor);
        times.note("editor created");
        Ok(Box::new(Window {
            editor: shared,
            lost,
            gpu,
            first: FirstFrames::new(times),
            events: EventQueue::default(),
        }))
    });
    eframe::run_native_ext("biscale", options, Some(ctx), create)
}

/// Creates a context with eframe's settings, for a window that is opened later.
fn context() -> Context {
    let ctx = Context::default();
    ctx.set_embed_viewports(false);
    if let Ok(passes) = 2.try_into() {
        ctx.options_mut(|options| options.max_passes = passes);
    }
    ctx
}

/// Collects the GPUs that the window's wgpu instance found.
fn gpu_share(creation: &eframe::CreationContext, gpu: Option<&Arc<Gpu>>) -> Option<GpuShare> {
    let state = creation.wgpu_render_state.as_ref()?;
    let adapters: Vec<_> = state.available_adapters.iter().map(wgpu::Adapter::get_info).collect();
    let only_software = adapters.iter().all(|adapter| adapter.device_type == wgpu::DeviceType::Cpu);
    Some(GpuShare {
        only_software: adapters.first().filter(|_| only_software).map(|adapter| adapter.name.clone()),
        screen: gpu.map(|gpu| Screen::new(gpu.clone(), state.renderer.clone())),
    })
}

/// Requests a device that can also render images, and prints when the adapter is found.
fn wgpu_options(times: StartTimes) -> eframe::egui_wgpu::WgpuConfiguration {
    let mut options = eframe::egui_wgpu::WgpuConfiguration::default();
    if let eframe::egui_wgpu::WgpuSetup::CreateNew(setup) = &mut options.wgpu_setup {
        setup.device_descriptor = Arc::new(move |adapter| {
            times.note("window and adapter found");
            Gpu::request(adapter)
        });
    }
    options
}

/// Starts a new editor process, which offers the documents of the recovery file.
fn start_again() -> std::io::Result<()> {
    std::process::Command::new(std::env::current_exe()?).arg("edit").spawn().map(drop)
}

/// Writes the document to the recovery file, which the next start offers, and returns the error to report.
fn give_up(shared: &SharedEditor, why: &str) -> anyhow::Error {
    // After a panic during a borrow, the editor stays borrowed; the last recovery file remains.
    let saved = shared.try_borrow().ok().and_then(|editor| editor.as_ref().map(Editor::write_recovery));
    if let Ok(mut editor) = shared.try_borrow_mut()
        && let Some(editor) = editor.take()
    {
        // Dropping the editor would remove the recovery file.
        std::mem::forget(editor);
    }
    let recovery = match saved {
        Some(Ok(())) => "Unsaved work is saved, and the next start offers it",
        Some(Err(_)) | None => "All but the last seconds of work is saved, and the next start offers it",
    };
    anyhow!("the window was lost ({why}). {recovery}")
}

/// Handles errors of the window's device; wgpu's default handler would end the program.
fn watch_device(creation: &eframe::CreationContext, lost: &Arc<AtomicBool>) -> Option<Arc<Gpu>> {
    let state = creation.wgpu_render_state.as_ref()?;
    let (lost, ctx) = (lost.clone(), creation.egui_ctx.clone());
    let gpu = Gpu::from_window(state.adapter.get_info(), state.device.clone(), state.queue.clone(), move || {
        lost.store(true, Ordering::Relaxed);
        ctx.request_repaint();
    });
    let report = |error: wgpu::Error| print_on_stderr(format_args!("biscale: error of the window's GPU: {error}"));
    gpu.device.on_uncaptured_error(Arc::new(report));
    #[cfg(debug_assertions)]
    lose_for_tests(&gpu.device, &creation.egui_ctx);
    Some(Arc::new(gpu))
}

/// Destroys the device once, after the number of seconds in `BISCALE_LOSE_DEVICE`, in a debug build.
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

/// The application that eframe runs.
struct Window {
    editor: SharedEditor,
    lost: Arc<AtomicBool>,
    gpu: Option<Arc<Gpu>>,
    first: FirstFrames,
    events: EventQueue,
}

impl eframe::App for Window {
    fn raw_input_hook(&mut self, ctx: &Context, raw_input: &mut egui::RawInput) {
        if self.events.split(&mut raw_input.events) {
            ctx.request_repaint();
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.events.taken();
        let mut editor = self.editor.borrow_mut();
        let Some(editor) = editor.as_mut() else { return };
        let ctx = ui.ctx().clone();
        // A lost device reports its loss when it is polled.
        let is_lost =
            self.gpu.as_ref().is_some_and(|gpu| matches!(gpu.poll(wgpu::PollType::Poll), Err(GpuError::Lost(_))));
        self.lost.fetch_or(is_lost, Ordering::Relaxed);
        if self.lost.load(Ordering::Relaxed) {
            // Drawing on a lost device would panic.
            ctx.send_viewport_cmd(ViewportCommand::Close);
            return;
        }
        editor.leaving |= self.first.before();
        editor.window_frame(ui);
        if self.first.are_timed() {
            self.first.after(editor.object.preview.as_deref());
            if self.first.needs_next_frame() {
                ctx.request_repaint();
            }
        }
    }
}
