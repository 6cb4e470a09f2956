//! The table `[color_map]`: gradient stops on textures, noise, heights and slopes.

mod check;
mod driver;

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::schema::{number, scene_choice, scene_table};
use super::{Field, FieldShape};
pub use driver::{
    Driver, DriverSum, HeightDriver, MAX_CELLS, NoiseBasis, NoiseDriver, SlopeAlong, Steepness, TextureDriver,
    WeightedDriver,
};

scene_choice! {
    /// Combination of the layers.
    Combine {
        /// The sum of weight times colour.
        Sum = "sum",
        /// The product of the layers' colours.
        Product = "product",
    }
}

scene_choice! {
    /// Distribution of the heights that are seen and lit.
    HeightDistribution {
        /// Moments of the tile's facets, weighted with visibility, cosines and the BRDF.
        Measured = "measured",
        /// Smith's surface (Eq. 16), with the azimuths' correlation.
        Smith = "smith",
        /// The paper's fits (Eqs. 17, 18), sum of exponents, and slopes apart from light and BRDF (Eq. 19).
        Paper = "paper",
    }
}

scene_choice! {
    /// Use of ranks.
    Gaussianize {
        /// Ranks if the mean colour would be wrong without them.
        Auto = "auto",
        /// Always ranks.
        On = "on",
        /// Never ranks.
        Off = "off",
    }
}

scene_choice! {
    /// Method for the mean of a map under a Gaussian distribution.
    StopEvaluation {
        /// In closed form from the stops.
        Closed = "closed",
        /// From a table of 1024 means and 64 deviations.
        Table = "table",
    }
}

scene_choice! {
    /// Unit of the stops' values.
    StopUnit {
        /// Deviations from the driver's mean.
        Deviation = "deviation",
        /// The driver's own unit.
        Value = "value",
    }
}

const LAYER: FieldShape = FieldShape::Table(ColorLayer::fields);

scene_table! {
    /// Colour maps: layers of gradient stops on drivers.
    ColorMap {
        /// Combination of the layers: sum or product.
        combine: Combine = Combine::Sum, FieldShape::Choice(Combine::NAMES), "";
        /// Distribution of heights and slopes that are seen and lit: measured on the facets, smith or paper.
        distribution: HeightDistribution = HeightDistribution::Measured, FieldShape::Choice(HeightDistribution::NAMES), "";
        /// Ranks make a texture's values normal before its moments are taken: auto, on or off.
        gaussianize: Gaussianize = Gaussianize::Auto, FieldShape::Choice(Gaussianize::NAMES), "";
        /// Number of reads per pixel of a texture: 1, 4 or 16.
        taps: u32 = 4, FieldShape::Integer { min: 1, max: 16 }, "";
        /// Evaluation of the stops: closed (in closed form) or table.
        table: StopEvaluation = StopEvaluation::Closed, FieldShape::Choice(StopEvaluation::NAMES), "";
        /// A surface of Gaussian heights in place of those of the tile.
        #[serde(skip_serializing_if = "Option::is_none")]
        surface: Option<GaussianSurface> = None, FieldShape::Table(GaussianSurface::fields), "";
        /// Layers of the map.
        #[serde(rename = "layer")]
        layer: Vec<ColorLayer> = Vec::new(), FieldShape::List { of: &LAYER, min: 1, max: 16 }, "";
    }
}

const SLOPE: f64 = 100.0;

scene_table! {
    /// A surface of Gaussian heights and slopes.
    GaussianSurface {
        /// Deviation of the heights.
        height: f32 = 0.1, number(0.0, 1e8), "tile units";
        /// Mean slope along x and y.
        slope_mean: Vec2 = Vec2::ZERO, FieldShape::Vector { length: 2, min: -SLOPE, max: SLOPE }, "";
        /// Covariance of the slopes: xx, xy, yy.
        slope_covariance: Vec3 = Vec3::new(0.12, 0.0, 0.12), FieldShape::Vector { length: 3, min: -SLOPE * SLOPE, max: SLOPE * SLOPE }, "";
    }
}

/// One layer: stops on a driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorLayer {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    pub driver: Driver,
    #[serde(default = "in_deviations")]
    pub unit: StopUnit,
    pub stops: Vec<GradientStop>,
    #[serde(default = "weight_of_one")]
    pub weight: LayerWeight,
}

fn in_deviations() -> StopUnit {
    StopUnit::Deviation
}

fn weight_of_one() -> LayerWeight {
    LayerWeight::Number(1.0)
}

/// The weight of a layer in a sum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum LayerWeight {
    Number(f32),
    /// A second map, whose colours are weights: a blend.
    Blend(Blend),
}

/// Stops of weights on a driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blend {
    pub driver: Driver,
    #[serde(default = "in_deviations")]
    pub unit: StopUnit,
    pub stops: Vec<GradientStop>,
}

/// A stop as scene files write it: `[value, [r, g, b]]`, or `[value, grey]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientStop {
    pub value: f64,
    pub color: Vec3,
}

#[derive(Deserialize)]
struct StopPair(f64, #[serde(with = "crate::scene::color")] Vec3);

impl<'de> Deserialize<'de> for GradientStop {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        StopPair::deserialize(deserializer).map(|StopPair(value, color)| Self { value, color })
    }
}

impl Serialize for GradientStop {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.value, self.color.to_array()).serialize(serializer)
    }
}

const STOPS: FieldShape = FieldShape::Stops { max_color: super::MAX_COLOR };

impl Blend {
    pub fn fields() -> Vec<Field> {
        vec![
            Field::required("driver", FieldShape::Tagged(Driver::kinds), "The value that decides the weight."),
            Field::new("unit", "", FieldShape::Choice(StopUnit::NAMES), None, "Unit of the stops: deviation or value."),
            Field::required("stops", STOPS, "Ascending stops `[value, weight]`."),
        ]
    }
}

const WEIGHT: FieldShape = FieldShape::AnyOf(&[number(0.0, super::MAX_COLOR), FieldShape::Table(Blend::fields)]);

impl ColorLayer {
    pub fn fields() -> Vec<Field> {
        vec![
            Field::new("name", "", FieldShape::Text, None, "Name of the layer."),
            Field::required("driver", FieldShape::Tagged(Driver::kinds), "The value that the stops colour."),
            Field::new(
                "unit",
                "",
                FieldShape::Choice(StopUnit::NAMES),
                None,
                "Unit of the stops: deviation (standard deviations from the driver's mean) or value (the driver's own unit).",
            ),
            Field::required("stops", STOPS, "Ascending stops `[value, [r, g, b]]`; two equal values are a jump."),
            Field::new(
                "weight",
                "",
                WEIGHT,
                Some(1.0),
                "Factor in a sum of layers: a number, or a table `{ driver, unit, stops }` of stops `[value, weight]`.",
            ),
        ]
    }

    /// The weight as a number; 1 for a blend.
    pub fn factor(&self) -> f32 {
        match self.weight {
            LayerWeight::Number(weight) => weight,
            LayerWeight::Blend(_) => 1.0,
        }
    }

    /// The drivers of the layer and of its weight.
    pub fn drivers(&self) -> impl Iterator<Item = &Driver> {
        let blend = match &self.weight {
            LayerWeight::Blend(blend) => Some(&blend.driver),
            LayerWeight::Number(_) => None,
        };
        std::iter::once(&self.driver).chain(blend)
    }
}

impl ColorMap {
    /// Image files of all drivers.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let parts = self.layer.iter().flat_map(ColorLayer::drivers).flat_map(Driver::parts);
        parts.filter_map(|driver| match driver {
            Driver::Texture(texture) => Some(&texture.path),
            _ => None,
        })
    }
}
