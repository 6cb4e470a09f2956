//! The `[slab]` table: a thin transparent slab with two rough faces.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::color;
use super::effects::Switch;
use super::schema::{DefaultNumber, length, number, scene_choice, scene_table};
use super::{FieldShape, Kind};

scene_choice! {
    /// Method for light that meets rough facets on both faces.
    SlabMethod {
        /// The dual-microfacet model where it is close enough, otherwise the sum over facets.
        Auto = "auto",
        /// The dual-microfacet model (Dai et al. 2009, Eq. 11).
        Dual = "dual",
        /// A sum over facets of the smoother face (their Eq. 1).
        Faces = "faces",
    }
}

const ETA: FieldShape = FieldShape::AnyOf(&[number(1.0, 4.0), FieldShape::Vector { length: 3, min: 1.0, max: 4.0 }]);
const ALPHA: FieldShape = FieldShape::AnyOf(&[number(0.0, 1.0), FieldShape::Choice(&["auto"])]);
const ROUGHNESS: FieldShape =
    FieldShape::AnyOf(&[number(0.0, 2.0), FieldShape::Vector { length: 2, min: 0.0, max: 2.0 }]);
const BOUNCES: FieldShape = FieldShape::Choice(&["on", "off"]);

scene_table! {
    /// A thin transparent slab. With this table, the scene's effective BRDF is that of the slab.
    SlabSpec {
        /// Index of refraction over that of the surroundings.
        #[serde(with = "color")] eta: Vec3 = Vec3::splat(1.5), ETA, "";
        /// Distance of the faces.
        thickness: f32 = 0.0, length(0.0, 2.0), "tile units";
        /// Absorption along the refracted ray.
        #[serde(with = "color")] absorption: Vec3 = Vec3::ZERO, FieldShape::Color { max: 1e6 }, "per tile unit";
        /// Fraction of the light that leaves the other side with constant radiance.
        #[serde(with = "color")] diffuse: Vec3 = Vec3::ZERO, FieldShape::Color { max: 1.0 }, "";
        /// Method for light that meets rough facets on both faces: auto, dual (one formula) or faces (a sum).
        method: SlabMethod = SlabMethod::Auto, FieldShape::Choice(SlabMethod::NAMES), "";
        /// Fraction of the roughness on top, 0 (all below) to 1 (all on top); auto: by the variances of the slopes.
        alpha: Alpha = Alpha::Auto, ALPHA, "";
        /// Light that is reflected between the faces: on, or off as in the paper.
        bounces: Switch = Switch::On, BOUNCES, "";
        /// The face towards +z.
        top: SlabFace = SlabFace::Smooth {}, FieldShape::Tagged(SlabFace::kinds), "";
        /// The face towards -z, in the coordinates of the top: its normals also point to +z.
        bottom: SlabFace = SlabFace::Smooth {}, FieldShape::Tagged(SlabFace::kinds), "";
        /// A captured sheet in place of both faces: an .npz file of `biscale capture`, which also holds the index and alpha.
        #[serde(skip_serializing_if = "Option::is_none")]
        svbtdf: Option<PathBuf> = None, FieldShape::Path, "";
        /// Number of times that a captured sheet repeats over the object, along u and along v.
        #[serde(skip_serializing_if = "is_once")]
        repeat: [u32; 2] = [1, 1], FieldShape::List { of: &FieldShape::Integer { min: 1, max: 10_000 }, min: 2, max: 2 }, "";
    }
}

impl DefaultNumber for [u32; 2] {}

fn is_once(repeat: &[u32; 2]) -> bool {
    *repeat == [1, 1]
}

/// Part of the virtual roughness that lies on top.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alpha {
    /// By the variances of the slopes of both faces.
    #[default]
    Auto,
    Given(f32),
}

impl DefaultNumber for Alpha {}

impl Serialize for Alpha {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Given(value) => serializer.serialize_f32(*value),
        }
    }
}

impl<'de> Deserialize<'de> for Alpha {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Number(f32),
            Text(Word),
        }
        #[derive(Deserialize)]
        enum Word {
            #[serde(rename = "auto")]
            Auto,
        }
        Ok(match Written::deserialize(deserializer)? {
            Written::Number(value) => Self::Given(value),
            Written::Text(Word::Auto) => Self::Auto,
        })
    }
}

/// A face of a slab as a scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SlabFace {
    Smooth {},
    Beckmann(RoughFace),
    Ggx(RoughFace),
    Table(TableFace),
    Tile(TileFace),
}

impl DefaultNumber for SlabFace {}

scene_table! {
    /// A face with an analytic distribution of slopes.
    RoughFace {
        /// Roughness, or one roughness along x and one along y.
        #[serde(with = "roughness")] roughness: Vec2 = Vec2::splat(0.2), ROUGHNESS, "";
        /// Rotation of the axes.
        rotation_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
    }
}

scene_table! {
    /// A face with a tabulated distribution of slopes.
    TableFace {
        /// CSV file with a square table of densities over slopes: rows along y, columns along x, from -span to span.
        path: PathBuf = PathBuf::new(), FieldShape::Path, "";
        /// Largest slope of the table along each axis.
        span: f32 = 1.0, number(1e-3, 100.0), "";
        /// Rotation of the table.
        rotation_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
    }
}

scene_table! {
    /// A tile as a face.
    TileFace {
        /// Scene file whose `[tile]` is the face; without it, the tile of this scene.
        #[serde(skip_serializing_if = "Option::is_none")]
        scene: Option<PathBuf> = None, FieldShape::Path, "";
        /// Rotation of the tile.
        rotation_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
    }
}

impl SlabFace {
    /// The catalogue of faces.
    pub fn kinds() -> Vec<Kind> {
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind("smooth", "A level face.", Vec::new()),
            kind("beckmann", "Gaussian slopes.", RoughFace::fields()),
            kind("ggx", "GGX slopes, which have longer tails.", RoughFace::fields()),
            kind("table", "Slopes from a file.", TableFace::fields()),
            kind("tile", "The slopes of a tile without overhangs.", TileFace::fields()),
        ]
    }

    /// The name in the scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Smooth {} => "smooth",
            Self::Beckmann(_) => "beckmann",
            Self::Ggx(_) => "ggx",
            Self::Table(_) => "table",
            Self::Tile(_) => "tile",
        }
    }

    /// A face with default parameters.
    pub fn with_defaults(kind: &str) -> Option<Self> {
        Some(match kind {
            "smooth" => Self::Smooth {},
            "beckmann" => Self::Beckmann(RoughFace::default()),
            "ggx" => Self::Ggx(RoughFace::default()),
            "table" => Self::Table(TableFace::default()),
            "tile" => Self::Tile(TileFace::default()),
            _ => return None,
        })
    }

    /// The file that the face names.
    pub fn path(&self) -> Option<&std::path::Path> {
        match self {
            Self::Table(table) => Some(&table.path),
            Self::Tile(tile) => tile.scene.as_deref(),
            _ => None,
        }
    }
}

impl SlabSpec {
    /// Both faces with their keys.
    pub fn faces(&self) -> [(&'static str, &SlabFace); 2] {
        [("top", &self.top), ("bottom", &self.bottom)]
    }

    /// The face that stands beside a captured sheet, which takes the place of both.
    pub(super) fn face_beside_svbtdf(&self) -> Option<&'static str> {
        self.svbtdf.as_ref()?;
        self.faces().into_iter().find(|(_, face)| **face != SlabFace::Smooth {}).map(|(side, _)| side)
    }
}

/// One roughness, or one along each axis.
mod roughness {
    use glam::Vec2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        One(f32),
        Two([f32; 2]),
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec2, D::Error> {
        Ok(match Written::deserialize(deserializer)? {
            Written::One(value) => Vec2::splat(value),
            Written::Two(values) => Vec2::from_array(values),
        })
    }

    pub fn serialize<S: Serializer>(roughness: &Vec2, serializer: S) -> Result<S::Ok, S::Error> {
        if roughness.x == roughness.y {
            roughness.x.serialize(serializer)
        } else {
            roughness.to_array().serialize(serializer)
        }
    }
}
