//! Images of slabs against the backdrop, against white surroundings and against very many paths.

use std::path::Path;
use std::time::Instant;

use glam::Vec3;

use super::*;
use crate::base::Cancel;
use crate::pipeline::Pipeline;
use crate::render::{Image, RenderScene};
use crate::scene::{LoadedScene, Painted, parse};

fn loaded(source: &str) -> LoadedScene {
    let scene =
        parse(&format!("[quality]\npreset = \"draft\"\n[tile]\ngeometry = {{ kind = \"flat\" }}\n{source}")).unwrap();
    LoadedScene { scene, base_dir: Path::new("").to_owned(), name: String::new(), painted: Painted::default() }
}

/// A sheet before a checkerboard of squares of 0.2, seen from 20 degrees to the side.
fn sheet(slab: &str, distance: f32) -> LoadedScene {
    loaded(&format!(
        "[object]\nkind = \"sheet\"\n[camera]\nazimuth_deg = 20\nelevation_deg = 12\ndistance = 2.5\n\
         [background]\nkind = \"checkerboard\"\ndistance = {distance}\nsize = 0.2\ncolors = [1.0, 0.0]\n{slab}"
    ))
}

fn rendered(loaded: &LoadedScene, paths: usize, size: [usize; 2]) -> Image {
    let pipeline = Pipeline::new();
    let outcome = pipeline.slab(loaded).unwrap();
    let render_scene = RenderScene::with(&pipeline, loaded).unwrap();
    let mut scene = SlabScene::with(&pipeline, loaded, &outcome, &render_scene).unwrap();
    scene.paths = paths;
    scene.render(&render_scene, size, 1, &Cancel::default()).unwrap().image
}

pub(super) fn rms(a: &Image, b: &Image) -> f32 {
    let grey = |v: Vec3| v.element_sum() / 3.0;
    let squares = a.pixels.iter().zip(&b.pixels).map(|(a, b)| grey(*a - *b).powi(2));
    (squares.sum::<f32>() / a.pixels.len() as f32).sqrt()
}

const FACES: [(&str, &str); 4] = [
    (
        "0.05/0.05",
        "top = { kind = \"beckmann\", roughness = 0.05 }\nbottom = { kind = \"beckmann\", roughness = 0.05 }",
    ),
    (
        "0.15/0.15",
        "top = { kind = \"beckmann\", roughness = 0.15 }\nbottom = { kind = \"beckmann\", roughness = 0.15 }",
    ),
    ("0.05x0.3", "top = { kind = \"beckmann\", roughness = [0.05, 0.3] }\nbottom = { kind = \"smooth\" }"),
    ("ggx 0.1/0.1", "top = { kind = \"ggx\", roughness = 0.1 }\nbottom = { kind = \"ggx\", roughness = 0.1 }"),
];

#[test]
fn a_slab_of_index_1_shows_the_background_exactly() {
    let size = [96, 64];
    let rough = sheet(
        "[slab]\neta = 1\ntop = { kind = \"ggx\", roughness = 0.3 }\nbottom = { kind = \"ggx\", roughness = 0.3 }",
        0.3,
    );
    let image = rendered(&rough, 16, size);
    let draft = rendered(&rough, 0, size);
    // A camera that sees past the object sees the background alone.
    let mut alone = rough.clone();
    alone.scene.object.kind = "sphere".to_owned();
    let pipeline = Pipeline::new();
    let render_scene = RenderScene::with(&pipeline, &rough).unwrap();
    let backdrop = SlabScene::backdrop(&pipeline, &rough, &render_scene).unwrap();
    let view = crate::render::CameraView::new(&render_scene.camera, render_scene.mesh(), size).unwrap();
    for pixel in 0..size[0] * size[1] {
        let behind = image::behind_pixel(&backdrop, &view, pixel);
        assert_eq!(image.pixels[pixel], behind, "{pixel}");
        assert!((draft.pixels[pixel] - behind).abs().max_element() < 1e-5, "{pixel}");
    }
    assert!(image.pixels.iter().any(|pixel| pixel.x > 0.9) && image.pixels.iter().any(|pixel| pixel.x < 0.1));
}

#[test]
fn an_edit_of_the_background_makes_only_what_lies_behind_again_and_one_of_the_camera_nothing() {
    let pipeline = Pipeline::new();
    let stages = |loaded: &LoadedScene| -> Vec<&'static str> {
        let outcome = pipeline.slab(loaded).unwrap();
        let render_scene = RenderScene::with(&pipeline, loaded).unwrap();
        let scene = SlabScene::with(&pipeline, loaded, &outcome, &render_scene).unwrap();
        let names = outcome.times.iter().chain(&scene.times).map(|(name, _)| *name);
        names.filter(|name| *name != "slab").collect()
    };
    let mut loaded = sheet(&format!("[slab]\n{}", FACES[1].1), 0.2);
    assert!(stages(&loaded).contains(&"slab_view"));
    loaded.scene.camera.as_mut().unwrap().azimuth_deg = 5.0;
    assert_eq!(stages(&loaded), [""; 0]);
    loaded.scene.background = sheet("[slab]", 0.3).scene.background;
    assert_eq!(stages(&loaded), ["backdrop"]);
    loaded.scene.slab.as_mut().unwrap().eta = Vec3::splat(1.4);
    assert_eq!(stages(&loaded), ["slab_inner", "slab_view"]);
}

#[test]
fn white_surroundings_without_absorption_are_white_through_a_slab_in_each_pixel() {
    let folder = tempfile::tempdir().unwrap();
    exr::prelude::write_rgb_file(folder.path().join("white.exr"), 32, 16, |_, _| (1f32, 1f32, 1f32)).unwrap();
    for (name, faces) in FACES {
        for background in ["", "[background]\nkind = \"checkerboard\"\ncolors = [1.0, 1.0]\n"] {
            let mut loaded = loaded(&format!(
                "[light]\nenvironment = \"white.exr\"\n[object]\nkind = \"sphere\"\n{background}[slab]\n{faces}"
            ));
            loaded.base_dir = folder.path().to_owned();
            for paths in [0, 64] {
                let image = rendered(&loaded, paths, [48, 48]);
                let worst = image.pixels.iter().map(|p| (*p - 1.0).abs().max_element()).fold(0.0, f32::max);
                println!("{name}, {paths} paths: the worst pixel is off by {worst}");
                assert!(worst < 1e-4, "{name}, {paths} paths: {worst}");
            }
        }
    }
}

#[test]
fn images_are_the_same_for_any_number_of_threads() {
    let loaded = sheet(&format!("[slab]\n{}", FACES[3].1), 0.2);
    let one =
        rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| rendered(&loaded, 8, [64, 48]));
    let three =
        rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(|| rendered(&loaded, 8, [64, 48]));
    assert_eq!(one, three);
}

#[test]
fn a_checkerboard_seen_through_is_near_that_of_very_many_paths() {
    for (name, faces) in [FACES[1], FACES[3]] {
        let loaded = sheet(&format!("[slab]\n{faces}"), 0.2);
        let truth = rendered(&loaded, 2048, [48, 32]);
        let (draft, refined) =
            (rms(&rendered(&loaded, 0, [48, 32]), &truth), rms(&rendered(&loaded, 64, [48, 32]), &truth));
        println!("{name}: draft {draft:.4}, 64 paths {refined:.4}");
        assert!(draft < 0.05 && refined < 0.03, "{name}: draft {draft}, 64 paths {refined}");
    }
}

#[test]
fn a_captured_sheet_is_seen_through_and_its_pixels_differ() {
    let open = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
        crate::scene::open("slab_fig1_grid_sheet", &set).unwrap()
    };
    let loaded = open(&["slab.repeat=[3, 3]"]);
    let (draft, few, many) =
        (rendered(&loaded, 0, [48, 36]), rendered(&loaded, 64, [48, 36]), rendered(&loaded, 1024, [48, 36]));
    let errors = [rms(&draft, &many), rms(&few, &many)];
    println!("captured sheet: draft {:.4}, 64 paths {:.4}", errors[0], errors[1]);
    assert!(errors[0] < 0.05 && errors[1] < 0.03, "{errors:?}");
    let brightest = many.pixels.iter().map(|pixel| pixel.x).fold(0.0, f32::max);
    assert!((0.5..1.0).contains(&brightest), "{brightest}");
    let once = rendered(&open(&["slab.repeat=[1, 1]"]), 1024, [48, 36]);
    assert!(rms(&once, &many) > 0.004, "{}", rms(&once, &many));
}

#[test]
fn a_lamp_behind_is_seen_and_one_in_front_is_reflected() {
    let with_light = |z: f32| {
        let loaded = loaded(&format!(
            "[light]\nenvironment = \"none\"\ncount = 0\ndirectional = [{{ direction = [0.0, 0.0, {z}], irradiance = 1.0 }}]\n\
             [object]\nkind = \"sheet\"\n[camera]\nazimuth_deg = 0\nelevation_deg = 0\n[slab]\n{}",
            FACES[1].1
        ));
        rendered(&loaded, 1, [16, 16]).pixels[8 * 16 + 8].x
    };
    let (behind, before) = (with_light(-1.0), with_light(1.0));
    assert!(behind > 20.0 * before && before > 0.1, "{behind} {before}");
}

/// Prints the errors as rows of a table, and times on standard error.
#[test]
#[ignore = "a measurement: cargo bench --bench measure -- seen-through"]
fn checkerboards_by_distance_and_times() {
    println!("| faces | distance | draft | 16 paths | 64 paths | 1024 paths |\n|---|---|---|---|---|---|");
    for (name, faces) in FACES {
        for distance in [0.05, 0.3, 1.0] {
            let loaded = sheet(&format!("[slab]\n{faces}"), distance);
            let truth = rendered(&loaded, 4096, [96, 64]);
            let of = |paths: usize| rms(&rendered(&loaded, paths, [96, 64]), &truth);
            println!("| {name} | {distance} | {:.3} | {:.3} | {:.3} | {:.3} |", of(0), of(16), of(64), of(1024));
        }
        let mut loaded = sheet(&format!("[slab]\n{faces}"), 0.2);
        if let Some(camera) = &mut loaded.scene.camera {
            camera.distance = 1.6;
        }
        let pipeline = Pipeline::new();
        let outcome = pipeline.slab(&loaded).unwrap();
        let render_scene = RenderScene::with(&pipeline, &loaded).unwrap();
        let mut scene = SlabScene::with(&pipeline, &loaded, &outcome, &render_scene).unwrap();
        for paths in [0, 64] {
            scene.paths = paths;
            let time = |_| {
                let start = Instant::now();
                let rendered = scene.render(&render_scene, [640, 360], 1, &Cancel::default()).unwrap();
                (start.elapsed().as_secs_f64() * 1e3, rendered.points, rendered.times.gbuffer_ms)
            };
            let best = (0..5).map(time).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            eprintln!(
                "{name}, {paths} paths, 640 x 360: {:.1} ms, of it {:.1} ms before shading, {} points",
                best.0, best.2, best.1
            );
        }
        let start = Instant::now();
        let _ = crate::slab::SlabView::new(outcome.slab);
        eprintln!("{name}: table of lobes {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    }
}
