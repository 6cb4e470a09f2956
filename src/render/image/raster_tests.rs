use super::*;
use crate::render::object;
use crate::render::object::Bounds;
use crate::scene;

/// A square [-1, 1]² in the plane z = 0, divided into `n x n` cells of different sizes, each of two triangles.
fn square(n: usize, two_sided: bool) -> ObjectMesh {
    let mut mesh = ObjectMesh { two_sided, ..ObjectMesh::default() };
    for j in 0..=n {
        for i in 0..=n {
            let at = |k: usize| -1.0 + 2.0 * (k as f32 / n as f32).powf(1.3);
            mesh.positions.push(Vec3::new(at(i), at(j), 0.0));
        }
    }
    let row = n as u32 + 1;
    for k in 0..(n * n) as u32 {
        let a = k / n as u32 * row + k % n as u32;
        mesh.triangles.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
    }
    (mesh.normals, mesh.tangents) = (vec![Vec3::Z; mesh.positions.len()], vec![Vec3::X; mesh.positions.len()]);
    mesh.bounds = Bounds::of(&mesh.positions);
    mesh
}

fn facing(mesh: &ObjectMesh, azimuth_deg: f32, distance: f32, size: [usize; 2]) -> CameraView {
    let camera = scene::Camera { azimuth_deg, elevation_deg: 0.0, distance, ..scene::Camera::default() };
    CameraView::new(&camera, mesh, size).unwrap()
}

fn rasterize(mesh: &ObjectMesh, view: &CameraView, width: usize, height: usize) -> Vec<RasterSample> {
    let projection = Projection::new(mesh, view, [width, height], 7);
    (0..projection.band_count()).flat_map(|band| projection.samples(band)).collect()
}

#[test]
fn each_sample_inside_a_triangulated_square_is_covered_exactly_once() {
    let mesh = square(13, false);
    // The square is larger than the image: exactly one triangle covers each sample.
    let view = facing(&mesh, 0.0, 1.5, [64, 64]);
    let projected = project(&mesh, &view, 64, 64);
    let mut hits = vec![0; 64 * 64];
    for piece in &projected {
        let mut alone = vec![EMPTY; 64 * 64];
        fill(piece, &mut alone, 64, 0);
        alone.iter().zip(&mut hits).for_each(|(sample, hits)| *hits += usize::from(sample.triangle != NO_TRIANGLE));
    }
    assert!(hits.iter().all(|&h| h == 1), "{:?}", hits.iter().max());
}

#[test]
fn coverage_equals_the_projected_area_and_barycentrics_give_back_the_point() {
    let mesh = square(3, false);
    let view = facing(&mesh, 40.0, 4.0, [300, 200]);
    let samples = rasterize(&mesh, &view, 300, 200);
    let outline = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| view.pixel_from_view(view.view_from_world(Vec3::new(x, y, 0.0))));
    let area: f32 = (0..4).map(|k| 0.5 * outline[k].perp_dot(outline[(k + 1) % 4])).sum::<f32>().abs();
    let covered = samples.iter().filter(|s| s.triangle != NO_TRIANGLE).count() as f32;
    assert!((covered / area - 1.0).abs() < 0.01, "{covered} {area}");
    for (k, sample) in samples.iter().enumerate().filter(|(_, s)| s.triangle != NO_TRIANGLE) {
        let [a, b, c] = mesh.corners(sample.triangle as usize);
        let [v, w] = sample.barycentric;
        let in_view = view.view_from_world(a * (1.0 - v - w) + b * v + c * w);
        let pixel = view.pixel_from_view(in_view);
        let center = glam::Vec2::new((k % 300) as f32 + 0.5, (k / 300) as f32 + 0.5);
        assert!((pixel - center).length() < 0.02, "{pixel} {center}");
        assert!((in_view.z * sample.inverse_depth - 1.0).abs() < 1e-3);
    }
}

#[test]
fn the_back_of_a_surface_is_visible_only_if_it_is_two_sided() {
    for (two_sided, visible) in [(false, false), (true, true)] {
        let mesh = square(2, two_sided);
        let samples = rasterize(&mesh, &facing(&mesh, 180.0, 4.0, [40, 40]), 40, 40);
        assert_eq!(samples.iter().any(|s| s.triangle != NO_TRIANGLE), visible);
    }
}

#[test]
fn the_nearest_of_a_closed_object_faces_the_viewer_and_a_camera_inside_does_not_break() {
    let sphere = object::build(&scene::Object::default(), std::path::Path::new(".")).unwrap();
    let view = facing(&sphere, 10.0, 3.0, [80, 80]);
    for sample in rasterize(&sphere, &view, 80, 80).iter().filter(|s| s.triangle != NO_TRIANGLE) {
        assert!(1.0 / sample.inverse_depth < 3.0);
    }
    let mut open = sphere;
    open.two_sided = true;
    let inside = rasterize(&open, &facing(&open, 10.0, 0.3, [80, 80]), 80, 80);
    assert!(inside.iter().all(|s| s.triangle != NO_TRIANGLE), "from inside, the sphere covers every sample");
}
