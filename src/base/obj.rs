//! Reader of OBJ files, for the meshes of tiles and of objects. The crate `tobj` reads the numbers and the indices.
//!
//! A pre-pass checks each statement and passes only `v`, `vt`, `vn` and `f` to `tobj`. It adds what `tobj` loses:
//! - Material names: `tobj` drops `usemtl` when no `.mtl` file defines the name.
//! - Missing normals and texture coordinates: `tobj` repeats those of the previous corner.
//! - The numbers of the vertices: `tobj` renumbers them by first use and drops the unused ones.
//! - The line of an error: `tobj` reports none. It also does not check relative indices.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Read as _;
use std::ops::Range;

use glam::{Vec2, Vec3};

use super::{Error, InputError, Result};

/// The content of an OBJ file. All indices are in range.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjFile {
    /// Vertices in the file's order, including those that no face uses.
    pub positions: Vec<Vec3>,
    /// Texture coordinates that the corners use.
    pub texcoords: Vec<Vec2>,
    /// Normals that the corners use.
    pub normals: Vec<Vec3>,
    /// Corners of all faces in the file's order.
    pub corners: Vec<ObjCorner>,
    pub faces: Vec<ObjFace>,
    /// Names after `usemtl` in order of appearance; `default` for faces without one.
    pub materials: Vec<String>,
}

/// Indices of one corner of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ObjCorner {
    pub position: u32,
    pub texcoord: Option<u32>,
    pub normal: Option<u32>,
}

/// A polygon of three or more corners.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjFace {
    /// Range in [`ObjFile::corners`].
    pub corners: Range<usize>,
    /// Index into [`ObjFile::materials`].
    pub material: u32,
    /// Number of `o` and `g` statements above the face.
    pub group: u32,
}

/// Rules for the statements of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grammar {
    /// `#` starts a comment and `\` continues a line anywhere. Surplus words have no effect. A face uses only vertices
    /// above it.
    Tolerant,
    /// The rules of `tobj`. Surplus words are errors, a fourth coordinate divides the other three, and a polyline (`l`)
    /// of three or more points is a face. A face may use vertices below it, up to the next `o` or `g`.
    Strict,
}

/// Limits and grammar of a file.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    pub grammar: Grammar,
    /// Maximum number of vertices, and of triangles after all polygons are triangulated.
    pub max_elements: usize,
    pub max_materials: usize,
}

/// Reads the text of an OBJ file.
///
/// # Errors
/// Returns an error with the line if a statement is malformed, a number is not finite, an index is out of range or a
/// limit is exceeded. Returns an error without a line if the file has no faces.
pub fn read(text: &str, rules: Rules) -> Result<ObjFile> {
    let scan = PrePass::of(text, rules)?;
    let numbering = numbering_faces(scan.counts[0]);
    let mut reader = numbering.as_bytes().chain(scan.statements.as_bytes());
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, |_| Ok((Vec::new(), HashMap::new())))
        .map_err(|error| InputError::new("", error, "an OBJ file that tobj can read"))?;
    // The statements contain no group and no material, so tobj returns one model.
    let mesh = models.into_iter().next().map(|model| model.mesh).unwrap_or_default();
    let skipped = scan.counts[0];
    let corners = scan.attributes.iter().enumerate().map(|(k, [has_texcoord, has_normal])| ObjCorner {
        position: mesh.indices[skipped + k],
        texcoord: has_texcoord.then(|| mesh.texcoord_indices[skipped + k]),
        normal: has_normal.then(|| mesh.normal_indices[skipped + k]),
    });
    Ok(ObjFile {
        positions: mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect(),
        texcoords: mesh.texcoords.chunks_exact(2).map(Vec2::from_slice).collect(),
        normals: mesh.normals.chunks_exact(3).map(Vec3::from_slice).collect(),
        corners: corners.collect(),
        faces: scan.faces,
        materials: scan.materials,
    })
}

/// Returns faces that use each vertex in the file's order. If `tobj` reads them first, it numbers the vertices as the
/// file does.
fn numbering_faces(count: usize) -> String {
    let mut text = String::new();
    for k in 1..=count {
        let start = if k % 64 == 1 { "\nf" } else { "" };
        let _ = write!(text, "{start} {k}");
    }
    text.push('\n');
    text
}

/// Statements that `tobj` numbers separately, in the order of the parts of a corner.
const KEYWORDS: [&str; 3] = ["v", "vt", "vn"];

/// The result of the pre-pass.
struct PrePass {
    rules: Rules,
    /// Counts of vertices, texture coordinates and normals.
    counts: [usize; 3],
    /// Vertices with a colour.
    colored: usize,
    /// Largest index of the current group for each keyword, and its line.
    largest: [(usize, usize); 3],
    triangles: usize,
    has_faces: bool,
    group: u32,
    material: Option<u32>,
    material_index: HashMap<String, u32>,
    materials: Vec<String>,
    faces: Vec<ObjFace>,
    /// For each corner: it has a texture coordinate, it has a normal.
    attributes: Vec<[bool; 2]>,
    /// Checked statements for `tobj`.
    statements: String,
}

impl PrePass {
    fn of(text: &str, rules: Rules) -> Result<Self> {
        let mut scan = Self {
            rules,
            counts: [0; 3],
            colored: 0,
            largest: [(0, 0); 3],
            triangles: 0,
            has_faces: false,
            group: 0,
            material: None,
            material_index: HashMap::new(),
            materials: Vec::new(),
            faces: Vec::new(),
            attributes: Vec::new(),
            statements: String::with_capacity(text.len()),
        };
        let mut logical = String::new();
        let mut start = 1;
        for (k, line) in text.lines().enumerate() {
            if rules.grammar == Grammar::Strict {
                scan.statement(line, k + 1)?;
                continue;
            }
            if logical.is_empty() {
                start = k + 1;
            }
            let line = line.split('#').next().unwrap_or_default();
            if let Some(head) = line.trim_end().strip_suffix('\\') {
                logical.push_str(head);
                logical.push(' ');
                continue;
            }
            logical.push_str(line);
            scan.statement(&logical, start)?;
            logical.clear();
        }
        if !scan.has_faces {
            return Err(InputError::new("", "no faces", "an OBJ file with faces (`f`)").into());
        }
        scan.check_forward_indices(true)?;
        Ok(scan)
    }

    fn statement(&mut self, text: &str, line: usize) -> Result<()> {
        let is_strict = self.rules.grammar == Grammar::Strict;
        let mut words = text.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        match keyword {
            "v" => self.numbers(0, words, line)?,
            "vt" => self.numbers(1, words, line)?,
            "vn" => self.numbers(2, words, line)?,
            "f" => {
                self.has_faces = true;
                self.face(words, line)?;
            }
            "l" if is_strict && words.clone().count() >= 3 => self.face(words, line)?,
            "l" if is_strict && (words.clone().count() == 0 || !words.all(is_polyline_point)) => {
                return Err(at(line, format!("`{}`", text.trim()), "points as v or v/vt"));
            }
            "o" | "g" => {
                self.check_forward_indices(false)?;
                self.group += 1;
            }
            "usemtl" => {
                // tobj finds the name after the first space, and refuses a statement without one.
                if is_strict && text.split_once(' ').is_none_or(|(_, name)| name.trim().is_empty()) {
                    return Err(at(line, "usemtl without a name", "a name after `usemtl` and a space"));
                }
                let name = text.trim_start().trim_start_matches("usemtl").trim();
                self.material = (!name.is_empty()).then(|| self.material_slot(name, line)).transpose()?;
            }
            // Smoothing groups, points and curves do not change the surface.
            _ => {}
        }
        let max = self.rules.max_elements;
        if self.counts[0] > max || self.triangles > max {
            return Err(at(line, format!("more than {max} vertices or triangles"), format!("at most {max}")));
        }
        Ok(())
    }

    fn material_slot(&mut self, name: &str, line: usize) -> Result<u32> {
        if let Some(slot) = self.material_index.get(name) {
            return Ok(*slot);
        }
        let max = self.rules.max_materials;
        if self.materials.len() >= max {
            return Err(at(line, format!("more than {max} materials"), format!("at most {max}")));
        }
        let slot = self.materials.len() as u32;
        self.material_index.insert(name.to_owned(), slot);
        self.materials.push(name.to_owned());
        Ok(slot)
    }

    fn numbers<'a>(&mut self, kind: usize, words: impl Iterator<Item = &'a str>, line: usize) -> Result<()> {
        let keyword = KEYWORDS[kind];
        let is_strict = self.rules.grammar == Grammar::Strict;
        let needed = if keyword == "vt" { 2 } else { 3 };
        let mut values: Vec<&str> = words.take(if is_strict { usize::MAX } else { needed }).collect();
        let expected = || format!("{needed} finite numbers after `{keyword}`");
        let is_finite = |value: &&str| value.parse().is_ok_and(f32::is_finite);
        if let Some(value) = values.iter().find(|value| !is_finite(value)) {
            return Err(at(line, format!("{value} in a {keyword} line"), expected()));
        }
        // A tolerant file may omit the second texture coordinate.
        if keyword == "vt" && !is_strict && values.len() == 1 {
            values.push("0");
        }
        if values.len() < needed {
            return Err(at(line, format!("{} numbers in a {keyword} line", values.len()), expected()));
        }
        let written = match (keyword, values.len()) {
            ("v", 4) if values[3].parse() == Ok(0.0_f32) => {
                return Err(at(line, "0 as the fourth number of a v line", "a divisor other than 0"));
            }
            ("v", 4) => 4,
            ("v", 6) => {
                self.colored += 1;
                3
            }
            ("v", count) if count > 4 => {
                let expected = "3 numbers, 4 with a divisor or 6 with a colour";
                return Err(at(line, format!("{count} numbers in a v line"), expected));
            }
            _ => needed,
        };
        self.statements.push_str(keyword);
        for value in &values[..written] {
            self.statements.push(' ');
            self.statements.push_str(value);
        }
        self.statements.push('\n');
        self.counts[kind] += 1;
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>, line: usize) -> Result<()> {
        let material = match self.material {
            Some(slot) => slot,
            None => self.material_slot("default", line)?,
        };
        self.material = Some(material);
        let first = self.attributes.len();
        self.statements.push('f');
        for word in words {
            let attributes = self.corner(word, line)?;
            self.attributes.push(attributes);
        }
        self.statements.push('\n');
        let corners = first..self.attributes.len();
        if corners.len() < 3 {
            return Err(at(line, format!("a face with {} corners", corners.len()), "at least 3"));
        }
        self.triangles += corners.len() - 2;
        self.faces.push(ObjFace { corners, material, group: self.group });
        Ok(())
    }

    /// Checks one corner. Returns true for a texture coordinate and true for a normal.
    fn corner(&mut self, word: &str, line: usize) -> Result<[bool; 2]> {
        let is_strict = self.rules.grammar == Grammar::Strict;
        let mut present = [false; 3];
        for (kind, part) in word.split('/').enumerate() {
            if kind == 3 && is_strict {
                return Err(at(line, format!("`{word}` in a face"), "at most v/vt/vn"));
            }
            if kind == 3 {
                break;
            }
            self.statements.push(if kind == 0 { ' ' } else { '/' });
            if part.is_empty() {
                continue;
            }
            let count = self.counts[kind];
            let index = match part.parse::<isize>() {
                Ok(index) if index > 0 => usize::try_from(index).ok(),
                Ok(index) => count.checked_add_signed(index).filter(|_| index < 0).map(|index| index + 1),
                Err(_) => None,
            };
            let Some(index) = index.filter(|index| is_strict || *index <= count) else {
                let what = ["vertex", "texture coordinate", "normal"][kind];
                let last = if is_strict { String::new() } else { format!(" to {count}") };
                let expected = match count {
                    0 => format!("a {what} that a line before the face defines"),
                    _ => format!("a {what} from 1{last} (or -1 to -{count})"),
                };
                return Err(at(line, format!("`{part}` in `{word}`"), expected));
            };
            self.statements.push_str(part);
            if index > self.largest[kind].0 {
                self.largest[kind] = (index, line);
            }
            present[kind] = true;
        }
        if !present[0] {
            return Err(at(line, format!("`{word}`"), "v, v/vt, v//vn or v/vt/vn"));
        }
        Ok([present[1], present[2]])
    }

    /// Checks the indices of the group that ends, because its faces may use vertices below them.
    fn check_forward_indices(&mut self, is_last: bool) -> Result<()> {
        for (kind, keyword) in KEYWORDS.into_iter().enumerate() {
            let count = self.counts[kind];
            // A file may list all its texture coordinates or normals after its groups.
            if count == 0 && kind > 0 && !is_last {
                continue;
            }
            let (index, line) = std::mem::take(&mut self.largest[kind]);
            if index > count {
                return Err(at(line, format!("{keyword} index {index}"), format!("1 to {count}")));
            }
            if kind == 0 && self.colored > 0 && index > self.colored {
                let found = format!("{} of {count} vertices with a colour", self.colored);
                return Err(at(line, found, "a colour for each vertex or for none"));
            }
        }
        Ok(())
    }
}

/// Returns true for a point of a polyline that `tobj` reads. The polylines of one or two points are dropped.
fn is_polyline_point(word: &str) -> bool {
    word.split('/').enumerate().all(|(kind, part)| part.is_empty() || kind < 3 && part.parse::<isize>().is_ok())
}

fn at(line: usize, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Error {
    InputError::new(format!("line {line}"), found, expected).into()
}

#[cfg(test)]
#[path = "obj_tests.rs"]
mod tests;
