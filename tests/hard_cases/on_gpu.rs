//! One case of each family on the graphics processor (lavapipe where there is none): finite, and what the CPU makes.

use biscale::base::Cancel;
use biscale::gpu::{Gpu, GpuRenderer};
use biscale::pipeline::Pipeline;
use biscale::render::RenderScene;
use biscale::render::image::shading::Background;
use biscale::render::render;
use biscale::scene::LoadedScene;

use crate::cases::{Case, brdfs, geometries};
use crate::examination::open;

/// The hardest of each family that a picture shows.
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
fn one_case_of_each_family_is_the_same_image_on_the_graphics_processor() {
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
            same_image(&gpu, &loaded, 40, &format!("{name}, {method}"));
        }
    }
}

/// The picture of a scene, `side` pixels wide and high, is what the CPU makes.
pub fn same_image(gpu: &Gpu, loaded: &LoadedScene, side: usize, name: &str) {
    let outcome = Pipeline::new().effective(loaded).unwrap();
    let stage = RenderScene::new(loaded).unwrap();
    let background = Background::default();
    let input = stage.input(&*outcome.brdf, [side; 2], 1, &background);
    let cpu = render(&input).unwrap().image.pixels;
    let mut renderer = match GpuRenderer::with_material(gpu, stage.mesh(), stage.occluder(), &outcome.brdf) {
        Ok(renderer) => renderer,
        Err(error) => return eprintln!("SKIPPED: {name}: {error}"),
    };
    let device = renderer.render(gpu, &input, &Cancel::default()).unwrap().image.pixels;
    let bad = device.iter().position(|pixel| !pixel.is_finite() || pixel.min_element() < 0.0);
    assert_eq!(bad, None, "{name}: {:?}", bad.map(|at| device[at]));
    // Edges may show another triangle, and narrow lobes multiply the G-buffer's last bits (gpu_shading_tests.rs).
    let scale = cpu.iter().map(|pixel| pixel.max_element()).sum::<f32>() / cpu.len() as f32;
    let mut apart: Vec<f32> = cpu
        .iter()
        .zip(&device)
        .map(|(a, b)| (*a - *b).abs().max_element() / (a.max_element() + scale).max(1e-20))
        .collect();
    apart.sort_by(f32::total_cmp);
    let most = apart[apart.len() * 9 / 10];
    assert!(most < 0.05, "{name}: nine in ten pixels are within {most}");
}
