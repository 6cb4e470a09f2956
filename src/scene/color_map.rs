//! The table `[color_map]`: gradient stops on textures, noise, heights and slopes.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::check::{PathStep, Problem};
use super::schema::{number, scene_choice, scene_table};
use super::{Field, FieldShape, Geometry, Kind, Scene};

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
    /// Method for the mean of a map under a normal distribution.
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

const LAYER: FieldShape = FieldShape::Table(ColorLayer::fields);

scene_table! {
    /// Colour maps: layers of gradient stops on drivers.
    ColorMap {
        /// Combination of the layers: sum or product.
        combine: Combine = Combine::Sum, FieldShape::Choice(Combine::NAMES), "";
        /// Distribution of heights that are seen and lit: measured, smith or paper.
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
struct StopPair(f64, #[serde(with = "super::color")] Vec3);

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
        /// Deviation of an independent normal offset.
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
const STOPS: FieldShape = FieldShape::Stops { max_color: super::MAX_COLOR };

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
        let terms =
            Field::required("terms", terms, "Terms `{ driver, weight }`; each driver counts in its deviations.");
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
                "Unit of the stops: deviation (deviations from the driver's mean) or value (the driver's own unit).",
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

/// Makes the error of a key: path, found, expected.
type MakeProblem<'a> = dyn Fn(&[PathStep], &str, &str) -> Result<(), Problem> + 'a;

impl ColorMap {
    /// Image files of all drivers.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let parts = self.layer.iter().flat_map(ColorLayer::drivers).flat_map(Driver::parts);
        parts.filter_map(|driver| match driver {
            Driver::Texture(texture) => Some(&texture.path),
            _ => None,
        })
    }

    /// Checks rules that relate several keys.
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let key = |name: &str| PathStep::Key(name.to_owned());
        let problem = |path: &[PathStep], found: &str, expected: &str| {
            let path: Vec<PathStep> = std::iter::once(key("color_map")).chain(path.iter().cloned()).collect();
            Err(Problem::new(&path, found, expected))
        };
        if self.layer.is_empty() {
            return problem(&[key("layer")], "no layers", "at least one `[[color_map.layer]]`");
        }
        if !matches!(self.taps, 1 | 4 | 16) {
            return problem(&[key("taps")], &self.taps.to_string(), "1, 4 or 16");
        }
        if let Some(GaussianSurface { slope_covariance: Vec3 { x, y, z }, .. }) = self.surface {
            let is_sound =
                x >= 0.0 && z >= 0.0 && f64::from(y) * f64::from(y) <= f64::from(x) * f64::from(z) * (1.0 + 1e-6);
            if !is_sound {
                let path = [key("surface"), key("slope_covariance")];
                return problem(
                    &path,
                    &format!("[{x}, {y}, {z}]"),
                    "a positive semi-definite matrix: xx ≥ 0, yy ≥ 0, xy² ≤ xx yy",
                );
            }
        }
        let no_relief = matches!(scene.tile.geometry, Geometry::Flat(_)) && self.surface.is_none();
        for (index, layer) in self.layer.iter().enumerate() {
            let entry = PathStep::Entry(index, Some(layer.name.clone()).filter(|name| !name.is_empty()));
            let at = [key("layer"), entry.clone(), key("driver")];
            let earlier = &self.layer[..index];
            if !layer.name.is_empty() && earlier.iter().any(|other| other.name == layer.name) {
                let path = [key("layer"), entry, key("name")];
                return problem(&path, &format!("`{}` a second time", layer.name), "each name once");
            }
            for driver in layer.drivers().flat_map(Driver::parts) {
                match driver {
                    Driver::Texture(texture) if texture.path.as_os_str().is_empty() => {
                        return problem(&[&at[..], &[key("path")]].concat(), "nothing", "an image");
                    }
                    Driver::Noise(noise) if noise.cells << (noise.octaves - 1) > MAX_CELLS => {
                        let found = format!("{} cells in {} octaves", noise.cells, noise.octaves);
                        let expected =
                            format!("at most {MAX_CELLS} cells in the finest octave: cells x 2^(octaves - 1)");
                        return problem(&[&at[..], &[key("cells")]].concat(), &found, &expected);
                    }
                    driver if driver.is_of_surface() && no_relief => {
                        let found = format!("`{}` on a flat tile", driver.kind());
                        return problem(&at, &found, "a tile with relief, or `[color_map.surface]`");
                    }
                    _ => {}
                }
            }
        }
        self.check_dependence(&problem)
    }

    /// Refuses products of layers whose drivers depend on each other and that cannot be merged.
    fn check_dependence(&self, problem: &MakeProblem<'_>) -> Result<(), Problem> {
        let key = |name: &str| PathStep::Key(name.to_owned());
        for (index, layer) in self.layer.iter().enumerate() {
            let with_blend: Vec<&Driver> = layer.drivers().collect();
            let earlier = self.layer[..index].iter().flat_map(ColorLayer::drivers);
            let others: Vec<&Driver> = if self.combine == Combine::Product { earlier.collect() } else { Vec::new() };
            let pairs = with_blend.iter().flat_map(|a| others.iter().map(move |b| (*a, *b)));
            let own = (with_blend.len() == 2).then(|| (with_blend[0], with_blend[1]));
            for (a, b) in pairs.chain(own) {
                if !can_multiply(a, b) {
                    let path = [key("layer"), PathStep::Entry(index, None), key("driver")];
                    let found =
                        format!("a product of maps of `{}` and `{}`, which depend on each other", a.kind(), b.kind());
                    return problem(&path, &found, "equal drivers, independent ones, or one map of their sum");
                }
            }
        }
        Ok(())
    }
}

/// Returns true if the mean of the product of two maps can be computed: the drivers are equal, independent, or both are
/// functions of the slope.
fn can_multiply(a: &Driver, b: &Driver) -> bool {
    let is_slope = |driver: &Driver| matches!(driver, Driver::Slope(_) | Driver::Steepness(_));
    let depends = |a: &Driver, b: &Driver| match (a, b) {
        (Driver::Height(_), Driver::Height(_)) => true,
        (a, b) if is_slope(a) && is_slope(b) => true,
        (a, b) => a == b,
    };
    if a == b || is_slope(a) && is_slope(b) || matches!((a, b), (Driver::Height(_), Driver::Height(_))) {
        return true;
    }
    !a.parts().iter().any(|a| b.parts().iter().any(|b| depends(a, b)))
}
