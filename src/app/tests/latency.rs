//! Latency from an edit to the new image: a measurement that runs only by name.

use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use egui_kittest::Harness;

use super::{editor, harness};
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::worker::Grade;
use crate::scene::Scene;

/// Maximum wait for the final image.
const MAX_WAIT: Duration = Duration::from_secs(45);

/// Times of images after an edit, medians in milliseconds; NaN for an image that came too late.
struct Latency {
    draft: f64,
    refined: f64,
    last: f64,
    /// Mean radiance of the draft over that of the final image, less 1; the largest of all edits.
    brightness_step: f64,
}

/// The frames of a window, which are drawn only on request. The workers have the cores for the rest of the time.
struct Frames {
    requests: Receiver<Instant>,
    /// The time of the next frame, if one was requested.
    due: Option<Instant>,
}

impl Frames {
    fn of(harness: &Harness<'static, Option<Editor>>) -> Self {
        let (sender, requests) = channel();
        harness.ctx.set_request_repaint_callback(move |request| {
            // Sending fails only if the measurement has ended.
            let _ = sender.send(Instant::now() + request.delay.min(MAX_WAIT));
        });
        Self { requests, due: None }
    }

    /// Requests a frame now, as an input does.
    fn request(&mut self) {
        self.due = Some(Instant::now());
    }

    /// Waits until a frame is due, and draws it.
    fn draw(&mut self, harness: &mut Harness<'static, Option<Editor>>) {
        loop {
            let wait = self.due.map_or(MAX_WAIT, |due| due.saturating_duration_since(Instant::now()));
            let Ok(request) = self.requests.recv_timeout(wait) else { break };
            self.due = Some(self.due.map_or(request, |due| due.min(request)));
        }
        self.due = None;
        harness.step();
    }
}

/// Opens a scene in a window of 1440 x 900 points and waits for its final image.
fn opened(name: &str) -> (Harness<'static, Option<Editor>>, Frames) {
    let mut harness = harness(Document::open(name).unwrap());
    harness.set_size(eframe::egui::vec2(1440.0, 900.0));
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    "auto".clone_into(&mut scene.quality.backend);
    editor(&mut harness).document.edit(scene);
    let mut frames = Frames::of(&harness);
    harness.step();
    let opened = Instant::now();
    while editor(&mut harness).is_busy() && opened.elapsed() < MAX_WAIT {
        frames.draw(&mut harness);
    }
    (harness, frames)
}

/// Edits a scene as a slider does, and waits for all images after each edit. `edit` receives the number of the edit.
fn latency(name: &str, edits: usize, edit: impl Fn(&mut Scene, usize)) -> Latency {
    let (mut harness, mut frames) = opened(name);
    let (mut times, mut brightness_step) = (Vec::new(), 0.0_f64);
    for number in 0..edits {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        edit(&mut scene, number);
        let start = Instant::now();
        editor(&mut harness).document.edit(scene);
        frames.request();
        let version = editor(&mut harness).document.version();
        let (mut arrival_ms, mut means) = ([None; 3], [None; 3]);
        while arrival_ms[2].is_none() {
            frames.draw(&mut harness);
            if let Some(preview) =
                editor(&mut harness).object.preview.as_ref().filter(|preview| preview.version == version)
            {
                let at = match preview.grade {
                    Grade::Draft => 0,
                    Grade::Refining => 1,
                    Grade::Final => 2,
                };
                arrival_ms[at].get_or_insert(start.elapsed().as_secs_f64() * 1e3);
                means[at] = preview.radiance.as_ref().map(|image| {
                    image.pixels.iter().map(|pixel| f64::from(pixel.element_sum())).sum::<f64>()
                        / image.pixels.len() as f64
                });
            }
            if start.elapsed() > MAX_WAIT {
                break;
            }
        }
        // Some final images follow the draft directly.
        arrival_ms[1] = arrival_ms[1].or(arrival_ms[2]);
        times.push(arrival_ms);
        if let [Some(draft), _, Some(last)] = means {
            brightness_step = brightness_step.max((draft / last - 1.0).abs());
        }
    }
    let median = |at: usize| {
        let mut found: Vec<f64> = times.iter().filter_map(|arrival_ms| arrival_ms[at]).collect();
        found.sort_by(f64::total_cmp);
        found.get(found.len() / 2).copied().unwrap_or(f64::NAN)
    };
    Latency { draft: median(0), refined: median(1), last: median(2), brightness_step }
}

/// Images per second while the camera turns: each image is followed by the next turn at once.
fn images_per_second(name: &str) -> f64 {
    const IMAGES: u32 = 40;
    let (mut harness, mut frames) = opened(name);
    let (start, mut shown) = (Instant::now(), 0);
    while shown < IMAGES && start.elapsed() < MAX_WAIT {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        scene.camera.get_or_insert_default().azimuth_deg += 2.0;
        editor(&mut harness).document.edit(scene);
        frames.request();
        let version = editor(&mut harness).document.version();
        while editor(&mut harness).object.preview.as_ref().is_none_or(|preview| preview.version < version)
            && start.elapsed() < MAX_WAIT
        {
            frames.draw(&mut harness);
        }
        shown += 1;
    }
    f64::from(shown) / start.elapsed().as_secs_f64()
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- latency; one scene without BISCALE_TABLE=1"]
fn latency_from_a_slider_on_the_scenes_of_table_4() {
    let _alone = super::alone();
    println!("| scene | draft | refined | final | mean of the draft against the final image | turning camera |");
    println!("|---|---|---|---|---|---|");
    let all = std::env::var_os("BISCALE_TABLE").is_some();
    let scenes = ["table4_cup", "table4_plate", "table4_teapot", "table4_pillow", "table4_skirt", "default"];
    for name in &scenes[..if all { scenes.len() } else { 1 }] {
        let nudge = |scene: &mut Scene, _| drop(scene.nudge_geometry().unwrap());
        let Latency { draft, refined, last, brightness_step } = latency(name, if all { 7 } else { 2 }, nudge);
        println!(
            "| `{name}` | {draft:.0} ms | {:.2} s | {:.2} s | within {:.1} % | {:.0} images/s |",
            refined * 1e-3,
            last * 1e-3,
            100.0 * brightness_step,
            images_per_second(name)
        );
        assert!(draft.is_finite());
    }
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- latency-stops; one scene without BISCALE_TABLE=1"]
fn latency_from_a_dragged_stop_of_a_colour_map() {
    let _alone = super::alone();
    println!("| scene | draft | refined | final |\n|---|---|---|---|");
    let all = std::env::var_os("BISCALE_TABLE").is_some();
    let scenes =
        ["fig1b_heights_color_map", "fig1a_noise_color_map", "fig1c_slopes_color_map", "fig11_scales_color_map"];
    // The last stop goes to and fro, as under a hand.
    let drag = |scene: &mut Scene, number: usize| {
        let map = scene.color_map.as_mut().unwrap();
        map.layer[0].stops.last_mut().unwrap().value += if number.is_multiple_of(2) { 0.05 } else { -0.04 };
    };
    for name in &scenes[..if all { scenes.len() } else { 1 }] {
        let Latency { draft, refined, last, .. } = latency(name, if all { 5 } else { 2 }, drag);
        println!("| `{name}` | {draft:.0} ms | {:.2} s | {:.1} s |", refined * 1e-3, last * 1e-3);
        assert!(draft.is_finite());
    }
}
