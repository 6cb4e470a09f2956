//! The `[tile]` table: its extent and the geometry families with their parameters.

use std::path::PathBuf;

use glam::Vec2;
use serde::{Deserialize, Serialize};

use crate::base::{InputError, Result};

use super::schema::{length, number, scene_choice, scene_table};
use super::{Field, FieldShape, Kind};

/// One period of the small-scale surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// Extent of the period in x and y, tile units.
    #[serde(default = "unit_square")]
    pub size: Vec2,
    /// Name of the tile unit; only exports of true size (.stl, .svg, .pdf) and sizes in Radiance files (.xml) depend on it.
    #[serde(default = "millimetre")]
    pub unit: String,
    /// Image of linear colour weights over the tile, projected along z; they multiply the materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color_path: Option<PathBuf>,
    /// Image of slots over the tile, projected along z. The grey value k (of 255) selects the slot `paint_k`; 0 leaves
    /// the surface's own slot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slot_path: Option<PathBuf>,
    pub geometry: Geometry,
}

fn unit_square() -> Vec2 {
    Vec2::ONE
}

fn millimetre() -> String {
    "mm".to_owned()
}

/// The millimetres of a tile unit.
///
/// # Errors
/// A name of no known unit.
pub fn millimetres(unit: &str) -> Result<f64> {
    Ok(match unit.trim().to_lowercase().as_str() {
        "mm" | "millimetre" | "millimeter" => 1.0,
        "cm" | "centimetre" | "centimeter" => 10.0,
        "m" | "metre" | "meter" => 1000.0,
        "um" | "µm" | "μm" | "micron" | "micrometre" | "micrometer" => 1e-3,
        "nm" => 1e-6,
        "in" | "inch" => 25.4,
        _ => return Err(InputError::new("tile.unit", unit, "mm, cm, m, µm, nm or in, to know the size").into()),
    })
}

impl Tile {
    /// A tile of one by one millimetre without images.
    pub fn of(geometry: Geometry) -> Self {
        Self { size: unit_square(), unit: millimetre(), color_path: None, slot_path: None, geometry }
    }

    pub fn fields() -> Vec<Field> {
        vec![
            Field::new(
                "size",
                "tile units",
                FieldShape::Vector { length: 2, min: 1e-6, max: 1e6 },
                None,
                "Extent of the tile in x and y.",
            ),
            Field::new("unit", "", FieldShape::Text, None, "Name of the tile unit."),
            Field::new("color_path", "", FieldShape::Path, None, "Image of colour weights over the tile."),
            Field::new(
                "slot_path",
                "",
                FieldShape::Path,
                None,
                "Image of slots over the tile: grey value k (of 255) selects the slot `paint_k`, 0 the surface's own.",
            ),
            Field::required("geometry", FieldShape::Tagged(Geometry::kinds), "Geometry of the surface."),
        ]
    }
}

/// The geometry families.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Geometry {
    Grooves(Grooves),
    Pyramids(Pyramids),
    Rods(Rods),
    Weave(Weave),
    Heightfield(Heightfield),
    Flat(Flat),
    Mesh(MeshFile),
}

impl Geometry {
    /// The catalogue of families.
    pub fn kinds() -> Vec<Kind> {
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind("grooves", "Parallel grooves; slots `bottom` and `sides`.", Grooves::fields()),
            kind("pyramids", "Pyramids on a floor; slots `faces` and `floor`.", Pyramids::fields()),
            kind("rods", "Rods that stand on a floor; slots `rods` and `floor`.", Rods::fields()),
            kind(
                "weave",
                "Woven threads; slots `warp` (along y), `weft` (along x) and, with its own backing, `backing`.",
                Weave::fields(),
            ),
            kind("heightfield", "Heights from an image or a list; slot `default`.", Heightfield::fields()),
            kind("flat", "A plane; slot `default` if plain, otherwise `first` and `second`.", Flat::fields()),
            kind(
                "mesh",
                "A mesh from an OBJ file; its slots are the `usemtl` names, and `default` for faces before the first.",
                MeshFile::fields(),
            ),
        ]
    }

    /// The name in the scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Grooves(_) => "grooves",
            Self::Pyramids(_) => "pyramids",
            Self::Rods(_) => "rods",
            Self::Weave(_) => "weave",
            Self::Heightfield(_) => "heightfield",
            Self::Flat(_) => "flat",
            Self::Mesh(_) => "mesh",
        }
    }

    /// A family with its default parameters.
    pub fn with_defaults(kind: &str) -> Option<Self> {
        Some(match kind {
            "grooves" => Self::Grooves(Grooves::default()),
            "pyramids" => Self::Pyramids(Pyramids::default()),
            "rods" => Self::Rods(Rods::default()),
            "weave" => Self::Weave(Weave::default()),
            "heightfield" => Self::Heightfield(Heightfield::default()),
            "flat" => Self::Flat(Flat::default()),
            "mesh" => Self::Mesh(MeshFile::default()),
            _ => return None,
        })
    }
}

scene_choice! {
    /// Cross-section of a groove.
    GrooveProfile {
        /// Two sides that meet in a line.
        V = "v",
        /// Half an ellipse.
        U = "u",
        /// A flat bottom and vertical sides.
        Rectangular = "rectangular",
        /// A flat bottom and sloped sides.
        Trapezoid = "trapezoid",
    }
}

scene_table! {
    /// Parallel grooves (Wu et al. 2011, Fig. 4). Sides that would overlap meet at a ridge and become steeper. The flat
    /// area at z = 0 that remains between two openings belongs to `sides`.
    Grooves {
        /// Depth of the grooves.
        depth: f32 = 0.2, length(0.0, 1.0), "tile units";
        /// Angle between the sides and the base plane; rectangular and U profiles ignore it.
        side_angle_deg: f32 = 60.0, number(1.0, 90.0), "degrees";
        /// Width of the bottom (U: of the opening), as a fraction of the distance between grooves; V grooves ignore it.
        bottom_width: f32 = 0.4, number(0.0, 0.95), "of the pitch";
        /// Cross-section of the grooves.
        profile: GrooveProfile = GrooveProfile::Trapezoid, FieldShape::Choice(GrooveProfile::NAMES), "";
        /// Number of grooves across the tile.
        count: u32 = 4, FieldShape::Integer { min: 1, max: 64 }, "";
        /// Rotation about z of the grooves, which run along y; rounded to a direction in which the tile repeats.
        rotation_deg: f32 = 0.0, number(-180.0, 180.0), "degrees";
    }
}

scene_choice! {
    /// Arrangement of pyramids on the plane.
    Arrangement {
        /// Rows and columns.
        Square = "square",
        /// Every second row shifted by half a spacing, rows √3/2 of a spacing apart.
        Hex = "hex",
        /// Every second row shifted by half a spacing, like bricks.
        Staggered = "staggered",
    }
}

scene_table! {
    /// Pyramids on a floor (Wu et al. 2011, Fig. 5).
    Pyramids {
        /// Height of the full pyramid; truncation removes part of it.
        height: f32 = 0.15, length(0.0, 1.0), "tile units";
        /// Size of the base, as a fraction of the largest base that fits the cell.
        base_size: f32 = 1.0, number(0.05, 1.0), "of the cell";
        /// Fraction of the height that is cut off at the tip.
        truncation: f32 = 0.0, number(0.0, 0.95), "of the height";
        /// Ratio of the horizontal extents of the +x and -x faces; values other than 1 move the tip off the centre.
        face_ratio: f32 = 1.0, number(0.1, 10.0), "";
        /// Distance between neighbours, rounded so that a whole number of cells fits the tile.
        spacing: f32 = 0.25, length(1e-9, 1.0), "tile units";
        /// Number of sides of the base.
        sides: u32 = 4, FieldShape::Integer { min: 3, max: 8 }, "";
        /// Arrangement of the pyramids.
        arrangement: Arrangement = Arrangement::Square, FieldShape::Choice(Arrangement::NAMES), "";
        /// Rotation of each pyramid about its axis.
        rotation_deg: f32 = 0.0, number(-180.0, 180.0), "degrees";
    }
}

scene_table! {
    /// Tapered rods on a floor (the velvets of Wu et al. 2011, Fig. 6). Rods may extend over the tile's edge.
    Rods {
        /// Radius at the floor.
        radius: f32 = 0.02, length(1e-9, 0.2), "tile units";
        /// Length along the axis.
        length: f32 = 0.35, length(1e-9, 1.0), "tile units";
        /// Reduction of the radius at the tip: 0 is a cylinder, 1 a cone.
        taper: f32 = 0.3, number(0.0, 1.0), "";
        /// Angle between the common axis and +z.
        lean_deg: f32 = 0.0, number(0.0, 80.0), "degrees";
        /// Azimuth of the common axis, from +x towards +y.
        lean_azimuth_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
        /// Largest angle between a rod and the common axis.
        spread_deg: f32 = 10.0, number(0.0, 80.0), "degrees";
        /// Randomness of the positions: 0 is a lattice, 1 anywhere in each rod's cell.
        jitter: f32 = 0.8, number(0.0, 1.0), "";
        /// Randomness of the lengths, as a fraction of the length.
        length_variation: f32 = 0.1, number(0.0, 1.0), "";
        /// Number of rods on the tile.
        count: u32 = 100, FieldShape::Integer { min: 1, max: 4000 }, "";
        /// Number of rods per square tile unit; replaces the count.
        #[serde(skip_serializing_if = "Option::is_none")]
        density: Option<f32> = None, number(1e-3, 1e6), "per area";
        /// Seed of the random numbers.
        seed: u64 = 1, FieldShape::Integer { min: 0, max: i64::MAX }, "";
    }
}

scene_choice! {
    /// Cross-section of a thread.
    CrossSection {
        /// Round or oval yarn.
        Elliptic = "elliptic",
        /// A band with rounded edges.
        Flat = "flat",
        /// Two parabolas with sharp edges.
        Lens = "lens",
    }
}

scene_choice! {
    /// Common weave patterns.
    FloatPattern {
        /// Over one, under one.
        Plain = "plain",
        /// Over two, under two, shifted by one thread per row.
        Twill = "twill",
        /// Warp over four, under one, shifted by two threads per row: a warp-faced satin of five.
        Satin = "satin",
    }
}

/// Thread that is on top at each crossing: a named pattern, or a matrix with one row per weft thread and one column per
/// warp thread. The value 1 puts the warp on top.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WeavePattern {
    Named(FloatPattern),
    Matrix(Vec<Vec<u32>>),
}

impl super::schema::DefaultNumber for WeavePattern {}

scene_choice! {
    /// Sheet under the gaps of a weave.
    Backing {
        /// No sheet: the tile has holes.
        None = "none",
        /// A sheet in the slot `warp`.
        Warp = "warp",
        /// A sheet in the slot `weft`.
        Weft = "weft",
        /// A sheet in its own slot `backing`.
        Own = "backing",
    }
}

const WEAVE_BIT: FieldShape = FieldShape::Integer { min: 0, max: 1 };
const WEAVE_ROW: FieldShape = FieldShape::List { of: &WEAVE_BIT, min: 1, max: 24 };
const WEAVE_PATTERN: FieldShape =
    FieldShape::AnyOf(&[FieldShape::Choice(FloatPattern::NAMES), FieldShape::List { of: &WEAVE_ROW, min: 1, max: 24 }]);

scene_table! {
    /// Woven threads (Wu et al. 2011, Fig. 7): warp threads run along y, weft threads along x, and touch where they
    /// cross.
    Weave {
        /// Width of the warp threads, as a fraction of their spacing.
        warp_width: f32 = 0.9, number(0.05, 1.0), "of the spacing";
        /// Width of the weft threads, as a fraction of their spacing.
        weft_width: f32 = 0.9, number(0.05, 1.0), "of the spacing";
        /// Thickness of the warp threads.
        warp_height: f32 = 0.08, length(1e-9, 0.5), "tile units";
        /// Thickness of the weft threads.
        weft_height: f32 = 0.08, length(1e-9, 0.5), "tile units";
        /// Distribution of the bending between the threads: at 0 only the weft bends, at 1 only the warp.
        crimp: f32 = 0.5, number(0.0, 1.0), "";
        /// Number of warp threads on the tile, rounded to whole repeats of the pattern.
        warp_count: u32 = 4, FieldShape::Integer { min: 1, max: 24 }, "";
        /// Number of weft threads on the tile, rounded to whole repeats of the pattern.
        weft_count: u32 = 4, FieldShape::Integer { min: 1, max: 24 }, "";
        /// Cross-section of the threads.
        cross_section: CrossSection = CrossSection::Elliptic, FieldShape::Choice(CrossSection::NAMES), "";
        /// Thread on top: plain, twill, satin or a matrix of 0 and 1 (1: warp on top) with one row per weft thread.
        pattern: WeavePattern = WeavePattern::Named(FloatPattern::Plain), WEAVE_PATTERN, "";
        /// Slot of the sheet under the gaps: none (no sheet), warp, weft or backing.
        backing: Backing = Backing::Weft, FieldShape::Choice(Backing::NAMES), "";
    }
}

const HEIGHT: FieldShape = FieldShape::Number { min: -1e6, max: 1e6, soft_max: 1.0 };
const HEIGHT_ROW: FieldShape = FieldShape::List { of: &HEIGHT, min: 1, max: 4096 };

scene_table! {
    /// A height field (Wu et al. 2011, Fig. 8) from an image or from values in the scene file. Image values are linear,
    /// 0 to 1 for integer formats. Sample (column i, row j) lies at ((i+½)/w, (j+½)/h) of the tile, with row 0
    /// at y = 0.
    Heightfield {
        /// Height that the value 1 stands for.
        height_scale: f32 = 1.0, FieldShape::Number { min: -1e8, max: 1e8, soft_max: 1.0 }, "tile units";
        /// Image of heights: PNG of 8 or 16 bits, TIFF, HDR or EXR. Exactly one of `path` and `values` is required.
        #[serde(skip_serializing_if = "Option::is_none")]
        path: Option<PathBuf> = None, FieldShape::Path, "";
        /// Heights row by row, instead of an image.
        #[serde(skip_serializing_if = "Option::is_none")]
        values: Option<Vec<Vec<f32>>> = None, FieldShape::List { of: &HEIGHT_ROW, min: 1, max: 4096 }, "";
    }
}

scene_choice! {
    /// Division of a plane into the slots `first` and `second`.
    FlatPattern {
        /// One slot, `default`.
        Plain = "plain",
        /// Stripes along y.
        Stripes = "stripes",
        /// A checkerboard.
        Checks = "checks",
    }
}

scene_table! {
    /// A plane, plain or printed (cylinder #2 of Wu et al. 2011, Fig. 9).
    Flat {
        /// Fraction of a stripe or check period that has the slot `first`.
        ratio: f32 = 0.5, number(0.0, 1.0), "of the period";
        /// Division into slots; a plain plane has the slot `default`.
        pattern: FlatPattern = FlatPattern::Plain, FieldShape::Choice(FlatPattern::NAMES), "";
        /// Number of periods across the tile.
        count: u32 = 4, FieldShape::Integer { min: 1, max: 64 }, "";
    }
}

scene_table! {
    /// A triangle mesh from an OBJ file, in tile coordinates.
    MeshFile {
        /// Required. The OBJ file; its `usemtl` names select the materials.
        path: PathBuf = PathBuf::new(), FieldShape::Path, "";
    }
}

impl super::schema::DefaultNumber for PathBuf {}
