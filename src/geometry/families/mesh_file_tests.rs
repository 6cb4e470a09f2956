use super::*;

fn load(text: &str) -> Result<TileMesh> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tile.obj"), text).unwrap();
    build(&MeshFile { path: "tile.obj".into() }, Vec2::ONE, folder.path())
}

const PLANE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

#[test]
fn a_plane_with_a_closed_solid_above_it_closes_the_plane() {
    let tetrahedron = "v .4 .4 .2\nv .6 .4 .2\nv .5 .6 .2\nv .5 .5 .5\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 7 5 8\n";
    let mesh = load(&format!("{PLANE}{tetrahedron}")).unwrap();
    assert!(mesh.closes_plane && !mesh.is_height_field(), "{:?}", mesh.notes);
    assert!(load(PLANE).unwrap().is_height_field());
}

#[test]
fn a_mesh_with_holes_has_a_note() {
    let mesh = load("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").unwrap();
    assert!(!mesh.closes_plane);
    assert!(mesh.notes[0].contains("open edges"));
}

#[test]
fn corner_normals_come_only_from_the_file() {
    assert_eq!(load(PLANE).unwrap().corner_normals, None);
    let tilted = "vn 1 0 1\nusemtl a\nf 1//1 2//1 3//1\nf 1 3 4\n";
    let normals = load(&format!("{PLANE}{tilted}")).unwrap().corner_normals.unwrap();
    let slanted = Vec3::new(0.5f32.sqrt(), 0.0, 0.5f32.sqrt());
    let is = |expected: Vec3| {
        normals.iter().filter(|corners| corners.iter().all(|n| (*n - expected).length() < 1e-6)).count()
    };
    assert_eq!((normals.len(), is(Vec3::Z), is(slanted)), (4, 3, 1));
}

#[test]
fn concave_polygons_keep_their_area_and_facing() {
    // An L of area 3.
    let file = obj::read("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 4 5 6 1 2 3\n", RULES).unwrap();
    let (triangles, _) = triangles(&file);
    let area = |triangle: &[ObjCorner; 3]| {
        let [a, b, c] = triangle.map(|corner| file.positions[corner.position as usize]);
        0.5 * (b - a).cross(c - a).z
    };
    assert_eq!(triangles.len(), 4);
    assert!(triangles.iter().all(|triangle| area(triangle) > 0.0));
    assert!((triangles.iter().map(area).sum::<f32>() - 3.0).abs() < 1e-6);
}

#[test]
#[ignore = "needs meshes: BISCALE_DATA names a folder with spot.obj, teapot.obj and stanford-bunny.obj"]
fn real_files_read_as_tobj_reads_them() {
    let Some(folder) = crate::testing::measured_data::folder("BISCALE_DATA") else { return };
    for name in ["spot.obj", "teapot.obj", "stanford-bunny.obj"] {
        let path = folder.join(name);
        let text = std::fs::read(&path).unwrap();
        let file = obj::read(&String::from_utf8_lossy(&text), RULES).unwrap();
        let (ours, _) = triangles(&file);
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let (models, _) = tobj::load_obj_buf(&mut text.as_slice(), &options, |_| Ok(Default::default())).unwrap();
        let theirs: Vec<[f32; 3]> = models
            .iter()
            .flat_map(|model| {
                model.mesh.indices.iter().map(|&i| std::array::from_fn(|k| model.mesh.positions[3 * i as usize + k]))
            })
            .collect();
        assert_eq!(ours.len() * 3, theirs.len(), "{name}");
        let area = |[a, b, c]: [Vec3; 3]| f64::from((b - a).cross(c - a).length());
        let ours: f64 = ours.iter().map(|t| area(t.map(|corner| file.positions[corner.position as usize]))).sum();
        let theirs: f64 = theirs.chunks(3).map(|t| area([t[0].into(), t[1].into(), t[2].into()])).sum();
        assert!((ours / theirs - 1.0).abs() < 1e-3, "{name}: {ours} {theirs}");
    }
}
