//! Images of a tile compared with closed forms and with the effective BRDF.

use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};

use super::*;
use crate::brdf::{Brdf, MaterialAssignment, Term};
use crate::geometry::families::heightfield;
use crate::pipeline::Pipeline;
use crate::scene;

fn wavy() -> TileScene {
    let mesh = heightfield::from_function(UVec2::splat(48), Vec2::ONE, |p| 0.1 * (p.x * std::f32::consts::TAU).sin());
    TileScene::new(Arc::new(mesh))
}

fn from_above(size: usize) -> TileView {
    let elevation = std::f32::consts::FRAC_PI_2;
    let azimuth = -std::f32::consts::FRAC_PI_2;
    TileView { azimuth, elevation, center: Vec2::splat(0.5), span: 1.0, size: [size, size] }
}

#[test]
fn rays_straight_down_meet_the_height_field_at_its_height() {
    let tile = wavy();
    let view = from_above(40);
    for (x, y) in [(3.5, 7.5), (20.0, 20.0), (39.5, 0.5)] {
        let hit = tile.hit(&view, Vec2::new(x, y)).unwrap();
        let expected = Vec2::new(x / 40.0, 1.0 - y / 40.0);
        assert!((hit.position.truncate() - expected).length() < 1e-4, "{hit:?} {expected}");
        assert!((hit.position.z - 0.1 * (expected.x * std::f32::consts::TAU).sin()).abs() < 1e-3);
        assert!((view.pixel_of(hit.position) - Vec2::new(x, y)).length() < 1e-2);
    }
}

#[test]
fn every_ray_meets_a_surface_that_closes_the_plane() {
    let tile = wavy();
    for (azimuth, elevation) in [(0.3, 0.2), (2.0, 0.7), (-1.0, 1.3)] {
        let view = TileView { azimuth, elevation, center: Vec2::ZERO, span: 5.0, size: [60, 40] };
        for k in 0..60 * 40 {
            let at = Vec2::new((k % 60) as f32 + 0.5, (k / 60) as f32 + 0.5);
            assert!(tile.hit(&view, at).is_some(), "{azimuth} {elevation} {at}");
        }
    }
}

#[test]
fn the_mean_over_a_tile_is_the_radiance_of_the_effective_brdf() {
    let source = "[tile]\ngeometry = { kind = \"grooves\", profile = \"v\", count = 2, depth = 0.15 }\n\
        [[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.35, f0 = [0.9, 0.5, 0.2] }\n\
        [quality]\nbackend = \"cpu\"\nmethod = \"direct\"\npenumbra_deg = 0.1\n\
        [effects]\ninterreflection = \"off\"\n";
    let loaded = scene::LoadedScene {
        scene: scene::parse(source).unwrap(),
        base_dir: "".into(),
        name: "test".into(),
        painted: scene::Painted::default(),
    };
    let pipeline = Pipeline::new();
    let brdf = pipeline.effective(&loaded).unwrap().brdf;
    let MaterialAssignment { material_of_slot, materials } = pipeline.materials(&loaded).unwrap();
    let tile = TileScene::new(Arc::new(pipeline.mesh(&loaded).unwrap()));
    let shaded = ShadedMaterials { material_of_slot: &material_of_slot, materials: &materials };
    for (i, azimuth, elevation) in [(from_angles(0.5, 1.0), 0.4_f32, 1.0_f32), (from_angles(1.0, 3.0), 0.1, 0.8)] {
        let o = from_angles(std::f32::consts::FRAC_PI_2 - elevation, azimuth);
        let light = DirectionalLight { direction: i, irradiance: Vec3::ONE };
        // A large view averages over many periods of the grooves.
        let view = TileView { azimuth, elevation, center: Vec2::ZERO, span: 37.0, size: [420, 420] };
        let image =
            tile.image(&view, &TileShading::Materials(vec![light]), shaded, Vec3::ZERO, &Cancel::default()).unwrap();
        let mean = image.pixels.iter().map(|p| p.as_dvec3()).sum::<glam::DVec3>() / image.pixels.len() as f64;
        let expected = brdf.eval(i, o).as_dvec3();
        assert!((mean - expected).length() < 0.02 * expected.length(), "{mean} {expected}");
    }
}

#[test]
fn a_cancelled_image_is_an_error_and_clay_is_grey_whatever_the_material() {
    let tile = wavy();
    let red = Material { brdf: Brdf { terms: vec![Term::Lambertian { albedo: Vec3::X }] }, color: Vec3::ONE };
    let shaded = ShadedMaterials { material_of_slot: &[0], materials: std::slice::from_ref(&red) };
    let cancel = Cancel::default();
    let image = tile.image(&from_above(16), &TileShading::Clay, shaded, Vec3::ZERO, &cancel).unwrap();
    assert!(image.pixels.iter().all(|p| p.x > 0.05 && p.x == p.y && p.y == p.z));
    cancel.set();
    let image = tile.image(&from_above(16), &TileShading::Clay, shaded, Vec3::ZERO, &cancel);
    assert!(matches!(image, Err(Error::Cancelled)));
}

#[test]
fn tiles_are_visible_up_close_and_the_image_keeps_its_brightness() {
    use crate::render::image::shading::ImageBackground;
    use crate::render::render;
    use crate::render::{RenderInput, object};
    let source = "[tile]\ngeometry = { kind = \"pyramids\", height = 0.2, spacing = 0.5 }\n\
        [[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.5, f0 = 0.8 }\n\
        [quality]\nbackend = \"cpu\"\nmethod = \"direct\"\npenumbra_deg = 0.1\n";
    let scene = scene::parse(source).unwrap();
    let painted = scene::Painted::default();
    let loaded = scene::LoadedScene { scene, base_dir: "".into(), name: "test".into(), painted };
    let pipeline = Pipeline::new();
    let brdf = pipeline.effective(&loaded).unwrap().brdf;
    let MaterialAssignment { material_of_slot, materials } = pipeline.materials(&loaded).unwrap();
    let shaded = ShadedMaterials { material_of_slot: &material_of_slot, materials: &materials };
    let tile = TileScene::new(Arc::new(pipeline.mesh(&loaded).unwrap()));
    let object = scene::Object { kind: "sphere".to_owned(), path: None };
    let mesh = object::build(&object, std::path::Path::new("")).unwrap();
    let light = |x, y, z| DirectionalLight { direction: Vec3::new(x, y, z).normalize(), irradiance: Vec3::splat(2.0) };
    let lights = [light(0.5, 0.9, 0.8), light(-0.8, 0.3, 0.7)];
    for (fov_deg, changes) in [(30.0, false), (1.2, true)] {
        let camera = scene::Camera { fov_deg, distance: 4.0, ..scene::Camera::default() };
        let input = RenderInput {
            mesh: &mesh,
            occluder: None,
            shadow_cache: None,
            lights: &lights,
            camera: &camera,
            reflectance: &*brdf,
            size: [240, 240],
            samples_per_side: 1,
            tolerance: 0.0,
            background: &ImageBackground::default(),
        };
        let far = render(&input).unwrap().image;
        let mut near = far.clone();
        tile.blend_into(&mut near, &input, shaded, filtered::Corrections::Measured, &Cancel::default()).unwrap();
        assert_eq!(near != far, changes, "{fov_deg}");
        let mean = |image: &Image| image.pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() / 57600.0;
        assert!((mean(&near) / mean(&far) - 1.0).abs() < 0.05, "{} {}", mean(&near), mean(&far));
        let spread = |image: &Image| {
            let m = mean(image);
            image.pixels.iter().map(|p| (f64::from(p.x) - m).powi(2)).sum::<f64>()
        };
        assert!(!changes || spread(&near) > 4.0 * spread(&far), "the tiles' own contrast is visible");
    }
}
