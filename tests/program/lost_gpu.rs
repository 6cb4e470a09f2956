//! A GPU that is lost in the middle of a frame.

use std::time::{Duration, Instant};

use biscale::base::Cancel;
use biscale::gpu::{Gpu, GpuRenderer};
use biscale::pipeline::Pipeline;
use biscale::render::RenderScene;
use biscale::render::image::shading::ImageBackground;
use biscale::render::render;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};

const SCENE: &str = r#"
[tile]
geometry = { kind = "grooves", count = 2 }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.4, f0 = 0.8 }
[light]
count = 4
[quality]
preset = "draft"
facets = 256
backend = "cpu"
method = "direct"
"#;

fn loaded() -> LoadedScene {
    let scene = scene::parse(SCENE).unwrap();
    LoadedScene { scene, base_dir: "".into(), name: "a".to_owned(), painted: Painted::default() }
}

#[test]
fn a_gpu_lost_in_the_middle_of_a_frame_is_an_error_and_the_cpu_still_renders() {
    let gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) => return eprintln!("SKIPPED: {error}"),
    };
    let loaded = loaded();
    let outcome = Pipeline::new().effective(&loaded).unwrap();
    let render_scene = RenderScene::new(&loaded).unwrap();
    let background = ImageBackground::default();
    let input = render_scene.input(&*outcome.brdf, [96, 96], 2, &background);
    let mut renderer =
        GpuRenderer::with_material(&gpu, render_scene.mesh(), render_scene.occluder(), &outcome.brdf).unwrap();
    renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    // Another thread destroys the device while frames are drawn.
    let device = gpu.device.clone();
    let destroyer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(30));
        device.destroy();
    });
    let start = Instant::now();
    let mut failed = None;
    while failed.is_none() && start.elapsed() < Duration::from_secs(60) {
        match renderer.render(&gpu, &input, &Cancel::default()) {
            Ok(rendered) => assert!(rendered.image.pixels.iter().all(|pixel| pixel.is_finite())),
            Err(error) => failed = Some(error),
        }
    }
    destroyer.join().unwrap();
    let error = failed.expect("frames succeed after the device is destroyed").to_string();
    assert!(!error.is_empty());
    eprintln!("lost device: {error}");
    // The CPU renders the same input.
    assert!(render(&input).unwrap().image.pixels.iter().any(|pixel| pixel.max_element() > 0.0));
}
