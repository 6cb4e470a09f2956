use super::*;
use crate::render::object;
use crate::scene;

fn object(kind: &str) -> ObjectMesh {
    object::build(&scene::Object { kind: kind.to_owned(), path: None }, std::path::Path::new(".")).unwrap()
}

#[test]
fn only_objects_with_dents_or_insides_can_shadow_themselves() {
    let expected =
        [("sphere", false), ("cylinder", false), ("cup", true), ("plate", true), ("skirt", true), ("teapot", true)];
    for (kind, shadows) in expected {
        assert_eq!(can_self_shadow(&object(kind)), shadows, "{kind}");
    }
    let mut dented = object("sphere");
    dented.positions[3000] *= 0.99;
    assert!(can_self_shadow(&dented));
    let mut flat =
        ObjectMesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE - Vec3::Z], ..ObjectMesh::default() };
    (flat.triangles, flat.two_sided) = (vec![[0, 1, 2], [1, 3, 2]], true);
    assert!(!can_self_shadow(&flat));
    flat.positions[3].z = 0.2;
    assert!(can_self_shadow(&flat));
}

fn points_on(mesh: &ObjectMesh, count: usize) -> ShadingPoints {
    let mut points = ShadingPoints::default();
    for k in 0..count {
        let triangle = k * mesh.triangles.len() / count;
        let [u, v, w] = [0.2, 0.3, 0.5];
        let mix = |values: &[Vec3]| {
            let [a, b, c] = mesh.triangles[triangle].map(|i| values[i as usize]);
            a * u + b * v + c * w
        };
        points.positions.push(mix(&mesh.positions));
        points.normals.push(mix(&mesh.normals).normalize());
        points.triangles.push(triangle as u32);
        points.pixels.push(k as u32);
    }
    points
}

#[test]
fn every_light_above_the_smooth_horizon_of_a_coarse_sphere_is_visible_if_rays_are_cast() {
    let mesh = object("sphere");
    let occluder = Occluder::new(&mesh);
    let points = points_on(&mesh, 2000);
    let lights: Vec<_> = [Vec3::X, Vec3::Y, Vec3::new(0.6, -0.48, 0.64)]
        .map(|direction| DirectionalLight { direction, irradiance: Vec3::ONE })
        .to_vec();
    let visibility = occluder.visible_lights(&mesh, &points, &lights, Vec3::ZERO, None);
    for point in 0..points.len() {
        for (k, light) in lights.iter().enumerate() {
            let above = light.direction.dot(points.normals[point]);
            // A ray that grazes within a tenth of a degree may touch the polygons' edges.
            if above.abs() > 2e-3 {
                assert_eq!(visibility.is_lit(point, k), above > 0.0, "{above}");
            }
        }
    }
}

#[test]
fn the_inside_of_a_cup_is_dark_from_the_side_and_lit_from_above() {
    let mesh = object("cup");
    let occluder = Occluder::if_needed(&mesh).unwrap();
    let bottom = (0..mesh.triangles.len()).find(|&k| {
        let p = mesh.corners(k).iter().sum::<Vec3>() / 3.0;
        (p.y - 0.06).abs() < 1e-3 && p.x.hypot(p.z) < 0.2
    });
    let triangle = bottom.unwrap();
    let points = ShadingPoints {
        pixels: vec![0],
        positions: vec![mesh.corners(triangle).iter().sum::<Vec3>() / 3.0],
        normals: vec![Vec3::Y],
        triangles: vec![triangle as u32],
        ..ShadingPoints::default()
    };
    let light =
        |x: f32, y: f32| DirectionalLight { direction: Vec3::new(x, y, 0.0).normalize(), irradiance: Vec3::ONE };
    let visibility = occluder.visible_lights(
        &mesh,
        &points,
        &[light(0.0, 1.0), light(1.0, 1.0), light(0.2, 1.0), light(0.0, -1.0)],
        Vec3::Y,
        None,
    );
    assert_eq!([0, 1, 2, 3].map(|k| visibility.is_lit(0, k)), [true, false, true, false]);
}

#[test]
fn the_cache_agrees_with_cast_rays() {
    for kind in ["cup", "skirt", "teapot"] {
        let mesh = object(kind);
        let occluder = Occluder::if_needed(&mesh).unwrap();
        let camera = scene::Camera::default();
        let view = crate::render::CameraView::new(&camera, &mesh, [96, 96]).unwrap();
        let points = ShadingPoints::new(&mesh, &view, 1);
        let environment = crate::render::lighting::environment::load("studio", std::path::Path::new(".")).unwrap();
        let lights = crate::render::lighting::environment::split(&environment.map, 40);
        let cache = occluder.cache(&mesh, &lights);
        let cast = occluder.visible_lights(&mesh, &points, &lights, view.eye, None);
        let cached = occluder.visible_lights(&mesh, &points, &lights, view.eye, Some(&cache));
        let wrong: u32 = cast.words.iter().zip(&cached.words).map(|(a, b)| (a ^ b).count_ones()).sum();
        let share = f64::from(wrong) / (points.len() * lights.len()) as f64;
        eprintln!("{kind}: {:.4} % of point-light pairs differ", 100.0 * share);
        assert!(share < 0.002, "{kind}: {share}");
        assert_ne!(cached.words, LightVisibility::none(points.len(), lights.len()).words);
    }
}
