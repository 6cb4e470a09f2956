//! Finer qualities: a case of each family at standard and fine, and the paper's own method at its full size.

use biscale::gpu::Gpu;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use glam::Vec3;

use crate::cases::{Case, brdfs, geometries};
use crate::evaluators::Evaluator;
use crate::invariants::{assert_none, broken};
use crate::examination::{Row, examine, measured, open, pairs};
use crate::on_gpu::same_image;

/// Family and name.
const CHOSEN: [(&str, &str); 3] =
    [("geometry, glossy", "cliffs"), ("geometry, white", "overhang"), ("BRDFs", "Cook-Torrance 0.2")];

fn chosen() -> impl Iterator<Item = Case> {
    let all = [geometries(), brdfs()].concat();
    CHOSEN.map(|(family, name)| all.iter().find(|c| (c.family, c.name) == (family, name)).unwrap().clone()).into_iter()
}

/// Evaluators by their names in the table.
fn rows(case: &Case, preset: &str, evaluators: &[&'static str]) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let pipeline = Pipeline::new();
    let mut direct = Vec::new();
    let mut rows = Vec::new();
    for &name in evaluators {
        let mut loaded = open(case, &name.replace(' ', "_"), folder.path());
        loaded.scene.quality.preset = preset.to_owned();
        let outcome = pipeline.effective(&loaded).unwrap();
        let evaluator = Evaluator { name, brdf: outcome.brdf.clone(), health: outcome.health().clone() };
        if direct.is_empty() {
            direct = pairs().iter().map(|p| evaluator.brdf.eval(p.i, p.o)).collect();
        }
        rows.push(measured(case, &evaluator, &pairs(), &direct));
    }
    rows
}

#[test]
fn a_case_at_standard_quality_keeps_every_invariant() {
    assert_none(rows(&chosen().next().unwrap(), "standard", &["direct"]).iter().flat_map(broken));
}

#[test]
#[ignore = "half a minute: standard and fine, both forms"]
fn one_case_of_each_family_keeps_every_invariant_at_finer_qualities() {
    for case in chosen() {
        for preset in ["standard", "fine"] {
            // Factors of all of them at fine quality take a minute.
            let both = preset == "standard" || case.family == "BRDFs";
            let rows = rows(&case, preset, if both { &["direct", "low rank"] } else { &["direct"] });
            for row in &rows {
                println!(
                    "{preset:<9} {:<17} {:<10} swap {:.1e}, area {:.3?}, albedo {:.3?}, from direct {:.1} %",
                    row.case,
                    row.evaluator,
                    row.reciprocity,
                    row.area,
                    row.albedo,
                    100.0 * row.against_direct
                );
            }
            assert_none(rows.iter().flat_map(broken));
        }
    }
}

#[test]
#[ignore = "half a minute: 1857 directions, 6442 normals"]
fn the_papers_method_at_its_full_size_keeps_every_invariant() {
    let case = chosen().last().unwrap();
    assert_none(examine(&case, None).iter().flat_map(broken));
}

/// Visibility under overhangs and pictures where the scene asks for the graphics processor, against the processor alone.
#[test]
#[ignore = "half a minute on software Vulkan: standard and fine"]
fn one_case_of_each_family_is_the_same_on_the_graphics_processor_at_finer_qualities() {
    let gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) => return eprintln!("SKIPPED: {error}"),
    };
    println!("{}", gpu.description());
    let pairs = mirror_biased_pairs(150, 6);
    let folder = tempfile::tempdir().unwrap();
    for case in chosen() {
        // Maps at fine quality take minutes on software Vulkan: standard has them.
        let presets = if case.name == "overhang" { &["standard"][..] } else { &["standard", "fine"] };
        for &preset in presets {
            let on = |backend: &str| -> Vec<Vec3> {
                let mut loaded = open(&case, "direct", folder.path());
                loaded.scene.quality.preset = preset.to_owned();
                loaded.scene.quality.backend = backend.to_owned();
                // By itself software Vulkan leaves overhangs to the CPU.
                if backend == "gpu" && case.name == "overhang" {
                    loaded.scene.quality.visibility = Some("maps".to_owned());
                }
                let outcome = Pipeline::new().effective(&loaded).unwrap();
                assert_none(outcome.health().warnings.iter().filter(|words| words.contains("fault")).cloned());
                pairs.iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect()
            };
            let (there, here) = (on("gpu"), on("cpu"));
            assert!(there.iter().all(|value| value.is_finite() && value.min_element() >= 0.0));
            let apart = compare(&there, &here).rel_l2;
            println!("{preset:<9} {:<17} {:.2} % apart", case.name, 100.0 * apart);
            // Maps of yes and no on rings and azimuths against exact slices, under overhangs.
            let most = if preset == "fine" { 0.04 } else { 0.06 };
            assert!(apart < most, "{}, {preset}: {apart}", case.name);
            let mut loaded = open(&case, "direct", folder.path());
            loaded.scene.quality.preset = preset.to_owned();
            loaded.scene.light.count = 4;
            same_image(&gpu, &loaded, 12, &format!("{}, {preset}", case.name));
        }
    }
}
