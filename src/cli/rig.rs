//! `biscale rig` makes the photographs that the rig of Dai et al. 2009 would take of a slab.

use std::path::{Path, PathBuf};

use anyhow::Result;
use glam::{DVec2, DVec3, UVec2, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::watch::Watch;
use super::{RigArgs, RigSource, check_outputs, print_json, progress_bar};
use crate::base::{Cancel, Error, InputError, print_on_stderr, replace_file};
use crate::pipeline::SlabOutcome;
use crate::reference::photons::{LobeSettings, TrueLobe};
use crate::render::image::pixels::Image;
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::scene::Switch;
use crate::slab::ChannelSlab;
use crate::slab::capture::radiance::DotLight;
use crate::slab::capture::rig::{self, Dots, Rig, RigCamera};
use crate::slab::capture::simulated::add_noise;

/// The paper's rig (Sec. 4.1): sides of the sample, the distance to the monitor, both in metres, and how much farther the
/// dots reach than the sample.
const SAMPLE: f64 = 0.08;
const DISTANCE: f64 = 0.04;
const REACH: f64 = 1.2;
/// Polar angles of the cameras [degrees].
const CAMERAS_DEG: [f64; 2] = [45.0, 0.0];
/// Cells per side of a lobe by photons, and its largest number of photons.
const TRUTH_SIDE: usize = 128;
const TRUTH_PHOTONS: usize = 8_000_000;

pub fn run(args: &RigArgs) -> Result<()> {
    let described = rig_of(args);
    let (loaded, ()) = args.scene.open(|loaded| {
        if loaded.scene.slab.is_none() {
            let error = InputError::new("slab", "nothing", "a table [slab]: without it a scene transmits no light");
            return Err(Error::from(error.in_file(&args.scene.scene)).into());
        }
        let is_truth = args.source == RigSource::Truth;
        if is_truth && loaded.scene.slab.as_ref().is_some_and(|slab| slab.svbtdf.is_some()) {
            let error = InputError::new("--source", "truth", "model: a captured sheet has no faces for photons");
            return Err(Error::from(error).into());
        }
        for folder in folders(args) {
            std::fs::create_dir_all(&folder).map_err(|error| {
                Error::from(InputError::new("output", error, "a folder that can be created").in_file(&folder))
            })?;
        }
        check_outputs(&args.scene.scene, loaded, &[], [args.output.join(rig::FILE)])
    })?;
    let mut pipeline = crate::gpu::pipeline();
    let watch = Watch::new(args.scene.quiet);
    let cancel = watch.cancel();
    pipeline.set_cancel(cancel.clone());
    let outcome = match args.source {
        RigSource::Model => pipeline.slab(&loaded)?,
        RigSource::Truth => pipeline.slab_of_faces(&loaded)?,
    };
    args.scene.warn(&outcome.health);
    drop(watch);
    let spec = loaded.scene.slab.as_ref();
    let bounces = match &outcome.svbtdf {
        Some(sheet) => sheet.bounced.is_some(),
        None => spec.is_some_and(|slab| slab.bounces == Switch::On),
    };
    let described = Rig { eta: outcome.slab.optics.eta.x, bounces, ..described };
    let source = Source::new(args, &outcome, &described, &cancel)?;
    let images = photograph(args, &described, &source, outcome.settings.seed)?;
    replace_file(&args.output.join(rig::FILE), described.to_toml()?.as_bytes())?;
    report(args, images)
}

/// Folders of the images.
fn folders(args: &RigArgs) -> Vec<PathBuf> {
    (0..usize::from(args.cameras)).map(|camera| args.output.join(format!("camera_{camera}"))).collect()
}

/// The description of the rig.
fn rig_of(args: &RigArgs) -> Rig {
    let size = DVec2::splat(SAMPLE);
    let theta = CAMERAS_DEG[0].to_radians();
    // The dots are shifted against the first camera by d tan θ; the paper prints d cos θ, which misses half of the lobe.
    let center = DVec2::new(-DISTANCE * theta.tan(), 0.0);
    let count = DVec2::new(args.dots[0] as f64, args.dots[1] as f64);
    let half = 0.5 * REACH * size * (1.0 - 1.0 / count);
    let dots = Dots {
        count: Some(args.dots),
        from: Some((center - half).to_array()),
        to: Some((center + half).to_array()),
        positions: None,
    };
    let camera = |k: usize| {
        let (sin, cos) = CAMERAS_DEG[k].to_radians().sin_cos();
        RigCamera {
            direction: [sin, 0.0, -cos],
            images: format!("camera_{k}/dot_%04d.exr"),
            exposures: Vec::new(),
            dark: None,
            corners: None,
        }
    };
    Rig {
        eta: 1.5,
        sample_size: size.to_array(),
        distance: DISTANCE,
        monitor: [1.0; 3],
        saturation: None,
        pixels: None,
        bounces: true,
        dots,
        cameras: (0..usize::from(args.cameras)).map(camera).collect(),
    }
}

/// The BTDF that the images show.
enum Source<'a> {
    Slab(&'a SlabOutcome),
    /// Lobes by photons over (i.x, i.y), per camera: channels, cells per side and values.
    Photons(Vec<[Vec<f64>; 3]>, DVec3),
}

impl<'a> Source<'a> {
    fn new(args: &RigArgs, outcome: &'a SlabOutcome, rig: &Rig, cancel: &Cancel) -> Result<Self> {
        if args.source == RigSource::Model {
            return Ok(Self::Slab(outcome));
        }
        let settings =
            LobeSettings { side: TRUTH_SIDE, photons: TRUTH_PHOTONS, target: 5e-3, seed: outcome.settings.seed };
        let slab = outcome.slab.turned();
        let lobe = |camera: &RigCamera| -> Result<[Vec<f64>; 3]> {
            // Light that takes the opposite way: from the camera, through the slab turned over.
            let from = camera.unit_direction() * DVec3::new(1.0, 1.0, -1.0);
            let mut channels: [Vec<f64>; 3] = Default::default();
            for k in 0..3 {
                let channel = slab.optics.channel(k);
                if let Some(known) = (0..k).find(|known| slab.optics.channel(*known) == channel) {
                    channels[k] = channels[known].clone();
                    continue;
                }
                let walk = ChannelSlab { top: &slab.top, bottom: &slab.bottom, channel };
                let traced = TrueLobe::trace(&walk, from, &settings, cancel)?;
                channels[k] = if rig.bounces { traced.all.values } else { traced.single.values };
            }
            Ok(channels)
        };
        let lobes = rig.cameras.iter().map(lobe).collect::<Result<_>>()?;
        Ok(Self::Photons(lobes, outcome.slab.optics.diffuse))
    }

    /// BTDF [1/sr] at the middle of a pixel.
    fn btdf(&self, camera: usize, pixel: (usize, DVec2), i: DVec3, o: DVec3) -> DVec3 {
        match self {
            Self::Slab(outcome) => match &outcome.svbtdf {
                Some(sheet) => sheet.btdf(sheet.pixel_at(pixel.1), i, o),
                None => outcome.slab.btdf(i, o),
            },
            Self::Photons(lobes, diffuse) => {
                let lobe = DVec3::from_array([0, 1, 2].map(|k| bilinear(&lobes[camera][k], i.truncate())));
                (DVec3::ONE - *diffuse) * lobe + *diffuse / std::f64::consts::PI
            }
        }
    }
}

/// Reads cells over the disc between their middles.
fn bilinear(cells: &[f64], at: DVec2) -> f64 {
    let last = (TRUTH_SIDE - 1) as f64;
    let place = ((at + 1.0) * (0.5 * TRUTH_SIDE as f64) - 0.5).clamp(DVec2::ZERO, DVec2::splat(last - 1e-9));
    let (base, t) = (place.floor(), place - place.floor());
    let first = base.y as usize * TRUTH_SIDE + base.x as usize;
    let row = |k: usize| (1.0 - t.x) * cells[k] + t.x * cells[k + 1];
    (1.0 - t.y) * row(first) + t.y * row(first + TRUTH_SIDE)
}

/// Writes the images of all cameras and dots, and returns their number.
fn photograph(args: &RigArgs, rig: &Rig, source: &Source<'_>, seed: u64) -> Result<usize> {
    let dots = rig.dots();
    let bar = progress_bar("photographing", args.scene.quiet);
    bar.set_length((dots.len() * rig.cameras.len()) as u64);
    for (k, camera) in rig.cameras.iter().enumerate() {
        (0..dots.len()).into_par_iter().try_for_each(|dot| -> Result<()> {
            let name = args.output.join(camera.image(dot, 0));
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream((k * dots.len() + dot) as u64);
            write(&name, image(args, rig, source, (k, dots[dot]), &mut rng), args.pixels)?;
            bar.inc(1);
            Ok(())
        })?;
    }
    bar.finish_and_clear();
    Ok(dots.len() * rig.cameras.len())
}

/// The radiances of one dot, with noise.
fn image(
    args: &RigArgs,
    rig: &Rig,
    source: &Source<'_>,
    (camera, dot): (usize, DVec2),
    rng: &mut ChaCha8Rng,
) -> Vec<Vec3> {
    let size = UVec2::new(args.pixels[0] as u32, args.pixels[1] as u32);
    let o = rig.cameras[camera].unit_direction();
    let value = |pixel: usize| {
        let place = rig.place(pixel, size);
        let light = DotLight::new(dot, rig.distance, place);
        let on_sheet = place / DVec2::from_array(rig.sample_size) + 0.5;
        DVec3::from_array(rig.monitor) * light.irradiance * source.btdf(camera, (pixel, on_sheet), light.i, o)
    };
    let mut values: Vec<DVec3> = (0..args.pixels[0] * args.pixels[1]).map(value).collect();
    if args.noise > 0.0 {
        let mut channels: Vec<f64> = values.iter().flat_map(|value| value.to_array()).collect();
        add_noise(&mut channels, args.noise, rng);
        values = channels.as_chunks().0.iter().map(|rgb| DVec3::from_array(*rgb)).collect();
    }
    values.into_iter().map(|value| value.as_vec3()).collect()
}

fn write(path: &Path, pixels: Vec<Vec3>, [width, height]: [usize; 2]) -> Result<()> {
    let plain = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };
    Ok(Image { width, height, pixels }.write(path, &plain)?)
}

fn report(args: &RigArgs, images: usize) -> Result<()> {
    if args.scene.json {
        print_json(&serde_json::json!({
            "output": args.output.display().to_string(),
            "images": images,
            "dots": args.dots,
            "pixels": args.pixels,
            "cameras": args.cameras,
        }))?;
    } else if !args.scene.quiet {
        let (folder, file) = (args.output.display(), rig::FILE);
        print_on_stderr(format_args!("{images} images and {file} in {folder}"));
    }
    Ok(())
}
