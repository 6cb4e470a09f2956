use super::*;

const TOLERANT: Rules = Rules { grammar: Grammar::Tolerant, max_elements: 8, max_materials: 3 };
const STRICT: Rules = Rules { grammar: Grammar::Strict, ..TOLERANT };

fn tolerant(text: &str) -> Result<ObjFile> {
    read(text, TOLERANT)
}

fn strict(text: &str) -> Result<ObjFile> {
    read(text, STRICT)
}

fn position_indices(file: &ObjFile) -> Vec<u32> {
    file.corners.iter().map(|corner| corner.position).collect()
}

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn usemtl_names_count_without_an_mtl_and_faces_before_the_first_are_default() {
    let file = tolerant(&format!(
        "{QUAD}f 1 2 3\nusemtl red paint\nf 1 3 4\nusemtl b\nf -4 -2 -1\nusemtl red paint\nf 1 2 3\n"
    ))
    .unwrap();
    assert_eq!(file.materials, ["default", "red paint", "b"]);
    assert_eq!(file.faces.iter().map(|face| face.material).collect::<Vec<_>>(), [0, 1, 2, 1]);
    assert_eq!(position_indices(&file)[6..9], [0, 2, 3]);
}

#[test]
fn only_corners_with_normals_have_them() {
    let file = tolerant(&format!("{QUAD}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n")).unwrap();
    assert!(file.corners[..3].iter().all(|corner| corner.normal == Some(0)));
    assert_eq!(file.normals, [Vec3::Z]);
    assert!(file.corners[3..].iter().all(|corner| corner.normal.is_none()));
}

#[test]
fn bad_files_are_refused_with_their_line() {
    for (text, place, part) in [
        (format!("{QUAD}f 1 2 5\n"), "line 5", "from 1 to 4"),
        (format!("{QUAD}f 1 2 0\n"), "line 5", "from 1 to 4"),
        (format!("{QUAD}f 1 2 -5\n"), "line 5", "from 1 to 4"),
        (format!("{QUAD}f 1//1 2//1 3//1\n"), "line 5", "normal"),
        ("v 0 0 nan\n".to_owned(), "line 1", "finite"),
        ("v 0 0 inf\n".to_owned(), "line 1", "finite"),
        ("v 0 0 0\nv 0 1\n".to_owned(), "line 2", "found 2 numbers"),
        (format!("{QUAD}f 1 2\n"), "line 5", "a face with 2 corners, expected at least 3"),
        (format!("{QUAD}f 1 x 3\n"), "line 5", "`x`"),
        (QUAD.to_owned(), "", "no faces"),
        (String::new(), "", "no faces"),
    ] {
        let error = tolerant(&text).unwrap_err().in_file("t.obj").to_string();
        assert!(error.starts_with("t.obj: ") && error.contains(place) && error.contains(part), "{text:?}: {error}");
    }
}

#[test]
fn vertices_keep_the_numbers_of_the_file_also_if_no_face_uses_them() {
    let vertices: String = (0..8).map(|k| format!("v {k} 0 0\n")).collect();
    for rules in [TOLERANT, STRICT] {
        let file = read(&format!("{vertices}vn 0 0 1\nvn 0 1 0\nvt 0 1\nf 8//2 -5 3/1\n"), rules).unwrap();
        assert_eq!(
            file.positions.iter().map(|position| position.x as usize).collect::<Vec<_>>(),
            [0, 1, 2, 3, 4, 5, 6, 7]
        );
        assert_eq!(position_indices(&file), [7, 3, 2]);
        let normals = file.corners.iter().map(|corner| corner.normal.map(|normal| file.normals[normal as usize]));
        assert_eq!(normals.collect::<Vec<_>>(), [Some(Vec3::Y), None, None]);
        let texcoords = file.corners.iter().map(|corner| corner.texcoord.map(|k| file.texcoords[k as usize]));
        assert_eq!(texcoords.collect::<Vec<_>>(), [None, None, Some(Vec2::Y)]);
    }
}

#[test]
fn the_numbering_continues_beyond_one_line_of_faces() {
    let rules = Rules { max_elements: 1000, ..TOLERANT };
    let vertices: String = (0..200).map(|k| format!("v {k} 0 0\n")).collect();
    let file = read(&format!("{vertices}f 200 100 1\nf 3 2 65 64\n"), rules).unwrap();
    assert_eq!(file.positions[199].x, 199.0);
    assert_eq!(position_indices(&file), [199, 99, 0, 2, 1, 64, 63]);
    assert_eq!(file.faces[1].corners, 3..7);
}

#[test]
fn the_grammars_differ_only_as_documented() {
    // (text, accepted by the tolerant grammar, accepted by the strict grammar)
    for (text, by_tolerant, by_strict) in [
        ("QUAD f 1 2 3 # comment", true, false),
        ("QUAD f 1 2 \\\n 3", true, false),
        ("QUAD f 1 2 3\r\n", true, true),
        ("QUAD f 1/ 2// 3", true, true),
        ("QUAD f 1/1 2 3", false, false),
        ("QUAD f 1/// 2 3", true, false),
        ("QUAD vt 1\nf 1 2 3", true, false),
        ("QUAD vn 0 0 1 nan\nf 1 2 3", true, false),
        ("QUAD usemtl\nf 1 2 3", true, false),
        ("QUAD v 0 0 0 2\nf 1 2 3", true, true),
        ("QUAD v 0 0 0 0\nf 1 2 3", true, false),
        ("QUAD v 0 0 0 1 1\nf 1 2 3", true, false),
        ("v 0 0 0 1 1 1\nv 1 0 0 1 1 1\nv 1 1 0 1 1 1\nf 1 2 3", true, true),
        ("v 0 0 0 1 1 1\nQUAD f 1 2 3", true, false),
        ("f 1 2 3\nQUAD", false, true),
        ("f 1 2 3\ng a\nQUAD", false, false),
        ("QUAD l 1 2 9\nf 1 2 3", true, false),
        ("QUAD l 1 2 3", false, false),
        ("QUAD l 1 x\nf 1 2 3", true, false),
        ("QUAD l 1 9/\nf 1 2 3", true, true),
        ("QUAD o a\ng b\ns off\nmtllib a.mtl\np 9\nusemtl a\nf 1 2 3", true, true),
    ] {
        let text = text.replace("QUAD ", QUAD).replace("QUAD", QUAD);
        assert_eq!((tolerant(&text).is_ok(), strict(&text).is_ok()), (by_tolerant, by_strict), "{text}");
    }
    let text = format!("{QUAD}v 2 4 6 2\nf 1 2 5\nl 1 2 3\n");
    assert_eq!(tolerant(&text).unwrap().positions[4], Vec3::new(2.0, 4.0, 6.0));
    assert_eq!(strict(&text).unwrap().positions[4], Vec3::new(1.0, 2.0, 3.0));
    assert_eq!((tolerant(&text).unwrap().faces.len(), strict(&text).unwrap().faces.len()), (1, 2));
}

#[test]
fn limits_are_errors_with_a_line() {
    for (text, place, part) in [
        ("v 0 0 0\n".repeat(9), "line 9", "at most 8"),
        (format!("{QUAD}{}", "f 1 2 3 4\n".repeat(5)), "line 9", "at most 8"),
        ("usemtl a\nusemtl b\nusemtl a\nusemtl c\nusemtl d\n".to_owned(), "line 5", "more than 3 materials"),
    ] {
        let error = tolerant(&text).unwrap_err().to_string();
        assert!(error.contains(place) && error.contains(part), "{text:?}: {error}");
    }
}
