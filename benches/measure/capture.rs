//! Errors and times of the capture of simulated points and sheets.

use std::time::Instant;

use biscale::Cancel;
use biscale::slab::Profile;
use biscale::slab::capture::alpha::{FitSettings, fit_point};
use biscale::slab::capture::clusters::{Slices, nearest, representatives};
use biscale::slab::capture::lobe::{Optics, SlopeGrid};
use biscale::slab::capture::simulated::{KnownPoint, Recovered};
use glam::DVec2;

/// Prints the tables.
pub fn capture(print: &mut dyn FnMut(String)) {
    points(print);
    print(String::new());
    times(print);
}

/// The α and the error of lobes at new views that come back, per noise.
fn points(print: &mut dyn FnMut(String)) {
    print("| slopes | cameras | α | α found at noise 0, 1, 5 % | error of lobes at 0, 30 and 60° |".to_owned());
    print("|---|---|---|---|---|".to_owned());
    type Make = fn(f64) -> Option<KnownPoint>;
    let kinds: [(&str, &[f64], Make); 5] = [
        ("Beckmann 0.2", &[45.0], |alpha| KnownPoint::analytic(Profile::Beckmann, DVec2::splat(0.2), alpha)),
        ("Beckmann 0.1 x 0.3", &[45.0], |alpha| KnownPoint::analytic(Profile::Beckmann, DVec2::new(0.1, 0.3), alpha)),
        ("Beckmann 0.3 x 0.1", &[45.0], |alpha| KnownPoint::analytic(Profile::Beckmann, DVec2::new(0.3, 0.1), alpha)),
        ("GGX 0.2", &[45.0], |alpha| KnownPoint::analytic(Profile::Ggx, DVec2::splat(0.2), alpha)),
        ("sawtooth", &[45.0, 0.0], KnownPoint::sawtooth),
    ];
    for (name, cameras, make) in kinds {
        for alpha in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let Some(known) = make(alpha) else { continue };
            let found: Vec<Recovered> =
                [0.0, 0.01, 0.05].iter().filter_map(|noise| known.recovered(cameras, *noise)).collect();
            let list = |value: &dyn Fn(&Recovered) -> String| found.iter().map(value).collect::<Vec<_>>().join(", ");
            print(format!(
                "| {name} | {} | {alpha} | {} | {} % |",
                cameras.len(),
                list(&|found| format!("{:.2}", found.fitted.model.alpha)),
                list(&|found| format!("{:.1}", 100.0 * found.error))
            ));
        }
    }
}

fn times(print: &mut dyn FnMut(String)) {
    print("| what | time |".to_owned());
    print("|---|---|".to_owned());
    let mut row = |what: &str, start: Instant, count: usize| {
        print(format!("| {what} | {:.1} ms |", start.elapsed().as_secs_f64() * 1e3 / count as f64));
    };
    let grid = SlopeGrid { side: 32, span: 0.7 };
    let settings = FitSettings { optics: Optics::new(1.5, 0.2), grid, smooth: 0.1, alpha: None };
    let Some(known) = KnownPoint::analytic(Profile::Beckmann, DVec2::splat(0.2), 0.5) else { return };
    for (cameras, count) in [(&[45.0][..], 20), (&[45.0, 0.0], 5)] {
        let views: Vec<_> = cameras.iter().map(|theta| known.photographed(*theta, 0.01)).collect();
        let start = Instant::now();
        (0..count).for_each(|_| drop(std::hint::black_box(fit_point(&views, &settings))));
        row(&format!("fit of a point, 1600 dots, {} camera(s), one core", cameras.len()), start, count);
    }
    let cells = 256;
    let value = |k: usize| ((k % cells) as f32 * (1.0 + (k / cells) as f32 * 1e-4)).sin();
    let slices = Slices { cells, values: (0..36_000 * cells).map(value).collect() };
    let all: Vec<usize> = (0..slices.count()).collect();
    let start = Instant::now();
    let chosen = representatives(&slices, &all, 360, 1, &Cancel::default()).unwrap_or_default();
    row("360 representatives of 36,000 slices", start, 1);
    let others = Slices { cells, values: chosen.iter().flat_map(|k| slices.slice(*k)).copied().collect() };
    let start = Instant::now();
    std::hint::black_box(nearest(&slices, &others, 6));
    row("six nearest of 360 for 36,000 slices", start, 1);
}
