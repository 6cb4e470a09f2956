//! `biscale transmit` computes the lobe that a slab makes of light from one direction, and where the light goes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use glam::{DVec2, DVec3};
use serde::Serialize;

use super::watch::Watch;
use super::{TransmitArgs, TransmitMethod, check_outputs, print_json};
use crate::base::{Cancel, Error, InputError, replace_file};
use crate::pipeline::SlabOutcome;
use crate::reference::photons::{LobeSettings, Totals, TrueLobe};
use crate::scene::{LoadedScene, Switch};
use crate::slab::{ChannelSlab, DiscLobe, Method, Slab, walter};

/// Cells per side of the square around the disc.
const SIDE: usize = 96;
/// Steps of the lobe in the plane of incidence, from horizon to horizon.
const STEPS: usize = 360;

/// Parses a polar angle above the face [degrees].
pub fn parse_theta(text: &str) -> std::result::Result<f64, String> {
    let angle = text.parse::<f64>().ok().filter(|angle| (0.0..=90.0).contains(angle));
    angle.ok_or_else(|| format!("found `{text}`, expected degrees from 0 to 90"))
}

/// Parses an azimuth [degrees].
pub fn parse_phi(text: &str) -> std::result::Result<f64, String> {
    let angle = text.parse::<f64>().ok().filter(|angle| angle.is_finite() && angle.abs() <= 1e6);
    angle.ok_or_else(|| format!("found `{text}`, expected degrees"))
}

/// Parts of the incident flux; `None` for parts that the method does not know.
#[derive(Debug, Clone, Copy, Default)]
struct Parts {
    transmitted: DVec3,
    reflected: Option<DVec3>,
    absorbed: Option<DVec3>,
    straight: DVec3,
    first_arrival_tir: Option<DVec3>,
    after_bounces: Option<DVec3>,
    /// Light that masking removes, where it is in none of the others.
    masked: Option<DVec3>,
}

impl Parts {
    fn named(&self) -> [(&'static str, Option<DVec3>); 7] {
        [
            ("transmitted", Some(self.transmitted)),
            ("reflected", self.reflected),
            ("absorbed", self.absorbed),
            ("straight", Some(self.straight)),
            ("first_arrival_tir", self.first_arrival_tir),
            ("after_bounces", self.after_bounces),
            ("masked", self.masked),
        ]
    }
}

/// A lobe with its totals.
struct Transmitted {
    lobe: DiscLobe,
    /// BTDF in the plane of incidence, from the horizon on the side of the light to the other.
    plane: Vec<(DVec3, DVec3)>,
    totals: Parts,
    /// Standard error of the transmitted part, and of each cell.
    standard_error: Option<f64>,
    cell_errors: Option<Vec<DVec3>>,
    rel_l2: Option<f64>,
}

#[derive(Serialize)]
struct Moments {
    mean: [f64; 2],
    deviation: [f64; 2],
}

#[derive(Serialize)]
struct Report {
    #[serde(skip_serializing_if = "Option::is_none")]
    output: Option<String>,
    theta_i_deg: f64,
    phi_i_deg: f64,
    method: &'static str,
    totals: serde_json::Map<String, serde_json::Value>,
    rgb: serde_json::Map<String, serde_json::Value>,
    lobe: Moments,
    standard_error: Option<f64>,
    rel_l2: Option<f64>,
    warnings: Vec<String>,
}

#[derive(Clone, Copy)]
enum OutputKind {
    Csv,
    Png,
}

pub fn run(args: &TransmitArgs) -> Result<()> {
    let kind = args.output.as_deref().map(kind).transpose()?;
    let (loaded, ()) = args.scene.open(|loaded| {
        if loaded.scene.slab.is_none() {
            let error = InputError::new("slab", "nothing", "a table [slab]: without it a scene transmits no light");
            return Err(Error::from(error.in_file(&args.scene.scene)).into());
        }
        if args.method.is_some_and(|method| method != TransmitMethod::Dual) {
            crate::pipeline::require_faces(loaded, "a method other than `dual`")?;
        }
        if args.output.as_deref() == Some(Path::new("-")) {
            return Err(Error::from(InputError::new("output", "`-`", "a file that ends in .csv or .png")).into());
        }
        check_outputs(&args.scene.scene, loaded, &[], args.output.iter())
    })?;
    let mut pipeline = crate::gpu::pipeline();
    let watch = Watch::new(args.scene.quiet);
    let cancel = watch.cancel();
    pipeline.set_cancel(cancel.clone());
    let outcome = pipeline.slab(&loaded)?;
    args.scene.warn(&outcome.health);
    let i = direction(args);
    let (result, name) = match args.method {
        Some(TransmitMethod::Truth) => (truth(&loaded, &outcome, i, &cancel)?, "truth"),
        Some(TransmitMethod::Walter) => (of_walter(&outcome.slab, i), "walter"),
        Some(TransmitMethod::Dual) => (model(&Slab { method: Method::Dual, ..(*outcome.slab).clone() }, i), "dual"),
        Some(TransmitMethod::Faces) => {
            (model(&(*outcome.slab).clone().by_faces(outcome.settings.facets.max(1)), i), "faces")
        }
        None => (model(&outcome.slab, i), if outcome.slab.method == Method::Dual { "dual" } else { "faces" }),
    };
    drop(watch);
    cancel.check()?;
    crate::base::require_finite(&result.lobe.values)?;
    if let (Some(path), Some(kind)) = (&args.output, kind) {
        match kind {
            OutputKind::Csv => replace_file(path, csv(&result).as_bytes())?,
            OutputKind::Png => replace_file(path, &png(&result)?)?,
        }
    }
    if args.scene.json {
        print_json(&report(args, &result, name, outcome.health.warnings))?;
    }
    Ok(())
}

fn direction(args: &TransmitArgs) -> DVec3 {
    let (sin, cos) = args.theta_i.to_radians().sin_cos();
    let (y, x) = args.phi_i.to_radians().sin_cos();
    DVec3::new(sin * x, sin * y, if args.theta_i >= 90.0 { 0.0 } else { cos })
}

fn kind(path: &Path) -> Result<OutputKind, Error> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "csv" => Ok(OutputKind::Csv),
        "png" => Ok(OutputKind::Png),
        other => {
            let found = format!("the ending .{other}");
            Err(InputError::new("output", found, "a name that ends in .csv or .png")
                .in_file(PathBuf::from(path))
                .into())
        }
    }
}

/// Directions below in the plane of incidence.
fn plane_directions(i: DVec3) -> impl Iterator<Item = DVec3> {
    let along = -i.truncate().try_normalize().unwrap_or(DVec2::X);
    (0..=STEPS).map(move |k| {
        let theta = (k as f64 / STEPS as f64 - 0.5) * std::f64::consts::PI;
        (theta.sin() * along).extend(-theta.cos().max(0.0))
    })
}

fn model(slab: &Slab, i: DVec3) -> Transmitted {
    let lobe = DiscLobe::transmitted(slab, i, SIDE);
    let [straight, mirrored] = slab.straight(i);
    let left = DVec3::ONE - slab.optics.diffuse;
    let part = |of: &dyn Fn(&crate::slab::Parts) -> f64| -> Option<DVec3> {
        let parts = DVec3::from_array(slab.parts(i)?.map(|parts| of(&parts)));
        Some(left * DVec3::select(slab.optics.eta.cmpne(DVec3::ONE), parts, DVec3::ZERO))
    };
    let clear = DVec3::select(slab.optics.eta.cmpeq(DVec3::ONE), left - straight, DVec3::ZERO);
    let totals = Parts {
        transmitted: lobe.total() + straight,
        reflected: Some(DiscLobe::reflected(slab, i, SIDE).total() + mirrored),
        absorbed: part(&|parts| parts.absorbed).map(|absorbed| absorbed + clear),
        straight,
        first_arrival_tir: part(&|parts| parts.first_total_reflection),
        after_bounces: part(&|parts| parts.after_bounces),
        // Half of it is in the transmitted part, and half in the reflected one.
        masked: None,
    };
    let row = slab.row(i);
    let plane = plane_directions(i).map(|o| (o, row.btdf(o))).collect();
    Transmitted { lobe, plane, totals, standard_error: None, cell_errors: None, rel_l2: None }
}

/// The lobe of one rough face, as Fig. 5 of Dai et al. 2009 compares it: the rougher of both.
fn of_walter(slab: &Slab, i: DVec3) -> Transmitted {
    let face = if slab.top.deviation() >= slab.bottom.deviation() { &slab.top } else { &slab.bottom };
    let value = |o: DVec3| slab.optics.per_channel(|channel| walter(face, i, o, channel.eta));
    let eta = slab.optics.eta.max_element();
    let lobe = DiscLobe::new(SIDE, -i.truncate() / eta, ((eta - 1.0) / eta * face.deviation(), 0.0), true, value);
    let totals = Parts { transmitted: lobe.total(), ..Parts::default() };
    let plane = plane_directions(i).map(|o| (o, value(o))).collect();
    Transmitted { lobe, plane, totals, standard_error: None, cell_errors: None, rel_l2: None }
}

/// Largest number of photons of a truth.
const PHOTONS: usize = 4_000_000;

fn truth(loaded: &LoadedScene, outcome: &SlabOutcome, i: DVec3, cancel: &Cancel) -> Result<Transmitted> {
    let slab = &outcome.slab;
    let bounces = loaded.scene.slab.as_ref().is_some_and(|slab| slab.bounces == Switch::On);
    let settings = LobeSettings { side: SIDE, photons: PHOTONS, target: 0.01, seed: outcome.settings.seed };
    let mut lobes: Vec<TrueLobe> = Vec::new();
    let mut of_channel = [0; 3];
    let mut failed = None;
    slab.optics.per_channel_indexed(|k, channel| {
        let walk = ChannelSlab { top: &slab.top, bottom: &slab.bottom, channel };
        match TrueLobe::trace(&walk, i, &settings, cancel) {
            Ok(lobe) => lobes.push(lobe),
            Err(error) => failed = Some(error),
        }
        let alike = |other: usize| slab.optics.channel(other) == channel;
        (k..3).filter(|other| alike(*other)).for_each(|other| of_channel[other] = lobes.len().saturating_sub(1));
        0.0
    });
    if let Some(error) = failed {
        return Err(error.into());
    }
    let rgb = |value: &dyn Fn(&TrueLobe) -> f64| DVec3::from_array(of_channel.map(|k| value(&lobes[k])));
    let (diffuse, left) = (slab.optics.diffuse, DVec3::ONE - slab.optics.diffuse);
    let bins = |lobe: &TrueLobe, k: usize| {
        let bins = if bounces { &lobe.all } else { &lobe.single };
        (bins.values[k], bins.variances[k])
    };
    let is_inside = |k: usize| cell(k).length_squared() < 1.0;
    let spread = |k: usize| if is_inside(k) { diffuse / std::f64::consts::PI } else { DVec3::ZERO };
    let values = (0..SIDE * SIDE).map(|k| left * rgb(&|lobe| bins(lobe, k).0) + spread(k)).collect();
    let cell_errors = (0..SIDE * SIDE).map(|k| left * rgb(&|lobe| bins(lobe, k).1.sqrt())).collect();
    let lobe = DiscLobe { side: SIDE, values };
    let of_flux = |value: &dyn Fn(&TrueLobe) -> f64| left * rgb(value);
    let single = of_flux(&|lobe| lobe.totals.single_pass.value);
    let all = of_flux(&|lobe| lobe.totals.transmitted.value);
    let totals = Parts {
        transmitted: diffuse + if bounces { all } else { single },
        reflected: Some(of_flux(&|lobe| {
            let Totals { reflected, first_reflected, .. } = lobe.totals;
            if bounces { reflected.value } else { first_reflected.value }
        })),
        absorbed: Some(of_flux(&|lobe| lobe.totals.absorbed.value)),
        straight: of_flux(&|lobe| lobe.totals.straight.value),
        first_arrival_tir: Some(of_flux(&|lobe| lobe.totals.first_total_reflection.value)),
        after_bounces: Some(all - single),
        masked: Some(of_flux(&|lobe| lobe.totals.masked.value)),
    };
    let model = DiscLobe::transmitted(slab, i, SIDE);
    let red: Vec<f64> = model.values.iter().map(|value| value.x).collect();
    let against = if bounces { &lobes[0].all } else { &lobes[0].single };
    let rel_l2 = Some(lobes[0].relative_l2(against, &red));
    let plane = plane_directions(i).map(|o| (o, lobe.values[nearest_cell(o.truncate())])).collect();
    let standard_error = Some(of_flux(&|lobe| lobe.totals.transmitted.standard_error).element_sum() / 3.0);
    Ok(Transmitted { lobe, plane, totals, standard_error, cell_errors: Some(cell_errors), rel_l2 })
}

/// Middle of a cell.
fn cell(k: usize) -> DVec2 {
    (DVec2::new((k % SIDE) as f64, (k / SIDE) as f64) + 0.5) * (2.0 / SIDE as f64) - 1.0
}

fn nearest_cell(at: DVec2) -> usize {
    let index = |x: f64| (((x + 1.0) / 2.0 * SIDE as f64).max(0.0) as usize).min(SIDE - 1);
    index(at.y) * SIDE + index(at.x)
}

fn report(args: &TransmitArgs, result: &Transmitted, method: &'static str, warnings: Vec<String>) -> Report {
    let mut totals = serde_json::Map::new();
    let mut rgb = serde_json::Map::new();
    for (name, value) in result.totals.named() {
        totals.insert(name.to_owned(), serde_json::json!(value.map(|value| value.element_sum() / 3.0)));
        rgb.insert(name.to_owned(), serde_json::json!(value.map(|value| value.to_array())));
    }
    let (mean, deviation) = result.lobe.moments();
    Report {
        output: args.output.as_ref().map(|output| output.display().to_string()),
        theta_i_deg: args.theta_i,
        phi_i_deg: args.phi_i,
        method,
        totals,
        rgb,
        lobe: Moments { mean: mean.to_array(), deviation: deviation.to_array() },
        standard_error: result.standard_error,
        rel_l2: result.rel_l2,
        warnings,
    }
}

/// One line per cell of the disc, then one per direction of the plane of incidence.
fn csv(result: &Transmitted) -> String {
    let errors = if result.cell_errors.is_some() { ",se_r,se_g,se_b" } else { "" };
    let mut text = format!("part,o_x,o_y,theta_o_deg,r,g,b{errors}\n");
    for (k, value) in result.lobe.values.iter().enumerate() {
        let at = cell(k);
        if at.length_squared() >= 1.0 {
            continue;
        }
        let theta = 180.0 - at.length().asin().to_degrees();
        let _ = write!(text, "disc,{},{},{theta},{},{},{}", at.x, at.y, value.x, value.y, value.z);
        if let Some(errors) = &result.cell_errors {
            let _ = write!(text, ",{},{},{}", errors[k].x, errors[k].y, errors[k].z);
        }
        text.push('\n');
    }
    for (o, value) in &result.plane {
        let theta = (-o.z).acos().to_degrees();
        let _ = write!(text, "plane,{},{},{},{},{},{}", o.x, o.y, 180.0 - theta, value.x, value.y, value.z);
        text.push_str(if result.cell_errors.is_some() { ",,,\n" } else { "\n" });
    }
    text
}

/// Pixels per side of each of the two parts of the image.
const PIXELS: usize = 384;

/// The disc on the left, and on the right the lobe in the plane of incidence as a polar curve below the slab.
fn png(result: &Transmitted) -> Result<Vec<u8>> {
    let peak = |values: &mut dyn Iterator<Item = &DVec3>| values.map(|value| value.max_element()).fold(0.0, f64::max);
    let (disc_peak, plane_peak) =
        (peak(&mut result.lobe.values.iter()), peak(&mut result.plane.iter().map(|(_, value)| value)));
    let mut image = image::RgbImage::from_pixel(2 * PIXELS as u32, PIXELS as u32, image::Rgb([255; 3]));
    for y in 0..PIXELS {
        for x in 0..PIXELS {
            let at = (DVec2::new(x as f64, (PIXELS - 1 - y) as f64) + 0.5) * (2.0 / PIXELS as f64) - 1.0;
            if at.length_squared() >= 1.0 {
                continue;
            }
            let value = result.lobe.values[nearest_cell(at)] / disc_peak.max(f64::MIN_POSITIVE);
            let byte = |value: f64| (255.0 * value.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8;
            image.put_pixel(x as u32, y as u32, image::Rgb(value.to_array().map(byte)));
        }
    }
    draw_plane(&mut image, result, plane_peak);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// Draws the curve and the face above it. The light arrives from the upper left.
fn draw_plane(image: &mut image::RgbImage, result: &Transmitted, peak: f64) {
    let (center, radius) = (DVec2::new(1.5 * PIXELS as f64, 0.3 * PIXELS as f64), 0.48 * PIXELS as f64);
    let mut line = |from: DVec2, to: DVec2, color: [u8; 3]| {
        let steps = (to - from).abs().max_element().ceil().max(1.0) as usize;
        for k in 0..=steps {
            let at = from.lerp(to, k as f64 / steps as f64);
            let is_inside = at.x >= PIXELS as f64 && at.x < 2.0 * PIXELS as f64 && at.y >= 0.0 && at.y < PIXELS as f64;
            if is_inside {
                image.put_pixel(at.x as u32, at.y as u32, image::Rgb(color));
            }
        }
    };
    let half = DVec2::new(0.48 * PIXELS as f64, 0.0);
    line(center - half, center + half, [120; 3]);
    let is_grey = result.plane.iter().all(|(_, value)| value.x == value.y && value.y == value.z);
    for channel in 0..3 {
        let mut color = [0; 3];
        color[channel] = if is_grey { 0 } else { 200 };
        let point = |k: usize| {
            let theta = (k as f64 / STEPS as f64 - 0.5) * std::f64::consts::PI;
            let part = if peak > 0.0 { result.plane[k].1[channel] / peak } else { 0.0 };
            center + radius * part * DVec2::new(theta.sin(), theta.cos())
        };
        (0..STEPS).for_each(|k| line(point(k), point(k + 1), color));
    }
}
