use super::*;

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn a_tetrahedron_loads_closed_and_without_uvs_warns() {
    let mesh = parse(TETRAHEDRON).unwrap();
    assert_eq!((mesh.triangles.len(), mesh.two_sided), (4, false));
    assert!(mesh.warnings.iter().any(|w| w.contains("no UVs")), "{:?}", mesh.warnings);
    assert!(mesh.normals[0].dot(Vec3::splat(-1.0)) > 1.7);
}

#[test]
fn an_open_mesh_is_two_sided_and_an_inside_out_one_is_turned() {
    assert!(parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n").unwrap().two_sided);
    let turned = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n").unwrap();
    assert!(turned.warnings.iter().any(|w| w.contains("inwards")));
    assert!(turned.normals[0].dot(Vec3::splat(-1.0)) > 1.7);
}

#[test]
fn any_unit_of_length_gives_the_same_mesh() {
    let original = parse(TETRAHEDRON).unwrap();
    assert!((original.bounds.radius - 1.0).abs() < 1e-6);
    for unit in ["1e-30", "1e30"] {
        let scaled = parse(
            &TETRAHEDRON
                .replace("v 1", &format!("v {unit}"))
                .replace(" 1\nf", &format!(" {unit}\nf"))
                .replace("0 1 0\nv", &format!("0 {unit} 0\nv")),
        )
        .unwrap();
        for (a, b) in original.positions.iter().zip(&scaled.positions) {
            assert!(a.distance(*b) < 1e-6, "{unit}: {a} {b}");
        }
        assert!(original.normals.iter().zip(&scaled.normals).all(|(a, b)| a.distance(*b) < 1e-5));
    }
}

#[test]
fn mistakes_are_named_with_their_line() {
    let cases = [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        ("v 0 0 0\nv nan 0 0\n", "line 2: found nan"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: found v index 4, expected 1 to 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/-1 2/-2 3/-9223372036854775808\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/2 2/2 3/2\n", "vt index 2"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", "at least 3"),
        ("v 0 0\n", "line 1"),
        ("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "none with an area"),
    ];
    for (text, expected) in cases {
        let error = parse(text).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(expected), "{text}: {error}");
    }
    let missing = load(Path::new("/nowhere/a.obj")).unwrap_err();
    assert!(missing.to_string().contains("/nowhere/a.obj"), "{missing}");
}

#[test]
#[ignore = "needs meshes: BISCALE_DATA names a folder with spot.obj, teapot.obj and stanford-bunny.obj"]
fn real_meshes_load_with_unit_frames() {
    let Some(folder) = crate::testing::measured_data::folder("BISCALE_DATA") else { return };
    for (name, triangles) in [("spot.obj", 5856), ("teapot.obj", 6320), ("stanford-bunny.obj", 69_451)] {
        let mesh = load(&folder.join(name)).unwrap();
        assert!(mesh.triangles.len().abs_diff(triangles) <= triangles / 50, "{name}: {}", mesh.triangles.len());
        for (n, t) in mesh.normals.iter().zip(&mesh.tangents) {
            assert!((n.length() - 1.0).abs() < 1e-5 && (t.length() - 1.0).abs() < 1e-5 && n.dot(*t).abs() < 1e-5);
        }
    }
}
