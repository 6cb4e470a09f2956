//! The editor without a window: frames run as in a window, with the same workers.

mod capture;
mod color_map;
mod cost;
mod cost_strip;
mod details;
mod disk;
mod documents;
mod errors;
mod exports;
mod interface;
mod latency;
mod methods;
mod newcomer;
mod painting;
mod pickers;
mod slab;
mod soak;
mod stability;
mod targets;

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::scene;
use crate::scene::Painted;
use eframe::egui;
use egui_kittest::Harness;

use super::document::Document;
use super::editor::Editor;

/// Locks out other tests that measure this process: its memory, or its latency.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A scene that takes little time to compute.
const QUICK: &str = r#"
[tile]
geometry = { kind = "grooves", count = 2 }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.4, f0 = 0.8 }
[light]
count = 4
[quality]
preset = "draft"
facets = 128
azimuths = 8
rings = 4
backend = "cpu"
method = "direct"
"#;

fn quick() -> Document {
    quick_with("")
}

/// The quick scene with more tables.
fn quick_with(tables: &str) -> Document {
    let scene = scene::parse(&format!("{QUICK}{tables}")).unwrap();
    let painted = Painted::default();
    Document::new(scene::LoadedScene { scene, base_dir: "".into(), name: "quick".into(), painted }, None)
}

/// Opens an editor that is so high that all unfolded sections are visible.
fn tall(document: Document) -> Harness<'static, Option<Editor>> {
    let mut harness = harness(document);
    harness.set_size(egui::vec2(1300.0, 2000.0));
    harness.run_steps(3);
    harness
}

/// Opens an editor on a document in a harness.
fn harness(document: Document) -> Harness<'static, Option<Editor>> {
    let mut document = Some(document);
    let mut harness = Harness::builder().with_size([1400.0, 1000.0]).allow_missing_glyphs().build_ui_state(
        move |ui: &mut egui::Ui, editor: &mut Option<Editor>| {
            let ctx = ui.ctx().clone();
            let editor = editor.get_or_insert_with(|| {
                let mut editor = Editor::new(&ctx, document.take().unwrap(), None, crate::cache::Cache::off());
                // Thumbnails would slow down the tests.
                editor.settings.gallery = false;
                editor
            });
            editor.window_frame(ui);
        },
        None,
    );
    harness.run_steps(3);
    harness
}

fn editor<'a>(harness: &'a mut Harness<'static, Option<Editor>>) -> &'a mut Editor {
    harness.state_mut().as_mut().unwrap()
}

/// Runs frames until a condition holds.
fn wait_until(harness: &mut Harness<'static, Option<Editor>>, is_done: impl Fn(&Editor) -> bool) {
    let start = Instant::now();
    while !is_done(editor(harness)) {
        harness.step();
        assert!(start.elapsed() < Duration::from_secs(300), "the condition does not come true");
        std::thread::sleep(Duration::from_millis(5));
    }
    harness.run_steps(3);
}

/// Runs frames until the final image of the open document is displayed.
fn settle(harness: &mut Harness<'static, Option<Editor>>) {
    let start = Instant::now();
    loop {
        harness.step();
        if !editor(harness).is_busy() {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "no image");
        std::thread::sleep(Duration::from_millis(10));
    }
}
