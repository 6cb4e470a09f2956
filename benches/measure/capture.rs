//! Errors and times of the capture of simulated points and sheets.

use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::Arc;
use std::time::Instant;

use biscale::Cancel;
use biscale::reference::photons::lobe::cell_means;
use biscale::reference::photons::{Bins, LobeSettings, TrueLobe};
use biscale::slab::capture::alpha::{FitSettings, Fitted, choose_smoothness, fit_point};
use biscale::slab::capture::bounced::Bounced;
use biscale::slab::capture::clusters::{LobeSlices, nearest, representatives};
use biscale::slab::capture::fit::{Sample, View};
use biscale::slab::capture::lobe::{LobeOptics, SlopeGrid};
use biscale::slab::capture::radiance::{DotLight, diffuse_part};
use biscale::slab::capture::simulated::{KnownPoint, Recovered, varying_sheet};
use biscale::slab::{Channel, ChannelSlab, Ndf, Profile};
use glam::{DVec2, DVec3};

/// Cells per side of lobes by photons.
const SIDE: usize = 96;

/// Prints the tables.
pub fn capture(print: &mut dyn FnMut(String)) {
    points(print);
    print(String::new());
    faces(print);
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

/// Slabs of two Beckmann faces by photons, without and with inner reflections.
fn faces(print: &mut dyn FnMut(String)) {
    print("| roughness of the faces | light | α by variances, found | error of lobes at 0, 30, 60°; all |".to_owned());
    print("|---|---|---|---|".to_owned());
    let Ok(bounced) = Bounced::new(1.5, &Cancel::default()).map(Arc::new) else { return };
    for (top, bottom) in [(0.2, 0.02), (0.02, 0.2), (0.15, 0.15), (0.3, 0.1)] {
        let face = |roughness: f64| Ndf::analytic(Profile::Beckmann, DVec2::splat(roughness), 0.0);
        // From the camera, light passes the bottom first.
        let walk_faces = (face(bottom).mirrored(), face(top).mirrored());
        let walk = ChannelSlab { top: &walk_faces.0, bottom: &walk_faces.1, channel: Channel { eta: 1.5, depth: 0.0 } };
        let lobe = |degrees: f64, photons: usize| {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            let settings = LobeSettings { side: SIDE, photons, target: 5e-3, seed: 1 };
            TrueLobe::trace(&walk, DVec3::new(sin, 0.0, cos), &settings, &Cancel::default()).ok()
        };
        let (Some(seen), new) = (lobe(45.0, 4_000_000), [0.0, 30.0, 60.0].map(|degrees| lobe(degrees, 1_000_000)))
        else {
            return;
        };
        type Part = fn(&TrueLobe) -> &Bins;
        let parts: [(&str, Part); 2] = [("single pass", |lobe| &lobe.single), ("all", |lobe| &lobe.all)];
        for (name, part) in parts {
            let bounced = if name == "all" { Some(bounced.clone()) } else { None };
            let Some((fitted, diffuse)) = of_photons(&part(&seen).values, bounced.clone()) else { continue };
            let table = bounced.map(|bounced| bounced.of_model(&fitted.model));
            let diffuse = (diffuse - fitted.scale * fitted.floor).max(0.0);
            let optics = LobeOptics::new(1.5, 0.2);
            let (mut squares, mut listed) = (0.0, Vec::new());
            for (degrees, truth) in [0.0, 30.0, 60.0_f64].into_iter().zip(&new) {
                let Some(truth) = truth else { return };
                let (sin, cos) = degrees.to_radians().sin_cos();
                let o = DVec3::new(sin, 0.0, -cos);
                let found = cell_means(SIDE, 2, |to| {
                    let i = to * DVec3::new(1.0, 1.0, -1.0);
                    let inside = table.as_ref().map_or(0.0, |table| table.read(i, o));
                    let lobe = optics.terms(i, o).map_or(0.0, |terms| fitted.model.btdf(&terms));
                    diffuse + fitted.scale * (lobe + inside)
                });
                let error = truth.relative_l2(part(truth), &found);
                squares += error * error / 3.0;
                listed.push(format!("{:.1}", 100.0 * error));
            }
            let by_variances = top * top / (top * top + bottom * bottom);
            print(format!(
                "| {top}, {bottom} | {name} | {by_variances:.2}, {:.2} | {}; {:.1} % |",
                fitted.model.alpha,
                listed.join(", "),
                100.0 * squares.sqrt()
            ));
        }
    }
}

/// The fit of a lobe over cells of (i.x, i.y) that a camera at 45° sees under 40 x 40 dots, and its diffuse part.
fn of_photons(cells: &[f64], bounced: Option<Arc<Bounced>>) -> Option<(Fitted, f64)> {
    let read = |i: DVec3| {
        let last = (SIDE - 1) as f64;
        let at = ((i.truncate() + 1.0) * (0.5 * SIDE as f64) - 0.5).clamp(DVec2::ZERO, DVec2::splat(last - 1e-9));
        let (base, t) = (at.floor(), at - at.floor());
        let first = base.y as usize * SIDE + base.x as usize;
        let row = |k: usize| (1.0 - t.x) * cells[k] + t.x * cells[k + 1];
        (1.0 - t.y) * row(first) + t.y * row(first + SIDE)
    };
    let dot = |k: u32| DVec2::new(f64::from(k % 40) - 19.5, f64::from(k / 40) - 19.5) * 0.0024 - DVec2::new(0.04, 0.0);
    let lights: Vec<DotLight> = (0..1600).map(|k| DotLight::new(dot(k), 0.04, DVec2::ZERO)).collect();
    let sample = |light: &DotLight| Sample { i: light.i, irradiance: light.irradiance, btdf: read(light.i) };
    let mut samples: Vec<Sample> = lights.iter().map(sample).collect();
    let diffuse = diffuse_part(&[&samples]);
    samples.iter_mut().for_each(|sample| sample.btdf = (sample.btdf - diffuse).max(0.0));
    let o = DVec3::new(FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2);
    let view = View { o, samples };
    let grid = SlopeGrid { side: 32, span: 0.8 };
    let settings = FitSettings { optics: LobeOptics::new(1.5, 0.2), grid, smooth: 1.0, alpha: None, bounced };
    let smooth = choose_smoothness(&[vec![view.clone()]], &settings);
    Some((fit_point(&[view], &FitSettings { smooth, ..settings })?, diffuse))
}

fn times(print: &mut dyn FnMut(String)) {
    print("| what | time |".to_owned());
    print("|---|---|".to_owned());
    let mut row = |what: &str, start: Instant, count: usize| {
        print(format!("| {what} | {:.1} ms |", start.elapsed().as_secs_f64() * 1e3 / count as f64));
    };
    let grid = SlopeGrid { side: 32, span: 0.7 };
    let settings = FitSettings { optics: LobeOptics::new(1.5, 0.2), grid, smooth: 0.1, alpha: None, bounced: None };
    let Some(known) = KnownPoint::analytic(Profile::Beckmann, DVec2::splat(0.2), 0.5) else { return };
    for (cameras, count) in [(&[45.0][..], 20), (&[45.0, 0.0], 5)] {
        let views: Vec<_> = cameras.iter().map(|theta| known.photographed(*theta, 0.01)).collect();
        let start = Instant::now();
        (0..count).for_each(|_| drop(std::hint::black_box(fit_point(&views, &settings))));
        row(&format!("fit of a point, 1600 dots, {} camera(s), one core", cameras.len()), start, count);
    }
    let mean = varying_sheet([32, 32]).mean();
    let start = Instant::now();
    let pairs = 1000;
    (0..pairs).for_each(|k| {
        let i = DVec3::new(1e-4 * f64::from(k), 0.0, 1.0).normalize_or(DVec3::Z);
        std::hint::black_box(mean.btdf(i, DVec3::NEG_Z));
    });
    let ns = start.elapsed().as_secs_f64() * 1e9 / (f64::from(pairs) * mean.len() as f64);
    print(format!("| mean of a sheet, per pair and representative, one core | {ns:.0} ns |"));
    let mut row = |what: &str, start: Instant, count: usize| {
        print(format!("| {what} | {:.1} ms |", start.elapsed().as_secs_f64() * 1e3 / count as f64));
    };
    let cells = 256;
    let value = |k: usize| ((k % cells) as f32 * (1.0 + (k / cells) as f32 * 1e-4)).sin();
    let slices = LobeSlices { cells, values: (0..36_000 * cells).map(value).collect() };
    let all: Vec<usize> = (0..slices.count()).collect();
    let start = Instant::now();
    let chosen = representatives(&slices, &all, 360, 1, &Cancel::default()).unwrap_or_default();
    row("360 representatives of 36,000 slices", start, 1);
    let others = LobeSlices { cells, values: chosen.iter().flat_map(|k| slices.slice(*k)).copied().collect() };
    let start = Instant::now();
    std::hint::black_box(nearest(&slices, &others, 6));
    row("six nearest of 360 for 36,000 slices", start, 1);
}
