//! No slider jumps: a Lipschitz probe along every numeric parameter of every geometry and BRDF.

use biscale::accuracy::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::plan::{Preset, Settings};
use biscale::scene::{self, Geometry, LoadedScene, Painted, Shape, TermSpec};
use glam::Vec3;

/// Parameters that stand for a whole number, or that snap to one (a note says so): their steps are meant.
const SNAPS: [&str; 5] = ["spacing", "density", "rotation_deg", "ratio", "face_ratio"];

/// Values, and how many facets the weakest direction sees.
fn values(pipeline: &mut Pipeline, text: &str) -> (Vec<Vec3>, usize) {
    let scene = scene::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let loaded = LoadedScene { scene, base_dir: "".into(), name: String::new(), painted: Painted::default() };
    let outcome = pipeline.effective(&loaded).unwrap();
    let values = mirror_biased_pairs(64, 21).iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect();
    (values, outcome.health().surface.fewest_facets_seen)
}

/// Three places along a slider.
fn places(min: f64, soft_max: f64) -> [f64; 3] {
    let low = if min <= 0.0 { min + 1e-3 * (soft_max - min) } else { min.max(1e-3 * soft_max) };
    [low, 0.3 * soft_max + 0.7 * min.max(0.0), 0.97 * soft_max]
}

/// A step of a thousandth of the slider (at its lower end, of half a percent), against the plan's stated tolerance, or the
/// noise of the facets in sight where those are so few that it is larger.
fn probe(pipeline: &mut Pipeline, name: &str, min: f64, soft_max: f64, text: impl Fn(f64) -> String) -> f64 {
    let mut worst = 0.0_f64;
    for at in places(min, soft_max) {
        let step = (1e-3 * (soft_max - min.max(-soft_max))).min(5e-3 * at.abs());
        let next = if at + step <= soft_max { at + step } else { at - step };
        let ((there, seen), (here, _)) = (values(pipeline, &text(next)), values(pipeline, &text(at)));
        let errors = compare(&there, &here);
        let tolerance = Settings::of_preset(Preset::Draft).tolerance.max(2.0 / (seen.max(1) as f64).sqrt());
        let jump = if errors.rel_l2.is_finite() { errors.rel_l2 } else { 0.0 };
        assert!(jump < tolerance, "{name} from {at} to {next}: {:.1} %", 100.0 * jump);
        worst = worst.max(jump);
    }
    worst
}

const BRDF: &str = r#"{ kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }"#;
const QUALITY: &str = "[quality]\npreset = \"draft\"\nfacets = 1024\nbackend = \"cpu\"\nmethod = \"direct\"\n";

#[test]
fn no_slider_of_a_geometry_jumps() {
    for kind in Geometry::kinds().into_iter().filter(|kind| !["heightfield", "mesh", "flat"].contains(&kind.kind)) {
        let mut pipeline = Pipeline::new();
        for field in kind.fields.iter().filter(|field| !SNAPS.contains(&field.key)) {
            let Shape::Number { min, soft_max, .. } = field.shape else { continue };
            let fewer = if kind.kind == "rods" { ", count = 12, radius = 0.05" } else { "" };
            let fewer = if field.key == "radius" { ", count = 12" } else { fewer };
            let worst = probe(&mut pipeline, &format!("{} {}", kind.kind, field.key), min, soft_max, |value| {
                format!(
                    "[tile]\ngeometry = {{ kind = \"{}\"{fewer}, {} = {value} }}\n[[material]]\nname = \"default\"\nbrdf = \
                     {BRDF}\n{QUALITY}",
                    kind.kind, field.key
                )
            });
            eprintln!("{:<10} {:<18} {:.2} %", kind.kind, field.key, 100.0 * worst);
        }
    }
}

#[test]
fn no_slider_of_a_brdf_jumps() {
    let mut pipeline = Pipeline::new();
    for kind in TermSpec::kinds() {
        for field in &kind.fields {
            let Shape::Number { min, soft_max, .. } = field.shape else { continue };
            let worst = probe(
                &mut pipeline,
                &format!("{} {}", kind.kind, field.key),
                min.max(0.1),
                soft_max,
                |value| {
                    format!(
                        "[tile]\ngeometry = {{ kind = \"pyramids\" }}\n[[material]]\nname = \"default\"\nbrdf = {{ kind = \"{}\", {} \
                     = {value} }}\n{QUALITY}",
                        kind.kind, field.key
                    )
                },
            );
            eprintln!("{:<14} {:<10} {:.2} %", kind.kind, field.key, 100.0 * worst);
        }
    }
}
