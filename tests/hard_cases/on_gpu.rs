//! Cases of each family on the GPU: values are finite and agree with those of the CPU.

use biscale::base::Cancel;
use biscale::gpu::{Gpu, GpuRenderer};
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::render::RenderScene;
use biscale::render::image::shading::ImageBackground;
use biscale::render::render;
use biscale::scene::LoadedScene;
use glam::Vec3;

use crate::cases::{Case, brdfs, geometries};
use crate::examination::open;
use crate::finer_presets;
use crate::invariants::assert_none;

/// Cases that are hard for images.
const CHOSEN: [&str; 8] = [
    "flat",
    "cliffs of 100 tiles",
    "tile of 1e-6",
    "overhang",
    "tile with holes",
    "Cook-Torrance 0.01",
    "grazing Fresnel",
    "Blinn-Phong 1e3",
];

#[test]
fn one_case_of_each_family_has_the_same_image_on_cpu_and_gpu() {
    let gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) => return eprintln!("SKIPPED: {error}"),
    };
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<Case> = [geometries(), brdfs()].concat();
    for name in CHOSEN {
        let case = all.iter().find(|case| case.name == name).unwrap();
        for method in ["direct", "low_rank"] {
            let mut loaded = open(case, method, folder.path());
            loaded.scene.light.count = 8;
            loaded.scene.quality.facets = Some(400);
            check_image(&gpu, &loaded, 40, &format!("{name}, {method}"));
        }
    }
}

/// Visibility under overhangs and images on the GPU, against those of the CPU.
#[test]
#[ignore = "half a minute on software Vulkan: standard and fine"]
fn one_case_of_each_family_agrees_on_cpu_and_gpu_at_finer_presets() {
    let gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) => return eprintln!("SKIPPED: {error}"),
    };
    println!("{}", gpu.description());
    let pairs = mirror_biased_pairs(150, 6);
    let folder = tempfile::tempdir().unwrap();
    for case in finer_presets::chosen() {
        // Shadow maps at `fine` take minutes on software Vulkan, so they are tested at `standard`.
        let presets = if case.name == "overhang" { &["standard"][..] } else { &["standard", "fine"] };
        for &preset in presets {
            let on = |backend: &str| -> Vec<Vec3> {
                let mut loaded = open(&case, "direct", folder.path());
                loaded.scene.quality.preset = preset.to_owned();
                loaded.scene.quality.backend = backend.to_owned();
                // On software Vulkan, the plan computes overhangs on the CPU unless the scene requests maps.
                if backend == "gpu" && case.name == "overhang" {
                    loaded.scene.quality.visibility = Some("maps".to_owned());
                }
                let outcome = Pipeline::new().effective(&loaded).unwrap();
                assert_none(outcome.health().warnings.iter().filter(|warning| warning.contains("fault")).cloned());
                pairs.iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect()
            };
            let (on_gpu, on_cpu) = (on("gpu"), on("cpu"));
            assert!(on_gpu.iter().all(|value| value.is_finite() && value.min_element() >= 0.0));
            let difference = compare(&on_gpu, &on_cpu).rel_l2;
            println!("{preset:<9} {:<17} {:.2} %", case.name, 100.0 * difference);
            // Under overhangs, maps have one bit per facet, ring and azimuth, while slices are exact.
            let bound = if preset == "fine" { 0.04 } else { 0.06 };
            assert!(difference < bound, "{}, {preset}: {difference}", case.name);
            let mut loaded = open(&case, "direct", folder.path());
            loaded.scene.quality.preset = preset.to_owned();
            loaded.scene.light.count = 4;
            check_image(&gpu, &loaded, 12, &format!("{}, {preset}", case.name));
        }
    }
}

/// Checks that the GPU renders the image of a scene, `side` pixels wide and high, as the CPU does.
fn check_image(gpu: &Gpu, loaded: &LoadedScene, side: usize, name: &str) {
    let outcome = Pipeline::new().effective(loaded).unwrap();
    let render_scene = RenderScene::new(loaded).unwrap();
    let background = ImageBackground::default();
    let input = render_scene.input(&*outcome.brdf, [side; 2], 1, &background);
    let cpu_pixels = render(&input).unwrap().image.pixels;
    let mut renderer =
        match GpuRenderer::with_material(gpu, render_scene.mesh(), render_scene.occluder(), &outcome.brdf) {
            Ok(renderer) => renderer,
            Err(error) => return eprintln!("SKIPPED: {name}: {error}"),
        };
    let gpu_pixels = renderer.render(gpu, &input, &Cancel::default()).unwrap().image.pixels;
    let bad = gpu_pixels.iter().position(|pixel| !pixel.is_finite() || pixel.min_element() < 0.0);
    assert_eq!(bad, None, "{name}: {:?}", bad.map(|at| gpu_pixels[at]));
    // A pixel at an edge may show another triangle, and narrow lobes amplify the last bits of the G-buffer.
    let scale = cpu_pixels.iter().map(|pixel| pixel.max_element()).sum::<f32>() / cpu_pixels.len() as f32;
    let mut differences: Vec<f32> = cpu_pixels
        .iter()
        .zip(&gpu_pixels)
        .map(|(a, b)| (*a - *b).abs().max_element() / (a.max_element() + scale).max(1e-20))
        .collect();
    differences.sort_by(f32::total_cmp);
    let bound = differences[differences.len() * 9 / 10];
    assert!(bound < 0.05, "{name}: the bound of nine in ten pixels is {bound}");
}
