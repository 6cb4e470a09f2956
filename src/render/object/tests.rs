use super::*;

fn of_kind(kind: &str) -> ObjectMesh {
    build(&scene::Object { kind: kind.to_owned(), path: None }, Path::new(".")).unwrap()
}

#[test]
fn every_object_has_an_orthonormal_right_handed_frame_that_faces_along_its_triangles() {
    for kind in KINDS.iter().filter(|kind| **kind != "mesh") {
        let mesh = of_kind(kind);
        assert!(mesh.triangles.len() > 500, "{kind}");
        for (n, t) in mesh.normals.iter().zip(&mesh.tangents) {
            assert!((n.length() - 1.0).abs() < 1e-5 && (t.length() - 1.0).abs() < 1e-5, "{kind}");
            assert!(n.dot(*t).abs() < 1e-5, "{kind}");
        }
        for (k, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(k);
            let geometric = (b - a).cross(c - a);
            let shading: Vec3 = triangle.iter().map(|&v| mesh.normals[v as usize]).sum();
            assert!(geometric.dot(shading) > 0.0, "{kind}: triangle {k} faces away from its normals");
        }
    }
}

#[test]
fn normals_and_tangents_are_continuous_across_the_seams_of_the_parameterisation() {
    // Vertices that coincide must agree, except at the poles of a lathe (every tangent occurs) and at creases
    // between parts.
    for kind in ["sphere", "cylinder", "skirt"] {
        let mesh = of_kind(kind);
        let mut by_position = std::collections::HashMap::<[i64; 3], Vec<usize>>::new();
        for (k, p) in mesh.positions.iter().enumerate() {
            by_position.entry(p.to_array().map(|x| (f64::from(x) * 1e5).round() as i64)).or_default().push(k);
        }
        let seams: Vec<_> = by_position.values().filter(|group| group.len() == 2).collect();
        assert!(seams.len() > 20, "{kind}: {} seam vertices", seams.len());
        for group in seams {
            let (a, b) = (group[0], group[1]);
            assert!(mesh.normals[a].dot(mesh.normals[b]) > 0.999_99, "{kind}");
            assert!(mesh.tangents[a].dot(mesh.tangents[b]) > 0.999_99, "{kind}");
        }
    }
}

#[test]
fn closed_objects_enclose_a_positive_volume_near_the_closed_form() {
    let volume = |mesh: &ObjectMesh| -> f64 {
        (0..mesh.triangles.len())
            .map(|k| {
                let [a, b, c] = mesh.corners(k).map(|p| p.as_dvec3());
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    };
    let sphere = volume(&of_kind("sphere"));
    assert!((sphere / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.005, "{sphere}");
    let cylinder = volume(&of_kind("cylinder"));
    assert!((cylinder / (std::f64::consts::PI * 0.6 * 0.6 * 1.6) - 1.0).abs() < 0.02, "{cylinder}");
}

#[test]
fn an_unknown_kind_names_the_nearest() {
    let error = build(&scene::Object { kind: "teapod".to_owned(), path: None }, Path::new(".")).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("did you mean \"teapot\""), "{error}");
    let far = build(&scene::Object { kind: "xylophones".to_owned(), path: None }, Path::new(".")).unwrap_err();
    assert!(!far.to_string().contains("did you mean"), "{far}");
}
