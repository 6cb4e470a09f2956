//! The `[tile]` table: its extent and the geometry families with their parameters.

use std::path::PathBuf;

use glam::Vec2;
use serde::{Deserialize, Serialize};

use super::schema::{length, number, scene_choice, scene_table};
use super::{Field, FieldShape, Kind};

/// One period of the small-scale surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// Extent of the period in x and y, tile units.
    #[serde(default = "unit_square")]
    pub size: Vec2,
    /// What a tile unit is called; only shown.
    #[serde(default = "millimetre")]
    pub unit: String,
    /// Linear colour weights over the tile, seen from above; they multiply the materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color_path: Option<PathBuf>,
    /// Materials over the tile, seen from above: a grey value of k (of 255) is the slot `paint_k`, 0 the surface's own.
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
                "Extent of the period in x and y.",
            ),
            Field::new("unit", "", FieldShape::Text, None, "Name of the length unit."),
            Field::new("color_path", "", FieldShape::Path, None, "An image of colour weights over the tile."),
            Field::new(
                "slot_path",
                "",
                FieldShape::Path,
                None,
                "An image of materials over the tile: a grey of k (of 255) is the slot `paint_k`, 0 the surface's own.",
            ),
            Field::required("geometry", FieldShape::Tagged(Geometry::kinds), "The surface on the tile."),
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
            kind("weave", "Woven threads; slots `warp` (along y) and `weft` (along x).", Weave::fields()),
            kind("heightfield", "Heights from an image or a list; slot `default`.", Heightfield::fields()),
            kind("flat", "A plane, plain or in two slots `first` and `second`.", Flat::fields()),
            kind("mesh", "An OBJ file; `usemtl` names are the slots.", MeshFile::fields()),
        ]
    }

    /// The name that stands in the file.
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
    /// Parallel grooves (Wu et al. 2011, Fig. 4). Sides that would overlap meet at a ridge and steepen; what is left
    /// between two openings is flat land at z = 0, which belongs to `sides`.
    Grooves {
        /// How deep the grooves are.
        depth: f32 = 0.2, length(0.0, 1.0), "tile units";
        /// Angle of the sides with the base plane; rectangular and U profiles do without.
        side_angle_deg: f32 = 60.0, number(1.0, 90.0), "degrees";
        /// Width of the bottom (U: of the opening) as a part of the distance between grooves; V grooves have none.
        bottom_width: f32 = 0.4, number(0.0, 0.95), "of the pitch";
        /// Cross-section.
        profile: GrooveProfile = GrooveProfile::Trapezoid, FieldShape::Choice(GrooveProfile::NAMES), "";
        /// Grooves across the tile.
        count: u32 = 4, FieldShape::Integer { min: 1, max: 64 }, "";
        /// Turns the grooves, which run along y, about z; snaps to a direction in which the tile repeats.
        rotation_deg: f32 = 0.0, number(-180.0, 180.0), "degrees";
    }
}

scene_choice! {
    /// How pyramids stand on the plane.
    Arrangement {
        /// Rows and columns.
        Square = "square",
        /// Every second row shifted by half a spacing, rows closer by √3/2.
        Hex = "hex",
        /// Every second row shifted by half a spacing, like bricks.
        Staggered = "staggered",
    }
}

scene_table! {
    /// Pyramids on a floor (Wu et al. 2011, Fig. 5).
    Pyramids {
        /// Height of the full pyramid, before its tip is cut.
        height: f32 = 0.15, length(0.0, 1.0), "tile units";
        /// Size of the base as a part of the largest that fits its cell.
        base_size: f32 = 1.0, number(0.05, 1.0), "of the cell";
        /// Part of the height that is cut off at the tip.
        truncation: f32 = 0.0, number(0.0, 0.95), "of the height";
        /// Ratio of the runs of the faces towards +x and towards -x: moves the tip off the centre.
        face_ratio: f32 = 1.0, number(0.1, 10.0), "";
        /// Distance between neighbours, rounded so that whole cells fit the tile.
        spacing: f32 = 0.25, length(1e-9, 1.0), "tile units";
        /// Sides of the base.
        sides: u32 = 4, FieldShape::Integer { min: 3, max: 8 }, "";
        /// How they stand.
        arrangement: Arrangement = Arrangement::Square, FieldShape::Choice(Arrangement::NAMES), "";
        /// Turns each pyramid about its axis.
        rotation_deg: f32 = 0.0, number(-180.0, 180.0), "degrees";
    }
}

scene_table! {
    /// Tapered rods on a floor (the velvets of Wu et al. 2011, Fig. 6). They may lean over the tile's edge.
    Rods {
        /// Radius at the floor.
        radius: f32 = 0.02, length(1e-9, 0.2), "tile units";
        /// Length along the axis.
        length: f32 = 0.35, length(1e-9, 1.0), "tile units";
        /// How much thinner the tip is than the foot: 0 a cylinder, 1 a point.
        taper: f32 = 0.3, number(0.0, 1.0), "";
        /// Angle between the common axis and +z.
        lean_deg: f32 = 0.0, number(0.0, 80.0), "degrees";
        /// Where the rods lean to, from +x towards +y.
        lean_azimuth_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
        /// How far single rods stray from the common axis.
        spread_deg: f32 = 10.0, number(0.0, 80.0), "degrees";
        /// Randomness of the places: 0 a lattice, 1 anywhere in a rod's own cell.
        jitter: f32 = 0.8, number(0.0, 1.0), "";
        /// Randomness of the lengths, as a part of the length.
        length_variation: f32 = 0.1, number(0.0, 1.0), "";
        /// Rods on the tile.
        count: u32 = 100, FieldShape::Integer { min: 1, max: 4000 }, "";
        /// Rods per squared tile unit; stands in for the count.
        #[serde(skip_serializing_if = "Option::is_none")]
        density: Option<f32> = None, number(1e-3, 1e6), "per area";
        /// Seed of the random numbers.
        seed: u64 = 1, FieldShape::Integer { min: 0, max: i64::MAX }, "";
    }
}

scene_choice! {
    /// FieldShape of a thread across its run.
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
    /// Usual float patterns.
    FloatPattern {
        /// Over one, under one.
        Plain = "plain",
        /// Over two, under two, shifted by one a row.
        Twill = "twill",
        /// Warp over four, under one, steps of two: a warp-faced satin of five.
        Satin = "satin",
    }
}

/// Which thread is on top where: a named pattern, or a matrix with a row per weft thread and a column per warp thread,
/// 1 where the warp is on top.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WeavePattern {
    Named(FloatPattern),
    Matrix(Vec<Vec<u32>>),
}

impl super::schema::DefaultNumber for WeavePattern {}

scene_choice! {
    /// What lies under the gaps of a weave.
    Backing {
        /// Nothing: the tile has holes.
        None = "none",
        /// A sheet in the slot `warp`.
        Warp = "warp",
        /// A sheet in the slot `weft`.
        Weft = "weft",
        /// A sheet in a slot of its own, `backing`.
        Own = "backing",
    }
}

const WEAVE_BIT: FieldShape = FieldShape::Integer { min: 0, max: 1 };
const WEAVE_ROW: FieldShape = FieldShape::List { of: &WEAVE_BIT, min: 1, max: 24 };
const WEAVE_PATTERN: FieldShape =
    FieldShape::AnyOf(&[FieldShape::Choice(FloatPattern::NAMES), FieldShape::List { of: &WEAVE_ROW, min: 1, max: 24 }]);

scene_table! {
    /// Woven threads (Wu et al. 2011, Fig. 7): warp threads run along y, weft threads along x, and touch where they cross.
    Weave {
        /// Width of the warp threads as a part of their distance.
        warp_width: f32 = 0.9, number(0.05, 1.0), "of the spacing";
        /// Width of the weft threads as a part of their distance.
        weft_width: f32 = 0.9, number(0.05, 1.0), "of the spacing";
        /// Thickness of the warp threads.
        warp_height: f32 = 0.08, length(1e-9, 0.5), "tile units";
        /// Thickness of the weft threads.
        weft_height: f32 = 0.08, length(1e-9, 0.5), "tile units";
        /// Who bends: 0 only the weft, 1 only the warp.
        crimp: f32 = 0.5, number(0.0, 1.0), "";
        /// Warp threads on the tile, rounded to whole repeats of the pattern.
        warp_count: u32 = 4, FieldShape::Integer { min: 1, max: 24 }, "";
        /// Weft threads on the tile, rounded to whole repeats of the pattern.
        weft_count: u32 = 4, FieldShape::Integer { min: 1, max: 24 }, "";
        /// FieldShape of a thread across its run.
        cross_section: CrossSection = CrossSection::Elliptic, FieldShape::Choice(CrossSection::NAMES), "";
        /// Which thread is on top: plain, twill, satin or a matrix of 0 and 1 (1: warp on top; a row per weft thread).
        pattern: WeavePattern = WeavePattern::Named(FloatPattern::Plain), WEAVE_PATTERN, "";
        /// What lies under the gaps: none, warp, weft or backing.
        backing: Backing = Backing::Weft, FieldShape::Choice(Backing::NAMES), "";
    }
}

const HEIGHT: FieldShape = FieldShape::Number { min: -1e6, max: 1e6, soft_max: 1.0 };
const HEIGHT_ROW: FieldShape = FieldShape::List { of: &HEIGHT, min: 1, max: 4096 };

scene_table! {
    /// A height-field (Wu et al. 2011, Fig. 8) from an image or from values in the file. Image values are linear,
    /// 0 to 1 for integer formats. Sample (column i, row j) sits at ((i+½)/w, (j+½)/h) of the tile, row 0 at y = 0.
    Heightfield {
        /// Height of the value 1.
        height_scale: f32 = 1.0, FieldShape::Number { min: -1e8, max: 1e8, soft_max: 1.0 }, "tile units";
        /// An image of heights: PNG of 8 or 16 bits, TIFF, HDR or EXR.
        #[serde(skip_serializing_if = "Option::is_none")]
        path: Option<PathBuf> = None, FieldShape::Path, "";
        /// Heights row by row, in place of an image.
        #[serde(skip_serializing_if = "Option::is_none")]
        values: Option<Vec<Vec<f32>>> = None, FieldShape::List { of: &HEIGHT_ROW, min: 1, max: 4096 }, "";
    }
}

scene_choice! {
    /// How a plane is divided into the slots `first` and `second`.
    FlatPattern {
        /// One slot, `default`.
        Plain = "plain",
        /// Stripes along y.
        Stripes = "stripes",
        /// Checks.
        Checks = "checks",
    }
}

scene_table! {
    /// A plane, plain or printed (cylinder #2 of Wu et al. 2011, Fig. 9).
    Flat {
        /// Part of a stripe or check period that is `first`.
        ratio: f32 = 0.5, number(0.0, 1.0), "of the period";
        /// Division into slots.
        pattern: FlatPattern = FlatPattern::Plain, FieldShape::Choice(FlatPattern::NAMES), "";
        /// Periods across the tile.
        count: u32 = 4, FieldShape::Integer { min: 1, max: 64 }, "";
    }
}

scene_table! {
    /// A triangle mesh from an OBJ file, in tile coordinates.
    MeshFile {
        /// The OBJ file; its `usemtl` names choose the materials.
        path: PathBuf = PathBuf::new(), FieldShape::Path, "";
    }
}

impl super::schema::DefaultNumber for PathBuf {}
