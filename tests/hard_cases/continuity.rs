//! Continuity: a Lipschitz probe along every numeric parameter of the catalogue.

use biscale::effective::Reflectance;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::plan::{Preset, Settings};
use biscale::render::RenderScene;
use biscale::render::image::shading::ImageBackground;
use biscale::render::render;
use biscale::scene;
use biscale::scene::{Camera, FieldShape, Geometry, Light, LoadedScene, Painted, TermSpec};
use glam::Vec3;

/// Parameters that are rounded to a whole number. If one jumps, a note of the tile names the rounded value.
const SNAPS: [&str; 4] = ["spacing", "density", "rotation_deg", "face_ratio"];

fn open(text: &str) -> LoadedScene {
    let scene = scene::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    LoadedScene { scene, base_dir: "".into(), name: String::new(), painted: Painted::default() }
}

/// Returns values, and the smallest number of facets that are visible from one direction.
fn values(pipeline: &Pipeline, text: &str) -> (Vec<Vec3>, usize) {
    let outcome = pipeline.effective(&open(text)).unwrap();
    let values = mirror_biased_pairs(64, 21).iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect();
    (values, outcome.health().surface.fewest_visible_facets)
}

/// Returns three values along a slider.
fn slider_values(min: f64, soft_max: f64) -> [f64; 3] {
    let low = if min <= 0.0 { min + 1e-3 * (soft_max - min) } else { min.max(1e-3 * soft_max) };
    [low, 0.3 * soft_max + 0.7 * min.max(0.0), 0.97 * soft_max]
}

/// Returns the largest change over a thousandth of the slider, or over half a percent at its lower end. The change must
/// stay below the tolerance of the plan, or below the noise of the visible facets if that is larger.
fn probe(pipeline: &Pipeline, name: &str, min: f64, soft_max: f64, text: impl Fn(f64) -> String) -> f64 {
    let mut worst = 0.0_f64;
    let mut values_found = Vec::new();
    for at in slider_values(min, soft_max) {
        let step = (1e-3 * (soft_max - min.max(-soft_max))).min(5e-3 * at.abs());
        let next = if at + step <= soft_max { at + step } else { at - step };
        let ((there, visible), (here, _)) = (values(pipeline, &text(next)), values(pipeline, &text(at)));
        let errors = compare(&there, &here);
        let tolerance = Settings::of_preset(Preset::Draft).tolerance.max(2.0 / (visible.max(1) as f64).sqrt());
        let jump = if errors.rel_l2.is_finite() { errors.rel_l2 } else { 0.0 };
        values_found.push(here);
        if jump < tolerance {
            worst = worst.max(jump);
            continue;
        }
        let snaps = SNAPS.iter().any(|key| name.ends_with(key));
        let has_note = snaps && !pipeline.mesh(&open(&text(next))).unwrap().notes.is_empty();
        assert!(has_note, "{name} from {at} to {next}: {:.1} %", 100.0 * jump);
    }
    let moves = values_found[1..].iter().any(|there| compare(there, &values_found[0]).rel_l2 > 1e-6);
    assert!(moves, "{name} changes nothing from {min} to {soft_max}");
    worst
}

const BRDF: &str = r#"{ kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }"#;
const QUALITY: &str = "[quality]\npreset = \"draft\"\nfacets = 1024\nbackend = \"cpu\"\nmethod = \"direct\"\n";

/// Returns the keys that a geometry needs besides the one that moves.
fn other_keys(kind: &str, key: &str) -> &'static str {
    match (kind, key) {
        ("rods", "radius" | "density") => ", count = 12",
        ("rods", "lean_azimuth_deg") => ", count = 12, radius = 0.05, lean_deg = 30",
        ("rods", _) => ", count = 12, radius = 0.05",
        ("heightfield", _) => ", values = [[0, 0.3, 0.1], [0.5, 0.9, 0.4], [0.2, 0.6, 1.0]]",
        ("flat", _) => ", pattern = \"stripes\"",
        _ => "",
    }
}

#[test]
fn no_slider_of_a_geometry_jumps() {
    for kind in Geometry::kinds().into_iter().filter(|kind| kind.kind != "mesh") {
        let pipeline = Pipeline::new();
        for field in &kind.fields {
            let FieldShape::Number { min, soft_max, .. } = field.shape else { continue };
            // The whole range allows a million rods or pyramids, which take too long.
            let (min, soft_max) = match field.key {
                "density" => (4.0, 40.0),
                "spacing" => (0.05, 1.0),
                "height_scale" => (-1.0, 1.0),
                _ => (min, soft_max),
            };
            let other_keys = other_keys(kind.kind, field.key);
            let other_keys = if field.key == "density" { ", radius = 0.05" } else { other_keys };
            let worst = probe(&pipeline, &format!("{} {}", kind.kind, field.key), min, soft_max, |value| {
                format!(
                    "[tile]\ngeometry = {{ kind = \"{}\"{other_keys}, {} = {value} }}\n[[material]]\nname = \"default\"\nbrdf = \
                     {BRDF}\n[[material]]\nname = \"second\"\ncolor = 0.2\n{QUALITY}",
                    kind.kind, field.key
                )
            });
            eprintln!("{:<12} {:<18} {:.2} %", kind.kind, field.key, 100.0 * worst);
        }
    }
}

fn scene_text(tile: &str, material: &str, quality: &str) -> String {
    format!("[tile]\n{tile}\n[[material]]\nname = \"default\"\n{material}\n{quality}\n")
}

/// The sides of the tile, colours, and settings of the penumbra and of truncation.
#[test]
fn no_slider_of_tile_colour_or_quality_jumps() {
    let (grooves, weave) = ("geometry = { kind = \"grooves\" }", "geometry = { kind = \"weave\" }");
    let glossy = format!("brdf = {BRDF}");
    let factors = QUALITY.replace("\"direct\"", "\"low_rank\"");
    let colored = |brdf: &str| scene_text(grooves, &format!("brdf = {{ {brdf} }}"), QUALITY);
    type Text<'a> = &'a dyn Fn(f64) -> String;
    let sliders: [(&str, f64, f64, Text<'_>); 8] = [
        ("size", 0.2, 5.0, &|x| scene_text(&format!("size = [{x}, 1.0]\n{grooves}"), &glossy, QUALITY)),
        ("color", 0.0, 1.0, &|x| scene_text(grooves, &format!("{glossy}\ncolor = {x}"), QUALITY)),
        ("albedo", 0.0, 1.0, &|x| colored(&format!("kind = \"lambertian\", albedo = {x}"))),
        ("f0", 0.0, 1.0, &|x| colored(&format!("kind = \"cook_torrance\", roughness = 0.4, f0 = {x}"))),
        ("specular", 0.0, 1.0, &|x| colored(&format!("kind = \"ward\", roughness = 0.4, specular = {x}"))),
        ("penumbra", 0.0, 45.0, &|x| scene_text(grooves, &glossy, &format!("{QUALITY}penumbra_deg = {x}"))),
        ("keep_m", 0.5, 1.0, &|x| scene_text(weave, &glossy, &format!("{factors}keep_m = {x}"))),
        ("keep_n", 0.5, 1.0, &|x| scene_text(weave, &glossy, &format!("{factors}keep_n = {x}"))),
    ];
    let pipeline = Pipeline::new();
    for (name, min, max, text) in sliders {
        let worst = probe(&pipeline, name, min, max, text);
        eprintln!("{name:<12} {:.2} %", 100.0 * worst);
    }
}

/// A white diffuse surface.
struct White;

impl Reflectance for White {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        for (light, out) in lights.iter().zip(out) {
            *out = if o.z > 0.0 { Vec3::splat(light.z.max(0.0)) } else { Vec3::ZERO };
        }
    }
}

#[test]
fn no_slider_of_light_or_camera_jumps() {
    let image = |text: &str| -> Vec<Vec3> {
        let render_scene = RenderScene::new(&open(text)).unwrap();
        let background = ImageBackground::Uniform(Vec3::ZERO);
        render(&render_scene.input(&White, [64, 64], 4, &background)).unwrap().image.pixels
    };
    for (table, fields) in [("light", Light::fields()), ("camera", Camera::fields())] {
        for field in fields {
            let FieldShape::Number { min, soft_max, .. } = field.shape else { continue };
            // Exposure acts in tone mapping only.
            if field.key == "exposure_ev" {
                continue;
            }
            let mut worst = 0.0_f64;
            for part in [0.15, 0.5, 0.62, 0.9] {
                let at = min + part * (soft_max - min);
                // A thousandth of the slider, half a degree at most: a pixel of the silhouette.
                let step = (1e-3 * (soft_max - min)).min(0.5);
                let text = |value: f64| {
                    format!(
                        "[tile]\ngeometry = {{ kind = \"flat\" }}\n[object]\nkind = \"cup\"\n[{table}]\n{} = {value}\n",
                        field.key
                    )
                };
                let jump = compare(&image(&text(at + step)), &image(&text(at))).rel_l2;
                let jump = if jump.is_finite() { jump } else { 0.0 };
                assert!(jump < 0.12, "{table} {} from {at} by {step}: {:.1} %", field.key, 100.0 * jump);
                worst = worst.max(jump);
            }
            eprintln!("{table:<8} {:<14} {:.2} %", field.key, 100.0 * worst);
        }
    }
}

#[test]
fn no_slider_of_a_brdf_jumps() {
    let pipeline = Pipeline::new();
    for kind in TermSpec::kinds() {
        for field in &kind.fields {
            let FieldShape::Number { min, soft_max, .. } = field.shape else { continue };
            let worst = probe(&pipeline, &format!("{} {}", kind.kind, field.key), min.max(0.1), soft_max, |value| {
                format!(
                    "[tile]\ngeometry = {{ kind = \"pyramids\" }}\n[[material]]\nname = \"default\"\nbrdf = {{ kind = \"{}\", {} \
                     = {value} }}\n{QUALITY}",
                    kind.kind, field.key
                )
            });
            eprintln!("{:<14} {:<10} {:.2} %", kind.kind, field.key, 100.0 * worst);
        }
    }
}
