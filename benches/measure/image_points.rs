//! Errors and times of images whose material is interpolated between points.

use biscale::base::Cancel;
use biscale::pipeline::Pipeline;
use biscale::render::image::shading::ImageBackground;
use biscale::render::image::tone_map::ToneMap;
use biscale::render::{Image, RenderInput, RenderScene, render};
use biscale::scene;
use glam::Vec3;

/// Size of an image in pixels.
const SIZE: [usize; 2] = [705, 805];
/// Images per time.
const REPEATS: usize = 5;

/// Prints times of shading at every point and at the points that the tolerance of `standard` asks for, and the difference
/// of both images.
pub fn image_points(print: &mut dyn FnMut(String)) {
    print(
        "scene                samples  every point  interpolated   rel. L2  pixels off by more than 1/255".to_owned(),
    );
    for name in ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt", "default"] {
        let loaded = scene::open(name, &["quality.backend=cpu".to_owned()]).unwrap();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let brdf = outcome.shading_brdf(&Cancel::default()).unwrap().brdf;
        let scene = RenderScene::new(&loaded).unwrap();
        let (background, tones) = (ImageBackground::Uniform(Vec3::ZERO), ToneMap::new(&scene.camera).unwrap());
        for samples_per_side in [1, 2] {
            let input = scene.input(&*brdf, SIZE, samples_per_side, &background);
            let timed = |input: &RenderInput| -> (Image, f64) {
                let images: Vec<_> = (0..REPEATS).map(|_| render(input).unwrap()).collect();
                let mut times: Vec<f64> = images.iter().map(|rendered| rendered.times.shading_ms).collect();
                times.sort_by(f64::total_cmp);
                (images[0].image.clone(), times[REPEATS / 2])
            };
            let (exact, exact_ms) = timed(&RenderInput { tolerance: 0.0, ..input });
            let (image, ms) = timed(&input);
            let squares = |values: &mut dyn Iterator<Item = Vec3>| {
                values.map(|value| f64::from(value.length_squared())).sum::<f64>()
            };
            let differences = &mut image.pixels.iter().zip(&exact.pixels).map(|(a, b)| *a - *b);
            let rel_l2 = (squares(differences) / squares(&mut exact.pixels.iter().copied())).sqrt();
            let (shown, exact) = (image.to_srgb(&tones), exact.to_srgb(&tones));
            let pixels = shown.chunks(3).zip(exact.chunks(3));
            let off = pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 1)).count();
            let percent = 100.0 * off as f64 / (SIZE[0] * SIZE[1]) as f64;
            let samples = samples_per_side * samples_per_side;
            print(format!(
                "{name:<20} {samples:>7} {exact_ms:>9.0} ms {ms:>10.0} ms {:>8.2} % {percent:>10.3} %",
                100.0 * rel_l2
            ));
        }
    }
}
