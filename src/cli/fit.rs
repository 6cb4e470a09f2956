//! `biscale fit` approximates the effective BRDF by analytic models and prints their errors.

use std::io::Write;
use std::path::Path;

use crate::base::{Error, InputError, Progress, replace_file};
use crate::effective::{EffectiveBrdf, Reflectance};
use crate::fit;
use crate::fit::{Fit, Model, ThinFit};
use crate::pipeline::SlabOutcome;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::render;
use crate::render::{Image, RenderInput, RenderScene};
use crate::scene::LoadedScene;
use anyhow::Result;
use glam::Vec3;
use serde::Serialize;

use super::FitArgs;
use super::watch::Watch;
use super::{check_outputs, print_json, progress_bar, progress_on};

/// A fitted model as `--json` prints it.
#[derive(Serialize)]
pub struct Report {
    model: &'static str,
    rel_l2: f64,
    psnr_db: f64,
    roughness: [f32; 2],
    rotation_rad: f32,
    /// Fresnel factor of the lobe at grazing angles.
    edge: f32,
    /// Weights by name, in linear RGB.
    weights: serde_json::Map<String, serde_json::Value>,
    seconds: f64,
}

pub fn run(args: &FitArgs) -> Result<()> {
    let kinds: Vec<OutputKind> = args.output.iter().map(|path| kind(path)).collect::<Result<_, _>>()?;
    let (loaded, render_scene) = args.scene.open(|loaded| {
        if loaded.scene.slab.is_some() && kinds.contains(&OutputKind::Image) {
            let expected = ".gltf, .mtlx or .json; `biscale render` shows a slab";
            return Err(Error::from(InputError::new("output", "an image of the fit of a slab", expected)).into());
        }
        check_outputs(&args.scene.scene, loaded, &[], &args.output)?;
        Ok(if kinds.contains(&OutputKind::Image) { Some(RenderScene::new(loaded)?) } else { None })
    })?;
    let mut pipeline = crate::gpu::pipeline();
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    if loaded.scene.slab.is_some() {
        let outcome = pipeline.slab(&loaded)?;
        drop(watch);
        return of_slab(args, &loaded, &outcome);
    }
    let outcome = pipeline.effective(&loaded)?;
    drop(watch);
    args.scene.notes(&outcome);
    let mut fits = Vec::new();
    let mut reports = Vec::new();
    for model in Model::ALL {
        let bar = progress_bar("fitting", args.scene.quiet);
        let fitted = fit_model(&outcome.brdf, model, &progress_on(&bar));
        bar.finish_and_clear();
        let (fitted, report) = fitted?;
        fits.push(fitted);
        reports.push(report);
    }
    // The files for other programs hold the last model, the GGX base.
    let Some(base) = fits.last() else { return Ok(()) };
    for (path, kind) in args.output.iter().zip(kinds) {
        match kind {
            OutputKind::Gltf => replace_file(path, fit::gltf(base, &loaded.name).as_bytes())?,
            OutputKind::MaterialX => replace_file(path, fit::materialx(base, &loaded.name).as_bytes())?,
            OutputKind::Json => replace_file(path, format!("{:#}\n", serde_json::to_value(&reports)?).as_bytes())?,
            OutputKind::Image => {
                let Some(render_scene) = &render_scene else { continue };
                let materials: [&dyn Reflectance; 3] = [&*outcome.brdf, &fits[0], &fits[1]];
                let tone_map = ToneMap::new(&render_scene.camera)?;
                side_by_side(render_scene, &materials, args.size)?.write(path, &tone_map)?;
            }
        }
    }
    if args.scene.json {
        return print_json(&reports);
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "{:<26} {:>12} {:>10} {:>22} {:>9}", "model", "relative L2", "PSNR", "roughness", "seconds")?;
    for report in &reports {
        let [x, y] = report.roughness;
        writeln!(
            out,
            "{:<26} {:>10.1} % {:>7.1} dB {:>13.3} x {:.3} {:>9.2}",
            report.model,
            100.0 * report.rel_l2,
            report.psnr_db,
            x,
            y,
            report.seconds
        )?;
        for (name, weight) in &report.weights {
            writeln!(out, "  {name}: {weight}")?;
        }
    }
    Ok(())
}

/// Fits a model, and reports its parameters and errors.
///
/// # Errors
/// As [`fit::fit`].
pub fn fit_model(brdf: &EffectiveBrdf, model: Model, progress: &Progress<'_>) -> Result<(Fit, Report)> {
    let start = std::time::Instant::now();
    let fitted = fit::fit(brdf, model, progress)?;
    let report = report(&fitted, start.elapsed().as_secs_f64());
    Ok((fitted, report))
}

fn report(fit: &Fit, seconds: f64) -> Report {
    let names = fit.model.weight_names().iter().zip(&fit.weights);
    Report {
        model: fit.model.name(),
        rel_l2: fit.errors.rel_l2,
        psnr_db: fit.errors.psnr_db,
        roughness: fit.shape.roughness,
        rotation_rad: fit.shape.rotation,
        edge: fit.shape.edge,
        weights: names.map(|(name, weight)| ((*name).to_owned(), serde_json::json!(weight.to_array()))).collect(),
        seconds,
    }
}

/// Content of an output file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum OutputKind {
    Gltf,
    MaterialX,
    Json,
    Image,
}

fn kind(path: &Path) -> Result<OutputKind, Error> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    Ok(match ending.as_str() {
        "gltf" => OutputKind::Gltf,
        "mtlx" => OutputKind::MaterialX,
        "json" => OutputKind::Json,
        "png" | "exr" => OutputKind::Image,
        other => {
            let expected = "a name that ends in .gltf, .mtlx, .json, .png or .exr";
            return Err(InputError::new("output", format!("the ending .{other}"), expected).in_file(path).into());
        }
    })
}

/// Renders the object in each material, from left to right. The differences from the first image are below them.
fn side_by_side(render_scene: &RenderScene, materials: &[&dyn Reflectance], size: [usize; 2]) -> Result<Image> {
    let background = ImageBackground::Uniform(Vec3::ZERO);
    let mut images = Vec::new();
    for &reflectance in materials {
        // Differences must be those of the materials.
        let input = RenderInput { tolerance: 0.0, ..render_scene.input(reflectance, size, 2, &background) };
        images.push(render(&input)?.image);
    }
    let [width, height] = size;
    let mut sheet = Image {
        width: width * images.len(),
        height: 2 * height,
        pixels: vec![Vec3::ZERO; 2 * width * height * images.len()],
    };
    for (k, image) in images.iter().enumerate() {
        for (pixel, value) in image.pixels.iter().enumerate() {
            let (x, y) = (pixel % width + k * width, pixel / width);
            sheet.pixels[y * sheet.width + x] = *value;
            sheet.pixels[(y + height) * sheet.width + x] = (*value - images[0].pixels[pixel]).abs();
        }
    }
    Ok(sheet)
}

/// Fits a thin surface to a slab, and writes it.
fn of_slab(args: &FitArgs, loaded: &LoadedScene, outcome: &SlabOutcome) -> Result<()> {
    args.scene.warn(&outcome.health);
    let slab = &outcome.slab;
    let bar = progress_bar("fitting", args.scene.quiet);
    let fitted = fit::fit_slab(slab, &progress_on(&bar));
    bar.finish_and_clear();
    let fitted = fitted?;
    let report = slab_report(&fitted);
    for path in &args.output {
        let text = match kind(path)? {
            OutputKind::Gltf => fit::thin_gltf(&fitted, &loaded.name),
            OutputKind::MaterialX => fit::thin_materialx(&fitted, &loaded.name),
            OutputKind::Json | OutputKind::Image => format!("{report:#}\n"),
        };
        replace_file(path, text.as_bytes())?;
    }
    if args.scene.json {
        return print_json(&report);
    }
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "thin GGX transmission: roughness {:.4}, relative L2 {:.1} %, {:.1} dB",
        fitted.alpha,
        100.0 * fitted.errors.rel_l2,
        fitted.errors.psnr_db
    )?;
    Ok(())
}

/// A fitted thin surface as `--json` prints it.
pub fn slab_report(fitted: &ThinFit) -> serde_json::Value {
    serde_json::json!({
        "model": "thin GGX transmission",
        "rel_l2": fitted.errors.rel_l2,
        "psnr_db": fitted.errors.psnr_db,
        "roughness": fitted.alpha,
        "eta": fitted.eta,
        "color": fitted.color.to_array(),
        "straight": fitted.straight.to_array(),
    })
}
