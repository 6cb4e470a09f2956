//! Targets, one per reader.

use std::path::{Path, PathBuf};

use biscale::base::{Cancel, Error, Result};
use biscale::brdf::{Brdf, MeasuredCache};
use biscale::math::directions::from_angles;
use biscale::pipeline::Pipeline;
use biscale::render::lighting::lights;
use biscale::render::object;
use biscale::scene::{BrdfSpec, Geometry, Heightfield, LoadedScene, MeshFile, Painted, TermSpec};
use biscale::slab::capture::photographs::Photographs;
use biscale::slab::capture::rig::Rig;
use biscale::slab::capture::sheet::{CaptureSettings, capture};
use biscale::slab::capture::svbtdf::Svbtdf;
use biscale::{geometry, scene};
use glam::Vec3;

use super::seeds;

/// Reads an input. Returns true if the reader accepts it, and an error if its result or its message is not valid.
type Run = fn(&Path, &[u8]) -> std::result::Result<bool, String>;

pub struct Target {
    pub name: &'static str,
    pub is_text: bool,
    pub seeds: fn() -> Vec<Vec<u8>>,
    pub run: Run,
    /// Executions in the ordinary tests.
    pub brief: usize,
}

pub const TARGETS: [Target; 13] = [
    Target { name: "scene", is_text: true, seeds: seeds::scenes, run: scene, brief: 400 },
    Target { name: "merl", is_text: false, seeds: seeds::merl, run: |f, b| measured(f, b, "a.binary"), brief: 30 },
    Target { name: "rgl", is_text: false, seeds: seeds::rgl, run: |f, b| measured(f, b, "a.bsdf"), brief: 60 },
    Target { name: "utia", is_text: false, seeds: seeds::utia, run: |f, b| measured(f, b, "a.bin"), brief: 20 },
    Target { name: "npz", is_text: false, seeds: seeds::npz, run: |f, b| measured(f, b, "a.npz"), brief: 60 },
    Target { name: "obj_tile", is_text: true, seeds: seeds::objs, run: obj_tile, brief: 300 },
    Target { name: "obj_object", is_text: true, seeds: seeds::objs, run: obj_object, brief: 300 },
    Target { name: "heights", is_text: false, seeds: seeds::heights, run: heights, brief: 300 },
    Target { name: "environment", is_text: false, seeds: seeds::environments, run: environment, brief: 150 },
    Target { name: "rig", is_text: true, seeds: seeds::rigs, run: rig, brief: 300 },
    Target { name: "photographs", is_text: false, seeds: seeds::heights, run: photographs, brief: 100 },
    Target { name: "svbtdf", is_text: false, seeds: seeds::svbtdfs, run: svbtdf, brief: 200 },
    Target { name: "pipeline", is_text: true, seeds: seeds::quick_scenes, run: pipeline, brief: 40 },
];

/// Checks that an error blames the input: its exit code is 2 and its message is short.
fn refused(error: &Error) -> std::result::Result<bool, String> {
    let text = error.to_string();
    if error.exit_code() != 2 {
        return Err(format!("an error that does not blame the input: {text}"));
    }
    if text.len() > 20_000 {
        return Err(format!("a message of {} bytes", text.len()));
    }
    Ok(false)
}

fn check<T>(result: Result<T>, is_valid: impl FnOnce(T) -> bool) -> std::result::Result<bool, String> {
    match result {
        Ok(value) => is_valid(value).then_some(true).ok_or_else(|| "accepted, but the result is not valid".to_owned()),
        Err(error) => refused(&error),
    }
}

fn scene(_: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(false) };
    let overrides = ["tile.size=[1, 1]".to_owned(), text.chars().take(40).collect()];
    if let Err(error) = scene::load_with_overrides(text, &overrides) {
        refused(&error)?;
    }
    check(scene::parse(text), |parsed| {
        // An accepted scene is valid and survives a round trip through TOML.
        parsed.validate().is_ok()
            && parsed.to_toml().is_ok_and(|text| scene::parse(&text).is_ok_and(|again| again == parsed))
    })
}

fn is_sound(v: Vec3) -> bool {
    v.is_finite() && v.min_element() >= 0.0
}

fn measured(folder: &Path, bytes: &[u8], name: &str) -> std::result::Result<bool, String> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).map_err(|error| error.to_string())?;
    let term = match path.extension().and_then(|ending| ending.to_str()) {
        Some("binary") => TermSpec::Merl { path },
        Some("bsdf") => TermSpec::Rgl { path },
        Some("npz") => TermSpec::Npz { path },
        _ => TermSpec::Utia { path },
    };
    check(Brdf::from_specs(&BrdfSpec::One(term), Path::new(""), &mut MeasuredCache::default()), |brdf| {
        (0..200).all(|k| {
            let direction =
                |a: usize, b: usize| from_angles((k * a % 90) as f32 * 0.0175, (k * b % 360) as f32 * 0.0175);
            let (i, o) = (direction(7, 13), direction(11, 29));
            is_sound(brdf.f(Vec3::Z, i, o)) && is_sound(brdf.f_r(Vec3::Z, i, o))
        })
    })
}

fn tile(geometry: Geometry, folder: &Path) -> std::result::Result<bool, String> {
    let tile = scene::Scene::of(geometry).tile;
    check(geometry::build(&tile, folder), |mesh| {
        mesh.positions.iter().all(|p| p.is_finite()) && !mesh.triangles.is_empty()
    })
}

fn obj_tile(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    std::fs::write(folder.join("a.obj"), bytes).map_err(|error| error.to_string())?;
    tile(Geometry::Mesh(MeshFile { path: "a.obj".into() }), folder)
}

fn obj_object(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    std::fs::write(folder.join("a.obj"), bytes).map_err(|error| error.to_string())?;
    let object = scene::Object { kind: "mesh".to_owned(), path: Some("a.obj".into()) };
    check(object::build(&object, folder), |mesh| {
        let unit = |v: &Vec3| v.is_finite() && (v.length() - 1.0).abs() < 1e-2;
        mesh.positions.iter().all(|p| p.is_finite()) && mesh.normals.iter().chain(&mesh.tangents).all(unit)
    })
}

fn heights(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    std::fs::write(folder.join("a.png"), bytes).map_err(|error| error.to_string())?;
    let path: Option<PathBuf> = Some("a.png".into());
    if let Err(error) = geometry::image_file::read_colors(folder, Path::new("a.png")) {
        refused(&error)?;
    }
    tile(Geometry::Heightfield(Heightfield { path, height_scale: 1e-3, ..Heightfield::default() }), folder)
}

fn environment(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let name = if bytes.starts_with(b"#?") { "a.hdr" } else { "a.exr" };
    std::fs::write(folder.join(name), bytes).map_err(|error| error.to_string())?;
    let light = scene::Light { environment: name.to_owned(), count: 16, ..scene::Light::default() };
    check(lights::build(&light, folder), |lights| lights.directional.iter().all(|light| is_sound(light.irradiance)))
}

fn rig(_: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(false) };
    check(Rig::parse(text), |rig| {
        // An accepted rig survives a round trip through TOML.
        let is_finite = rig.dots().iter().all(|dot| dot.is_finite());
        is_finite && rig.to_toml().is_ok_and(|text| Rig::parse(&text).is_ok_and(|again| again == rig))
    })
}

/// Captures a sheet from one photograph under two dots.
fn photographs(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let name = match bytes {
        [b'#', b'?', ..] => "a.hdr",
        [b'v', b'/', ..] => "a.exr",
        _ => "a.png",
    };
    std::fs::write(folder.join(name), bytes).map_err(|error| error.to_string())?;
    let text = format!(
        "eta = 1.5\nsample_size = [0.01, 0.01]\ndistance = 0.04\ndots = {{ positions = [[-0.04, 0]] }}\n[[camera]]\ndirection = \
         [1, 0, -1]\nimages = \"{name}%d\"\n"
    );
    std::fs::rename(folder.join(name), folder.join(format!("{name}0"))).map_err(|error| error.to_string())?;
    let rig = Rig::parse(&text).map_err(|error| error.to_string())?;
    match Photographs::open(&rig, folder) {
        // Large photographs are valid, but they would only cost time.
        Ok(opened) if opened.size.element_product() > 1024 => return Ok(true),
        Ok(_) => {}
        Err(error) => return refused(&error),
    }
    let settings = CaptureSettings::default();
    check(capture(&rig, folder, &settings, &Cancel::default(), &|_| true), |captured| is_sound_sheet(&captured.svbtdf))
}

fn svbtdf(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let path = folder.join("a.npz");
    std::fs::write(&path, bytes).map_err(|error| error.to_string())?;
    check(Svbtdf::read(&path), |sheet| is_sound_sheet(&sheet))
}

fn is_sound_sheet(sheet: &Svbtdf) -> bool {
    let mean = sheet.mean();
    (0..100).all(|k| {
        let direction = |a: usize, b: usize| from_angles((k * a % 90) as f32 * 0.0175, (k * b % 360) as f32 * 0.0175);
        let (i, o) = (direction(7, 13).as_dvec3(), -direction(11, 29).as_dvec3());
        let values = [sheet.btdf(k % sheet.scale.len(), i, o), mean.btdf(i, o)];
        values.iter().all(|value| value.is_finite() && value.min_element() >= 0.0)
    })
}

/// Runs all stages of a scene.
fn pipeline(folder: &Path, bytes: &[u8]) -> std::result::Result<bool, String> {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(false) };
    let mut scene = match scene::parse(text) {
        Ok(scene) => scene,
        Err(error) => return refused(&error),
    };
    // Expensive settings are valid, but they would only cost time.
    let quality = &mut scene.quality;
    quality.preset = "draft".to_owned();
    quality.backend = "cpu".to_owned();
    quality.facets = Some(quality.facets.unwrap_or(64).min(128));
    quality.azimuths = Some(quality.azimuths.unwrap_or(8).min(16));
    quality.rings = Some(quality.rings.unwrap_or(4).min(8));
    quality.grid = Some([6, 12]);
    if let Geometry::Rods(rods) = &mut scene.tile.geometry {
        (rods.count, rods.density) = (rods.count.min(30), None);
    }
    let loaded = LoadedScene { scene, base_dir: folder.to_owned(), name: String::new(), painted: Painted::default() };
    if loaded.scene.color_map.is_some() {
        let is_mapped = check(Pipeline::new().color_filter(&loaded), |filter| {
            biscale::metrics::mirror_biased_pairs(6, 2).iter().all(|pair| {
                let color = filter.pair(pair.i.as_dvec3(), pair.o.as_dvec3()).color;
                color.is_finite() && color.min_element() >= 0.0
            })
        })?;
        if !is_mapped {
            return Ok(false);
        }
    }
    check(Pipeline::new().effective(&loaded), |outcome| {
        let pairs = biscale::metrics::mirror_biased_pairs(24, 1);
        pairs.iter().all(|p| is_sound(outcome.brdf.eval(p.i, p.o))) && outcome.health().result.unsound_values == 0
    })
}
