//! The values that maps colour.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::scene::schema::{number, scene_choice, scene_table};
use crate::scene::{Field, FieldShape, Kind};

scene_choice! {
    /// Noise functions.
    NoiseBasis {
        /// Gradient noise on a lattice.
        Perlin = "perlin",
        /// Sparse convolution with Gabor kernels of random orientation.
        Gabor = "gabor",
        /// Smooth normal noise with the autocorrelation exp(-r²/L²); L is one cell.
        Gaussian = "gaussian",
    }
}

/// Maximum number of cells of the finest octave along a side of the tile.
pub const MAX_CELLS: u32 = 128;

/// The value that a map colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Driver {
    Texture(TextureDriver),
    Noise(NoiseDriver),
    Height(HeightDriver),
    Slope(SlopeAlong),
    Steepness(Steepness),
    Sum(DriverSum),
}

scene_table! {
    /// Values of an image over the tile.
    TextureDriver {
        /// Required. The image; its luminance is the value.
        path: PathBuf = PathBuf::new(), FieldShape::Path, "";
        /// Number of periods of the image across the tile in x and y.
        repeat: u32 = 1, FieldShape::Integer { min: 1, max: 1024 }, "";
    }
}

scene_table! {
    /// Procedural noise that repeats with the tile.
    NoiseDriver {
        /// Noise function: perlin, gabor or gaussian.
        basis: NoiseBasis = NoiseBasis::Perlin, FieldShape::Choice(NoiseBasis::NAMES), "";
        /// Number of cells of the coarsest octave along a side of the tile.
        cells: u32 = 8, FieldShape::Integer { min: 1, max: MAX_CELLS as i64 }, "";
        /// Number of octaves; each has half the cells' size and half the amplitude of the one before.
        octaves: u32 = 1, FieldShape::Integer { min: 1, max: 8 }, "";
        /// Seed of the random numbers.
        seed: u64 = 1, FieldShape::Integer { min: 0, max: i64::MAX }, "";
    }
}

scene_table! {
    /// The height of the surface.
    HeightDriver {
        /// Standard deviation of an independent Gaussian offset.
        noise: f32 = 0.0, number(0.0, 1e3), "deviations of the heights";
    }
}

scene_table! {
    /// The slope -∂h/∂a along an azimuth a.
    SlopeAlong {
        /// Azimuth from +x towards +y.
        azimuth_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
    }
}

/// The length of the slope.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steepness {}

/// A weighted sum of standardized drivers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverSum {
    pub terms: Vec<WeightedDriver>,
}

/// A term of a sum of drivers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedDriver {
    pub driver: Driver,
    pub weight: f32,
}

const TERM: FieldShape = FieldShape::Table(WeightedDriver::fields);

impl Driver {
    /// The catalogue of drivers whose weighted sum is normal where they are.
    pub fn linear_kinds() -> Vec<Kind> {
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind("texture", "The luminance of an image over the tile.", TextureDriver::fields()),
            kind("noise", "Procedural noise over the tile.", NoiseDriver::fields()),
            kind("height", "The height of the surface.", HeightDriver::fields()),
            kind("slope", "The slope -∂h/∂a of the surface along an azimuth a.", SlopeAlong::fields()),
        ]
    }

    /// The catalogue of all drivers.
    pub fn kinds() -> Vec<Kind> {
        let terms = FieldShape::List { of: &TERM, min: 1, max: 8 };
        let terms = Field::required(
            "terms",
            terms,
            "Terms `{ driver, weight }`; each driver counts in its standard deviations.",
        );
        let mut kinds = Self::linear_kinds();
        kinds.push(Kind { kind: "steepness", doc: "The length of the slope.", fields: Vec::new() });
        kinds.push(Kind { kind: "sum", doc: "A weighted sum of standardized drivers.", fields: vec![terms] });
        kinds
    }

    /// The name in the scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Texture(_) => "texture",
            Self::Noise(_) => "noise",
            Self::Height(_) => "height",
            Self::Slope(_) => "slope",
            Self::Steepness(_) => "steepness",
            Self::Sum(_) => "sum",
        }
    }

    /// The drivers of a sum, or the driver itself.
    pub fn parts(&self) -> Vec<&Driver> {
        match self {
            Self::Sum(sum) => sum.terms.iter().map(|term| &term.driver).collect(),
            driver => vec![driver],
        }
    }

    /// Returns true if the driver is a property of the surface and not of the place on the tile.
    pub fn is_of_surface(&self) -> bool {
        self.parts().iter().any(|part| matches!(part, Self::Height(_) | Self::Slope(_) | Self::Steepness(_)))
    }
}

impl WeightedDriver {
    pub fn fields() -> Vec<Field> {
        vec![
            Field::required(
                "driver",
                FieldShape::Tagged(Driver::linear_kinds),
                "A driver other than steepness and sum.",
            ),
            Field::required("weight", number(-1e3, 1e3), "Factor on the standardized driver."),
        ]
    }
}
