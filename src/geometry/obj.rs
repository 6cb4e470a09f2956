//! OBJ files, read for meshes of tiles and of large-scale objects.
//!
//! Our own reader, not tobj: tobj forgets `usemtl` where there is no `.mtl`, makes up normals for corners that have none
//! in a file that has some, and its errors name no line.

use std::collections::HashMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use crate::base::{InputError, Result};

/// Vertices, corners, triangles of one file at most.
const MAX: usize = 1 << 26;

/// An OBJ file with polygons cut into triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjMesh {
    pub positions: Vec<Vec3>,
    pub texcoords: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub triangles: Vec<[ObjCorner; 3]>,
    /// Index into `materials`, per triangle.
    pub triangle_material: Vec<u16>,
    /// `usemtl` names in order of appearance; `default` for faces before the first.
    pub materials: Vec<String>,
}

/// Indices of one corner; each is in range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ObjCorner {
    pub position: u32,
    pub texcoord: Option<u32>,
    pub normal: Option<u32>,
}

/// Reads the text of an OBJ file; `file` is for messages.
///
/// # Errors
/// No faces, indices out of range, numbers missing, NaN or infinite; names file and line.
pub fn parse(text: &[u8], file: &Path) -> Result<ObjMesh> {
    let mut mesh = ObjMesh::default();
    let mut material_index: HashMap<String, u16> = HashMap::new();
    let mut material = None;
    let mut logical = String::new();
    let mut start = 1;
    let text = String::from_utf8_lossy(text);
    for (number, line) in text.lines().enumerate() {
        if logical.is_empty() {
            start = number + 1;
        }
        let line = line.split('#').next().unwrap_or_default();
        // A backslash at the end continues the line.
        if let Some(head) = line.trim_end().strip_suffix('\\') {
            logical.push_str(head);
            logical.push(' ');
            continue;
        }
        logical.push_str(line);
        let result = parse_line(&logical, &mut mesh, &mut material, &mut material_index);
        result.map_err(|(found, expected)| InputError::new(format!("line {start}"), found, expected).in_file(file))?;
        logical.clear();
    }
    if mesh.triangles.is_empty() {
        return Err(InputError::new("", "no faces", "an OBJ file with faces (`f`)").in_file(file).into());
    }
    Ok(mesh)
}

/// What was found and what was expected.
type Complaint = (String, String);

fn parse_line(
    line: &str,
    mesh: &mut ObjMesh,
    material: &mut Option<u16>,
    material_index: &mut HashMap<String, u16>,
) -> std::result::Result<(), Complaint> {
    let mut words = line.split_whitespace();
    let Some(keyword) = words.next() else {
        return Ok(());
    };
    match keyword {
        "v" => mesh.positions.push(Vec3::from_array(numbers("v", words)?)),
        "vn" => mesh.normals.push(Vec3::from_array(numbers("vn", words)?)),
        "vt" => mesh.texcoords.push(Vec2::from_array(numbers("vt", words)?)),
        "usemtl" => {
            let name = line.trim_start().trim_start_matches("usemtl").trim();
            *material = (!name.is_empty()).then(|| slot(name, mesh, material_index)).transpose()?;
        }
        "f" => {
            let slot = match material {
                Some(slot) => *slot,
                None => *material.insert(slot("default", mesh, material_index)?),
            };
            face(words, mesh, slot)?;
        }
        // Groups, smoothing, lines, points and curves say nothing about the surface.
        _ => {}
    }
    if mesh.positions.len() > MAX || mesh.triangles.len() > MAX {
        return Err((format!("more than {MAX} vertices or triangles"), format!("at most {MAX}")));
    }
    Ok(())
}

fn slot(name: &str, mesh: &mut ObjMesh, index: &mut HashMap<String, u16>) -> std::result::Result<u16, Complaint> {
    if let Some(slot) = index.get(name) {
        return Ok(*slot);
    }
    let slot = u16::try_from(mesh.materials.len())
        .map_err(|_| ("more than 65536 materials".to_owned(), "at most 65536".to_owned()))?;
    index.insert(name.to_owned(), slot);
    mesh.materials.push(name.to_owned());
    Ok(slot)
}

fn numbers<'a, const N: usize>(
    keyword: &str,
    mut words: impl Iterator<Item = &'a str>,
) -> std::result::Result<[f32; N], Complaint> {
    let mut values = [0.0; N];
    for (k, value) in values.iter_mut().enumerate() {
        let expected = || format!("{N} finite numbers after `{keyword}`");
        let Some(word) = words.next() else {
            // A second texture coordinate may be left out.
            if keyword == "vt" && k > 0 {
                break;
            }
            return Err((format!("{k} numbers"), expected()));
        };
        *value = word
            .parse()
            .ok()
            .filter(|value: &f32| value.is_finite())
            .ok_or_else(|| (format!("`{word}`"), expected()))?;
    }
    Ok(values)
}

fn face<'a>(words: impl Iterator<Item = &'a str>, mesh: &mut ObjMesh, slot: u16) -> std::result::Result<(), Complaint> {
    let corners = words.map(|word| corner(word, mesh)).collect::<std::result::Result<Vec<_>, _>>()?;
    if corners.len() < 3 {
        return Err((format!("a face with {} corners", corners.len()), "three or more".to_owned()));
    }
    let outline: Vec<Vec3> = corners.iter().map(|corner| mesh.positions[corner.position as usize]).collect();
    for triangle in triangulate(&outline) {
        mesh.triangles.push(triangle.map(|k| corners[k]));
        mesh.triangle_material.push(slot);
    }
    Ok(())
}

fn corner(word: &str, mesh: &ObjMesh) -> std::result::Result<ObjCorner, Complaint> {
    let mut parts = word.split('/');
    let mut index = |count: usize, what: &str| -> std::result::Result<Option<u32>, Complaint> {
        let Some(part) = parts.next().filter(|part| !part.is_empty()) else {
            return Ok(None);
        };
        let complain = || (format!("`{part}` in `{word}`"), format!("a {what} from 1 to {count} (or -1 to -{count})"));
        let number: i64 = part.parse().map_err(|_| complain())?;
        // Positive counts from the first, negative back from the newest.
        let index =
            if number > 0 { number - 1 } else { number.checked_add(count as i64).filter(|_| number < 0).unwrap_or(-1) };
        usize::try_from(index).ok().filter(|index| *index < count).map(|index| Some(index as u32)).ok_or_else(complain)
    };
    let position = index(mesh.positions.len(), "vertex")?;
    let texcoord = index(mesh.texcoords.len(), "texture coordinate")?;
    let normal = index(mesh.normals.len(), "normal")?;
    let position = position.ok_or_else(|| (format!("`{word}`"), "v, v/vt, v//vn or v/vt/vn".to_owned()))?;
    Ok(ObjCorner { position, texcoord, normal })
}

/// Cuts ears off a polygon; a fan where no ear is left (folded or degenerate outlines).
fn triangulate(outline: &[Vec3]) -> Vec<[usize; 3]> {
    let count = outline.len();
    if count == 3 {
        return vec![[0, 1, 2]];
    }
    // Newell's normal: twice the area vector of any closed outline.
    let normal = (0..count).map(|k| outline[k].cross(outline[(k + 1) % count])).sum::<Vec3>();
    let turn = |a: usize, b: usize, c: usize| (outline[b] - outline[a]).cross(outline[c] - outline[a]).dot(normal);
    let mut left: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let size = left.len();
        let is_ear = |k: &usize| {
            let [a, b, c] = [left[(k + size - 1) % size], left[*k], left[(k + 1) % size]];
            let contains = |p: usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            turn(a, b, c) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && contains(p))
        };
        // From the second corner on, so that convex polygons become the fan about their first.
        let ear = (1..size).chain([0]).find(is_ear).unwrap_or(1);
        triangles.push([left[(ear + size - 1) % size], left[ear], left[(ear + 1) % size]]);
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ObjMesh> {
        parse(text.as_bytes(), Path::new("t.obj"))
    }

    const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn usemtl_names_count_without_an_mtl_and_faces_before_the_first_are_default() {
        let mesh = read(&format!(
            "{QUAD}f 1 2 3\nusemtl red paint\nf 1 3 4\nusemtl b\nf -4 -2 -1\nusemtl red paint\nf 1 2 3\n"
        ))
        .unwrap();
        assert_eq!(mesh.materials, ["default", "red paint", "b"]);
        assert_eq!(mesh.triangle_material, [0, 1, 2, 1]);
        assert_eq!(mesh.triangles[2].map(|corner| corner.position), [0, 2, 3]);
    }

    #[test]
    fn only_corners_with_normals_have_them() {
        let mesh = read(&format!("{QUAD}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n")).unwrap();
        assert!(mesh.triangles[0].iter().all(|corner| corner.normal == Some(0)));
        assert!(mesh.triangles[1].iter().all(|corner| corner.normal.is_none()));
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
            (format!("{QUAD}f 1 2\n"), "line 5", "three or more"),
            (format!("{QUAD}f 1 x 3\n"), "line 5", "`x`"),
            (QUAD.to_owned(), "t.obj", "no faces"),
            (String::new(), "t.obj", "no faces"),
        ] {
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains(part), "{text:?}: {error}");
        }
    }

    #[test]
    fn concave_polygons_keep_their_area_and_facing() {
        // An L of area 3.
        let mesh = read("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 4 5 6 1 2 3\n").unwrap();
        let area = |triangle: &[ObjCorner; 3]| {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner.position as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        assert_eq!(mesh.triangles.len(), 4);
        assert!(mesh.triangles.iter().all(|triangle| area(triangle) > 0.0));
        assert!((mesh.triangles.iter().map(area).sum::<f32>() - 3.0).abs() < 1e-6);
    }

    #[test]
    fn real_files_read_as_tobj_reads_them() {
        let folder = std::env::var("BISCALE_DATA")
            .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data").to_owned());
        for name in ["spot.obj", "teapot.obj", "stanford-bunny.obj"] {
            let path = Path::new(&folder).join(name);
            let Ok(text) = std::fs::read(&path) else {
                eprintln!("SKIPPED: {} is not there", path.display());
                continue;
            };
            let ours = parse(&text, &path).unwrap();
            let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
            let (models, _) = tobj::load_obj_buf(&mut text.as_slice(), &options, |_| Ok(Default::default())).unwrap();
            let theirs: Vec<[f32; 3]> = models
                .iter()
                .flat_map(|model| {
                    model
                        .mesh
                        .indices
                        .iter()
                        .map(|&i| std::array::from_fn(|k| model.mesh.positions[3 * i as usize + k]))
                })
                .collect();
            assert_eq!(ours.triangles.len() * 3, theirs.len(), "{name}");
            let area = |[a, b, c]: [Vec3; 3]| f64::from((b - a).cross(c - a).length());
            let ours: f64 =
                ours.triangles.iter().map(|t| area(t.map(|corner| ours.positions[corner.position as usize]))).sum();
            let theirs: f64 = theirs.chunks(3).map(|t| area([t[0].into(), t[1].into(), t[2].into()])).sum();
            assert!((ours / theirs - 1.0).abs() < 1e-3, "{name}: {ours} {theirs}");
        }
    }
}
