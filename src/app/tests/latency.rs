//! Latency from an edit to the new image: a measurement that runs only by name.

use std::time::{Duration, Instant};

use super::{editor, harness};
use crate::app::document::Document;
use crate::app::worker::Grade;
use crate::scene::Scene;

/// Maximum wait for the final image.
const MAX_WAIT: Duration = Duration::from_secs(45);

/// Returns the median milliseconds from an edit to the draft, the refined and the final image; NaN for an image that came
/// too late. `edit` receives the number of the edit.
fn latency_ms(name: &str, backend: &str, edits: usize, edit: impl Fn(&mut Scene, usize)) -> (f64, f64, f64) {
    let mut harness = harness(Document::open(name).unwrap());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.quality.backend = backend.to_owned();
    editor(&mut harness).document.edit(scene);
    harness.step();
    let opened = Instant::now();
    while editor(&mut harness).is_busy() && opened.elapsed() < MAX_WAIT {
        harness.step();
        std::thread::sleep(Duration::from_millis(10));
    }
    let mut times = Vec::new();
    for number in 0..edits {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        edit(&mut scene, number);
        let start = Instant::now();
        editor(&mut harness).document.edit(scene);
        let version = editor(&mut harness).document.version();
        let mut arrival_ms = [None; 3];
        while arrival_ms[2].is_none() {
            harness.step();
            if let Some(preview) =
                editor(&mut harness).object.preview.as_ref().filter(|preview| preview.version == version)
            {
                let at = match preview.grade {
                    Grade::Draft => 0,
                    Grade::Refining => 1,
                    Grade::Final => 2,
                };
                arrival_ms[at].get_or_insert(start.elapsed().as_secs_f64() * 1e3);
            }
            if start.elapsed() > MAX_WAIT {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        times.push(arrival_ms);
    }
    let median = |at: usize| {
        let mut found: Vec<f64> = times.iter().filter_map(|arrival_ms| arrival_ms[at]).collect();
        found.sort_by(f64::total_cmp);
        found.get(found.len() / 2).copied().unwrap_or(f64::NAN)
    };
    (median(0), median(1), median(2))
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- latency; one scene without BISCALE_TABLE=1"]
fn latency_from_a_slider_on_the_scenes_of_table_4() {
    let _alone = super::alone();
    println!(
        "scene            backend draft  refined (coarse)  final   [ms, median of 3 geometry edits; of 1 on the GPU]"
    );
    let all = std::env::var_os("BISCALE_TABLE").is_some();
    let scenes = ["table4_cup", "table4_plate", "table4_teapot", "table4_pillow", "table4_skirt"];
    for name in &scenes[..if all { 5 } else { 1 }] {
        for (backend, edits) in [("cpu", 3), ("gpu", 1)] {
            let nudge = |scene: &mut Scene, _| drop(scene.nudge_geometry().unwrap());
            let (draft, coarse, last) = latency_ms(name, backend, edits, nudge);
            println!("{name:<16} {backend:<7} {draft:>5.0} {coarse:>12.0} {last:>12.0}");
            assert!(draft.is_finite());
        }
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
        let (draft, coarse, last) = latency_ms(name, "cpu", 9, drag);
        println!("| `{name}` | {draft:.0} ms | {:.1} s | {:.1} s |", coarse * 1e-3, last * 1e-3);
        assert!(draft.is_finite());
    }
}
