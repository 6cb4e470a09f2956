//! `biscale capture` turns photographs of a sheet before a monitor into an SVBTDF and a scene that shows it.

use std::path::{Path, PathBuf};

use anyhow::Result;
use glam::Vec3;

use super::watch::Watch;
use super::{CaptureArgs, print_json, progress_bar, progress_on};
use crate::base::{Error, InputError, check_output, print_on_stderr, replace_file};
use crate::diagnostics::Health;
use crate::render::image::pixels::Image;
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::slab::capture::rig::{FILE, Rig, RigCamera};
use crate::slab::capture::sheet::{CaptureSettings, Captured, capture};

/// Files that the command writes, by their endings.
#[derive(Default)]
struct Outputs<'a> {
    npz: Option<&'a Path>,
    scene: Option<&'a Path>,
    /// Images of the residual.
    maps: Vec<&'a Path>,
}

impl<'a> Outputs<'a> {
    fn new(paths: &'a [PathBuf]) -> Result<Self, Error> {
        let mut outputs = Self::default();
        for path in paths {
            let ending =
                path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
            let twice = match ending.as_str() {
                "npz" => outputs.npz.replace(path),
                "toml" => outputs.scene.replace(path),
                "png" | "exr" => {
                    outputs.maps.push(path);
                    None
                }
                _ => {
                    let expected = "names that end in .npz (the SVBTDF), .toml (a scene), .png or .exr (residuals)";
                    return Err(InputError::new("output", format!("the ending .{ending}"), expected)
                        .in_file(path)
                        .into());
                }
            };
            if let Some(other) = twice {
                let found = format!("`{}` and `{}`", other.display(), path.display());
                return Err(InputError::new("output", found, format!("one name that ends in .{ending}")).into());
            }
        }
        if outputs.npz.is_none() {
            return Err(InputError::new("output", "no .npz", "-o NAME.npz, which holds the SVBTDF").into());
        }
        Ok(outputs)
    }
}

pub fn run(args: &CaptureArgs) -> Result<()> {
    let outputs = Outputs::new(&args.output)?;
    let rig = Rig::read(&args.folder)?;
    let inputs = inputs(&args.folder, &rig);
    args.output.iter().try_for_each(|output| check_output(output, &inputs))?;
    let settings = CaptureSettings {
        alpha: args.alpha,
        every_pixel: args.every_pixel,
        seed: args.seed,
        ..CaptureSettings::default()
    };
    let watch = Watch::new(args.quiet);
    let bar = progress_bar("capturing", args.quiet);
    let captured = capture(&rig, &args.folder, &settings, &watch.cancel(), &progress_on(&bar));
    bar.finish_and_clear();
    drop(watch);
    let captured = captured?;
    if let Some(path) = outputs.npz {
        captured.svbtdf.write(path)?;
    }
    if let (Some(scene), Some(npz)) = (outputs.scene, outputs.npz) {
        replace_file(scene, scene_text(scene, npz, &rig, &captured).as_bytes())?;
    }
    for path in outputs.maps {
        map(&captured).write(path, &ToneMap { curve: ToneCurve::Plain, gain: 1.0 })?;
    }
    report(args, &captured)
}

/// The files that the command reads: the rig, and every image that it names.
fn inputs(folder: &Path, rig: &Rig) -> Vec<PathBuf> {
    let dots = rig.dots().len();
    let of_camera = |camera: &RigCamera| -> Vec<PathBuf> {
        let images = (0..dots * camera.times().len()).map(|k| camera.image(k % dots, k / dots));
        images.chain(camera.dark.clone()).collect()
    };
    let names = rig.cameras.iter().flat_map(of_camera).chain([PathBuf::from(FILE)]);
    names.map(|name| folder.join(name)).collect()
}

/// A scene with the captured sheet.
fn scene_text(scene: &Path, npz: &Path, rig: &Rig, captured: &Captured) -> String {
    let folder = |path: &Path| {
        std::fs::canonicalize(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))).ok()
    };
    let is_beside = folder(scene).is_some() && folder(scene) == folder(npz);
    let named = if is_beside { npz.file_name().map(PathBuf::from) } else { std::path::absolute(npz).ok() };
    let named = toml::Value::String(named.unwrap_or_else(|| npz.to_owned()).to_string_lossy().into_owned());
    let [width, height] = captured.figures.pixels;
    format!(
        "# A sheet that `biscale capture` captured: {width} x {height} pixels, {} dots, {} camera(s).\n\n[tile]\ngeometry = {{ kind = \
         \"flat\" }}\n\n[object]\nkind = \"plate\"\n\n[slab]\neta = {}\nsvbtdf = {named}\n",
        captured.figures.dots, captured.figures.cameras, rig.eta
    )
}

/// The residual of each pixel as a grey image; 1 is a relative L2 of 100 %.
fn map(captured: &Captured) -> Image {
    let [width, height] = captured.figures.pixels;
    Image { width, height, pixels: captured.residual.iter().map(|value| Vec3::splat(*value)).collect() }
}

fn report(args: &CaptureArgs, captured: &Captured) -> Result<()> {
    let figures = &captured.figures;
    let health = Health::of_capture(figures);
    if args.json {
        return print_json(&serde_json::json!({
            "output": args.output.iter().map(|path| path.display().to_string()).collect::<Vec<_>>(),
            "figures": figures,
            "warnings": health.warnings,
        }));
    }
    if args.quiet {
        return Ok(());
    }
    for warning in &health.warnings {
        print_on_stderr(format_args!("warning: {warning}"));
    }
    print_on_stderr(format_args!(
        "{} representatives of {} x {} pixels; residual: {:.1} % (median of the pixels); alpha: {:.2} (mean); smoothness: {}",
        figures.representatives,
        figures.pixels[0],
        figures.pixels[1],
        100.0 * figures.median_residual,
        figures.alpha,
        figures.smoothness
    ));
    Ok(())
}
