//! The `[background]` table: what is seen through a slab.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::schema::{number, scene_table};
use super::{FieldShape, Kind};

const COLOR: FieldShape = FieldShape::Color { max: 1e6 };
const COLORS: FieldShape = FieldShape::List { of: &COLOR, min: 2, max: 2 };
const DISTANCE: FieldShape = FieldShape::Number { min: 0.0, max: 1e6, soft_max: 2.0 };
const SIZE: FieldShape = number(1e-3, 1e6);

/// A background behind a slab, as a scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Background {
    Checkerboard(Checkerboard),
    Image(ImagePlane),
    Environment {},
}

scene_table! {
    /// An endless plane of squares that glow in two colours.
    Checkerboard {
        /// Distance of the plane behind the rearmost point of the object; its normal is +z.
        distance: f32 = 0.2, DISTANCE, "world units";
        /// Side of a square.
        size: f32 = 0.2, SIZE, "world units";
        /// Radiances of the two kinds of squares.
        #[serde(with = "colors")] colors: [Vec3; 2] = [Vec3::splat(0.9), Vec3::splat(0.05)], COLORS, "";
    }
}

scene_table! {
    /// An endless plane on which an image repeats.
    ImagePlane {
        /// Image file (.png, .jpg, .hdr or .exr); its colours are radiances.
        path: PathBuf = PathBuf::new(), FieldShape::Path, "";
        /// Distance of the plane behind the rearmost point of the object; its normal is +z.
        distance: f32 = 0.2, DISTANCE, "world units";
        /// Width of one copy of the image.
        size: f32 = 2.0, SIZE, "world units";
    }
}

impl Background {
    /// The catalogue of backgrounds.
    pub fn kinds() -> Vec<Kind> {
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind("checkerboard", "An endless plane of squares that glow in two colours.", Checkerboard::fields()),
            kind("image", "An endless plane on which an image repeats.", ImagePlane::fields()),
            kind("environment", "The environment of `[light]` alone.", Vec::new()),
        ]
    }

    /// The name in the scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Checkerboard(_) => "checkerboard",
            Self::Image(_) => "image",
            Self::Environment {} => "environment",
        }
    }

    /// A background with default parameters.
    pub fn with_defaults(kind: &str) -> Option<Self> {
        Some(match kind {
            "checkerboard" => Self::Checkerboard(Checkerboard::default()),
            "image" => Self::Image(ImagePlane::default()),
            "environment" => Self::Environment {},
            _ => return None,
        })
    }

    /// The distance of the plane; `None` without a plane.
    pub fn distance_mut(&mut self) -> Option<&mut f32> {
        match self {
            Self::Checkerboard(board) => Some(&mut board.distance),
            Self::Image(image) => Some(&mut image.distance),
            Self::Environment {} => None,
        }
    }

    /// The file that the background names.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Image(image) => Some(&image.path),
            _ => None,
        }
    }
}

impl super::schema::DefaultNumber for [Vec3; 2] {}

/// Two colours, each a triple or one number.
mod colors {
    use glam::Vec3;
    use serde::ser::SerializeSeq;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize, Serialize)]
    struct Color(#[serde(with = "crate::scene::color")] Vec3);

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[Vec3; 2], D::Error> {
        let [Color(a), Color(b)] = <[Color; 2]>::deserialize(deserializer)?;
        Ok([a, b])
    }

    pub fn serialize<S: Serializer>(colors: &[Vec3; 2], serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(2))?;
        colors.iter().try_for_each(|color| list.serialize_element(&Color(*color)))?;
        list.end()
    }
}
