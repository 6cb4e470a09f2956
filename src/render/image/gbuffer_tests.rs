use super::*;
use crate::render::object;
use crate::scene;

fn view_of(kind: &str) -> (ObjectMesh, CameraView) {
    let mesh = object::build(&scene::Object { kind: kind.to_owned(), path: None }, std::path::Path::new(".")).unwrap();
    let view = CameraView::new(&scene::Camera::default(), &mesh, [96, 96]).unwrap();
    (mesh, view)
}

#[test]
fn every_covered_sample_has_a_frame_that_faces_the_viewer() {
    for kind in ["sphere", "skirt", "teapot"] {
        let (mesh, view) = view_of(kind);
        let buffer = GBuffer::new(&mesh, &view, 2);
        assert_eq!((buffer.width, buffer.height), (192, 192));
        let covered: Vec<_> = (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NO_TRIANGLE).collect();
        assert!(covered.len() > 6000, "{kind}: {}", covered.len());
        for k in covered {
            let (n, t) = (buffer.normals[k], buffer.tangents[k]);
            let viewer = (view.eye - buffer.positions[k]).normalize();
            assert!(n.dot(viewer) >= MIN_COSINE - 1e-5, "{kind}");
            assert!(
                (n.length() - 1.0).abs() < 1e-5 && (t.length() - 1.0).abs() < 1e-5 && n.dot(t).abs() < 1e-5,
                "{kind}"
            );
        }
    }
}

#[test]
fn bands_hold_whole_pixels_and_follow_each_other() {
    let (mesh, view) = view_of("teapot");
    let view = CameraView { size: [96, 50], ..view };
    for samples_per_side in [1, 3, 20] {
        let [width, height] = view.size.map(|n| n * samples_per_side);
        let rows =
            GBuffer::map_bands(&mesh, &view, samples_per_side, |row, band| (row * samples_per_side, band.height));
        let mut next = 0;
        for (row, height) in &rows {
            assert!(*row == next && height % samples_per_side == 0, "{rows:?}");
            next += height;
        }
        assert_eq!(next, height);
        let at_once = Projection::new(&mesh, &view, [width, height], height);
        assert_eq!(at_once.band_count(), 1);
        let whole = GBuffer::of_samples(&mesh, &view, width, &at_once.samples(0));
        assert!(GBuffer::new(&mesh, &view, samples_per_side) == whole, "{samples_per_side} samples per side");
        assert!(whole.triangles.iter().any(|triangle| *triangle != NO_TRIANGLE));
    }
}

#[test]
fn a_sphere_has_its_exact_normals_except_at_the_rim() {
    let (mesh, view) = view_of("sphere");
    let buffer = GBuffer::new(&mesh, &view, 1);
    for k in (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NO_TRIANGLE) {
        let radial = buffer.positions[k].normalize();
        let viewer = (view.eye - buffer.positions[k]).normalize();
        if radial.dot(viewer) > 0.1 {
            assert!((radial - buffer.normals[k]).length() < 2e-3);
            assert!((buffer.positions[k].length() - 1.0).abs() < 2e-3);
        }
    }
}

#[test]
fn bending_is_the_least_that_reaches_the_cosine() {
    let viewer = Vec3::Z;
    let away = Vec3::new(0.8, 0.0, -0.6);
    let bent = bent_towards(away, viewer);
    assert!((bent.dot(viewer) - MIN_COSINE).abs() < 1e-6 && bent.y == 0.0 && bent.x > 0.0);
    let facing = Vec3::new(0.0, 0.6, 0.8);
    assert_eq!(bent_towards(facing, viewer), facing);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (mesh, view) = view_of("teapot");
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| GBuffer::new(&mesh, &view, 2))
    };
    assert_eq!(with_threads(1), with_threads(3));
}
