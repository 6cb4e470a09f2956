//! The folder of a capture: `rig.toml` and the photographs of all dots.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3, UVec2};
use serde::{Deserialize, Serialize};

use crate::base::{Error, InputError, Result, regular_file};
use crate::scene::{self, Field, FieldShape, number};

/// The name of the description in the folder.
pub const FILE: &str = "rig.toml";
/// Largest `rig.toml` [bytes]; positions of 100,000 dots fit.
const MAX_FILE: u64 = 8 << 20;
/// Largest number of dots.
const MAX_DOTS: usize = 100_000;

/// `rig.toml`: lengths in metres. The sheet lies in z = 0 with its middle at the origin, and the monitor at z = `distance`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// Index of the sheet over that of its surroundings.
    pub eta: f64,
    /// Extent of the photographed part of the sheet along x and y.
    pub sample_size: [f64; 2],
    /// From the sheet to the monitor.
    pub distance: f64,
    /// Intensity of a dot per channel, in the unit of the images.
    #[serde(default = "ones")]
    pub monitor: [f64; 3],
    /// Value of an image at which a channel is saturated; 1 for integers unless it is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub saturation: Option<f64>,
    /// Columns and rows of rectified images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixels: Option<[usize; 2]>,
    /// False if the images hold no light that was reflected inside, as images of a model may.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub bounces: bool,
    pub dots: Dots,
    #[serde(rename = "camera")]
    pub cameras: Vec<RigCamera>,
}

fn yes() -> bool {
    true
}

fn ones() -> [f64; 3] {
    [1.0; 3]
}

/// Places of the dots on the monitor, by a grid (x fastest) or one by one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Dots {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<[usize; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions: Option<Vec<[f64; 2]>>,
}

/// A camera and its images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigCamera {
    /// From the sheet to the camera; z is negative.
    pub direction: [f64; 3],
    /// Names of the images. `%04d` stands for the number of the dot, from 0, and a second one for the exposure.
    pub images: String,
    /// Exposure times; the values of an image are divided by them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exposures: Vec<f64>,
    /// Image without any dot, of the first exposure; it is subtracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dark: Option<PathBuf>,
    /// Corners of the sample in the images [pixels], in the order (-x, -y), (+x, -y), (+x, +y), (-x, +y).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corners: Option<[[f64; 2]; 4]>,
}

const LENGTH: FieldShape = FieldShape::Number { min: 1e-9, max: 1e6, soft_max: 1.0 };
const PLACE: FieldShape = FieldShape::Vector { length: 2, min: -1e6, max: 1e6 };
const CORNER: FieldShape = FieldShape::Vector { length: 2, min: -1e6, max: 1e6 };
const COUNT: FieldShape = FieldShape::Integer { min: 1, max: 65_536 };
const TIME: FieldShape = number(1e-9, 1e9);

fn optional(key: &'static str, shape: FieldShape, doc: &'static str) -> Field {
    Field::new(key, "", shape, None, doc)
}

fn dot_fields() -> Vec<Field> {
    vec![
        optional("count", FieldShape::List { of: &COUNT, min: 2, max: 2 }, "dots along x and y"),
        optional("from", PLACE, "the first dot (x, y)"),
        optional("to", PLACE, "the last dot (x, y)"),
        optional("positions", FieldShape::List { of: &PLACE, min: 1, max: MAX_DOTS }, "the places (x, y) of all dots"),
    ]
}

fn camera_fields() -> Vec<Field> {
    vec![
        Field::required(
            "direction",
            FieldShape::Vector { length: 3, min: -1e6, max: 1e6 },
            "the direction from the sheet to the camera",
        ),
        Field::required("images", FieldShape::Text, "the names of the images, such as \"dot_%04d.exr\""),
        optional("exposures", FieldShape::List { of: &TIME, min: 1, max: 16 }, "exposure times"),
        optional("dark", FieldShape::Path, "an image without any dot"),
        optional(
            "corners",
            FieldShape::List { of: &CORNER, min: 4, max: 4 },
            "four corners of the sample in the images",
        ),
    ]
}

fn fields() -> Vec<Field> {
    const CAMERA: FieldShape = FieldShape::Table(camera_fields);
    vec![
        Field::required("eta", number(1.0 + 1e-6, 4.0), "the index of the sheet over that of its surroundings"),
        Field::required(
            "sample_size",
            FieldShape::Vector { length: 2, min: 1e-9, max: 1e6 },
            "the extent of the sample along x and y, in metres",
        ),
        Field::required("distance", LENGTH, "the distance from the sheet to the monitor, in metres"),
        optional("monitor", FieldShape::Vector { length: 3, min: 1e-12, max: 1e12 }, "intensity of a dot per channel"),
        optional("saturation", number(1e-9, 1e12), "value of an image at which a channel is saturated"),
        optional("pixels", FieldShape::List { of: &COUNT, min: 2, max: 2 }, "size of rectified images"),
        optional("bounces", FieldShape::Bool, "false if the images hold no light that was reflected inside"),
        Field::required("dots", FieldShape::Table(dot_fields), "the places of the dots on the monitor"),
        Field::required("camera", FieldShape::List { of: &CAMERA, min: 1, max: 8 }, "the cameras, as [[camera]]"),
    ]
}

impl Rig {
    /// Reads `rig.toml` of a folder.
    ///
    /// # Errors
    /// The file is missing, or a key is unknown, missing or has a wrong value.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let unreadable = |error: std::io::Error| {
            Error::from(InputError::new("", error, "a file that describes the rig").in_file(&path))
        };
        let length = std::fs::metadata(&path).map_err(unreadable)?.len();
        if length > MAX_FILE {
            let error = InputError::new("file size", format!("{length} bytes"), format!("at most {MAX_FILE} bytes"));
            return Err(error.in_file(&path).into());
        }
        let bytes = regular_file::read(&path).map_err(unreadable)?;
        let text = String::from_utf8(bytes)
            .map_err(|error| Error::from(InputError::new("", error, "a file in UTF-8").in_file(&path)))?;
        Self::parse(&text).map_err(|error| error.in_file(&path))
    }

    /// Reads the text of a `rig.toml`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str) -> Result<Self> {
        let rig: Self = scene::parse_table(text, &fields())?;
        let invalid = |place: &str, found: String, expected: &str| Err(InputError::new(place, found, expected).into());
        let Dots { count, from, to, positions } = &rig.dots;
        match (count, from, to, positions) {
            (None, None, None, Some(_)) => {}
            (Some([x, y]), Some(_), Some(_), None) if x * y <= MAX_DOTS => {}
            (Some([x, y]), Some(_), Some(_), None) => {
                return invalid("dots.count", format!("{x} x {y} dots"), "at most 100000 dots");
            }
            _ => return invalid("dots", "other keys".to_owned(), "`count`, `from` and `to`, or `positions` alone"),
        }
        for (k, camera) in rig.cameras.iter().enumerate() {
            let place = |key: &str| format!("camera.{k}.{key}");
            let direction = DVec3::from_array(camera.direction);
            if direction.try_normalize().is_none_or(|unit| unit.z > -1e-3) {
                let expected = "a direction below the sheet (z below 0): the light is on the +z side";
                return invalid(&place("direction"), format!("{direction}"), expected);
            }
            let wanted = if camera.exposures.len() > 1 { 2 } else { 1 };
            if numbers_in(&camera.images) != Some(wanted) {
                let expected = match wanted {
                    1 => "one number such as %04d, which stands for the dot",
                    _ => "two numbers such as %04d_%d: the dot and the exposure",
                };
                return invalid(&place("images"), format!("`{}`", camera.images), expected);
            }
        }
        Ok(rig)
    }

    /// The text of `rig.toml`.
    ///
    /// # Errors
    /// Never for values that [`Self::parse`] accepts.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(Error::failed)
    }

    /// Places of all dots on the monitor.
    pub fn dots(&self) -> Vec<DVec2> {
        if let Some(positions) = &self.dots.positions {
            return positions.iter().map(|place| DVec2::from_array(*place)).collect();
        }
        let ([columns, rows], from, to) =
            (self.dots.count.unwrap_or([1, 1]), self.dots.from.unwrap_or_default(), self.dots.to.unwrap_or_default());
        let part = |k: usize, count: usize| if count > 1 { k as f64 / (count - 1) as f64 } else { 0.5 };
        let (from, to) = (DVec2::from_array(from), DVec2::from_array(to));
        (0..columns * rows)
            .map(|k| from + (to - from) * DVec2::new(part(k % columns, columns), part(k / columns, rows)))
            .collect()
    }

    /// The place of a pixel's middle on the sheet.
    pub fn place(&self, pixel: usize, size: UVec2) -> DVec2 {
        let at = DVec2::new((pixel % size.x as usize) as f64, (pixel / size.x as usize) as f64) + 0.5;
        (at / size.as_dvec2() - 0.5) * DVec2::from_array(self.sample_size)
    }
}

impl RigCamera {
    /// The unit direction from the sheet to the camera.
    pub fn unit_direction(&self) -> DVec3 {
        DVec3::from_array(self.direction).try_normalize().unwrap_or(DVec3::NEG_Z)
    }

    /// Exposure times; 1 without any.
    pub fn times(&self) -> Vec<f64> {
        if self.exposures.is_empty() { vec![1.0] } else { self.exposures.clone() }
    }

    /// Name of the image of a dot and an exposure.
    pub fn image(&self, dot: usize, exposure: usize) -> PathBuf {
        let mut numbers = [dot, exposure].into_iter();
        let mut name = String::new();
        let mut rest = self.images.as_str();
        while let Some((before, width, after)) = next_number(rest) {
            name.push_str(before);
            name.push_str(&format!("{:0width$}", numbers.next().unwrap_or(0)));
            rest = after;
        }
        name.push_str(rest);
        PathBuf::from(name)
    }
}

/// The first `%d` or `%04d` of a text: the text before it, its width and the text after it.
fn next_number(text: &str) -> Option<(&str, usize, &str)> {
    let at = text.find('%')?;
    let after = &text[at + 1..];
    let end = after.find(|c: char| !c.is_ascii_digit())?;
    let width = if end == 0 { 0 } else { after[..end].parse().ok().filter(|width| *width <= 12)? };
    after[end..].strip_prefix('d').map(|rest| (&text[..at], width, rest))
}

/// The number of `%d` in a text; `None` if it holds another `%`.
fn numbers_in(text: &str) -> Option<usize> {
    let mut count = 0;
    let mut rest = text;
    while rest.contains('%') {
        rest = next_number(rest)?.2;
        count += 1;
    }
    Some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "eta = 1.5\nsample_size = [0.08, 0.06]\ndistance = 0.04\ndots = { count = [3, 2], from = [-0.1, -0.05], \
                        to = [0.1, 0.05] }\n[[camera]]\ndirection = [1, 0, -1]\nimages = \"c/dot_%04d.exr\"\n";

    #[test]
    fn a_rig_comes_back_from_its_text_and_its_dots_run_along_x_first() {
        let rig = Rig::parse(TEXT).unwrap();
        assert!(rig.bounces);
        let of_a_model = Rig { bounces: false, ..rig.clone() };
        for rig in [&rig, &of_a_model] {
            assert_eq!(Rig::parse(&rig.to_toml().unwrap()).unwrap(), *rig);
        }
        let dots = rig.dots();
        assert_eq!((dots.len(), dots[0], dots[5]), (6, DVec2::new(-0.1, -0.05), DVec2::new(0.1, 0.05)));
        assert!((dots[1] - DVec2::new(0.0, -0.05)).length() < 1e-15);
        assert_eq!(rig.cameras[0].image(7, 0), PathBuf::from("c/dot_0007.exr"));
        assert!((rig.place(0, UVec2::new(2, 3)) - DVec2::new(-0.02, -0.02)).length() < 1e-15);
    }

    #[test]
    fn the_names_of_exposures_hold_two_numbers() {
        let text = TEXT.replace("_%04d", "_%d_%02d") + "exposures = [0.1, 1.0]\n";
        let rig = Rig::parse(&text).unwrap();
        assert_eq!(rig.cameras[0].image(12, 1), PathBuf::from("c/dot_12_01.exr"));
    }

    #[test]
    fn a_wrong_rig_is_refused_with_its_key_and_what_is_expected() {
        let cases = [
            (TEXT.replace("eta = 1.5\n", ""), "eta"),
            (TEXT.replace("1.5", "0.9"), "eta"),
            (TEXT.replace("direction = [1, 0, -1]", "direction = [1, 0, 1]"), "below the sheet"),
            (TEXT.replace("direction = [1, 0, -1]", "direction = [0, 0, 0]"), "below the sheet"),
            (TEXT.replace("%04d", "4"), "one number such as"),
            (TEXT.replace("%04d", "%s"), "one number such as"),
            (TEXT.replace("count = [3, 2], ", ""), "`count`, `from` and `to`"),
            (TEXT.replace("count = [3, 2]", "count = [60000, 60000]"), "at most 100000"),
            (TEXT.replace("distance", "distanse"), "did you mean `distance`"),
            (TEXT.replace("[[camera]]", "[[cameras]]"), "camera"),
            ("eta = ".to_owned(), "line 1"),
            (String::new(), "eta"),
        ];
        for (text, part) in cases {
            let error = Rig::parse(&text).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
