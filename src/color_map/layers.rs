//! Layers of a scene resolved to drivers and stops in deviations, and the colour of a point of the surface.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::slopes::{SlopeDriver, Slopes};
use super::statistics::PlaceDriver;
use super::{Normal, Stop, StopMap};
use crate::scene::{ColorLayer, ColorMap, Combine, Driver, Gaussianize, GradientStop, LayerWeight, StopUnit};

/// Statistics of the surface, from which drivers are standardized.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relief {
    /// Heights over the projected area [tile units].
    pub height: Normal,
    pub slopes: Slopes,
    /// Length of the slope.
    pub steepness: Normal,
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Place in parts of the tile's size.
    pub place: DVec2,
    /// Height [tile units].
    pub height: f64,
    /// `(∂h/∂x, ∂h/∂y)`.
    pub slope: DVec2,
}

/// A driver whose values are in deviations from its mean.
#[derive(Debug, Clone)]
pub enum Source {
    Place(Arc<PlaceDriver>),
    /// Height, with an independent Gaussian offset of this standard deviation [deviations of the heights].
    Height {
        noise: f64,
    },
    Slope(SlopeDriver),
    Sum(Vec<(Source, f64)>),
}

/// A driver and its mean and deviation in the unit that `unit = "value"` counts in. The values of a sum are deviations
/// of that sum, so that its terms carry weights divided by its deviation.
#[derive(Debug, Clone)]
pub struct ResolvedDriver {
    pub spec: Driver,
    pub source: Source,
    pub unit: Normal,
}

/// A map over the deviations of a driver.
#[derive(Debug, Clone)]
pub struct DrivenMap {
    pub driver: ResolvedDriver,
    pub map: StopMap,
    /// The stops in their own unit.
    pub stops: StopMap,
    pub stop_unit: StopUnit,
}

/// One layer: weight times map.
#[derive(Debug, Clone)]
pub struct Layer {
    pub name: String,
    pub mapped: DrivenMap,
    pub factor: f64,
    pub blend: Option<DrivenMap>,
}

/// The colour map of a scene on a surface.
#[derive(Debug, Clone)]
pub struct LayeredMap {
    pub combine: Combine,
    pub layers: Vec<Layer>,
    pub relief: Relief,
    /// Number of reads of a footprint.
    pub taps: u32,
    pub gaussianize: Gaussianize,
    /// True if the relief is that of an analytic surface and not of the tile.
    pub is_analytic: bool,
}

/// A product of maps of independent drivers, times a number. Maps of one driver are merged.
#[derive(Debug, Clone)]
pub struct ProductTerm {
    pub factor: f64,
    pub places: Vec<(Arc<PlaceDriver>, StopMap)>,
    pub height: Option<StopMap>,
    pub slopes: Vec<(SlopeDriver, StopMap)>,
    pub sums: Vec<(Vec<(Source, f64)>, StopMap)>,
}

/// The stops of a scene file as a map.
pub fn stop_map(stops: &[GradientStop]) -> StopMap {
    StopMap::new(stops.iter().map(|stop| Stop { value: stop.value, color: stop.color.as_dvec3() }).collect())
}

/// Finds the samples of a texture or a noise.
pub type FindPlace<'a> = dyn Fn(&Driver) -> Option<Arc<PlaceDriver>> + 'a;

impl LayeredMap {
    /// Resolves the layers of a scene. `find` returns the samples of textures and noise; a driver that it does not know
    /// counts as 0.
    pub fn new(spec: &ColorMap, relief: Relief, find: &FindPlace<'_>) -> Self {
        let layer = |layer: &ColorLayer| Layer {
            name: layer.name.clone(),
            mapped: DrivenMap::new(&layer.driver, layer.unit, &layer.stops, &relief, find),
            factor: f64::from(layer.factor()),
            blend: match &layer.weight {
                LayerWeight::Number(_) => None,
                LayerWeight::Blend(blend) => {
                    Some(DrivenMap::new(&blend.driver, blend.unit, &blend.stops, &relief, find))
                }
            },
        };
        Self {
            combine: spec.combine,
            layers: spec.layer.iter().map(layer).collect(),
            relief,
            taps: spec.taps,
            gaussianize: spec.gaussianize,
            is_analytic: spec.surface.is_some(),
        }
    }

    /// The colour of a point: what a facet there has.
    pub fn color(&self, point: &SurfacePoint) -> Vec3 {
        let relief = &self.relief;
        let color = |layer: &Layer| {
            let weight = layer.blend.as_ref().map_or(DVec3::ONE, |blend| blend.color(point, relief));
            layer.mapped.color(point, relief) * weight * layer.factor
        };
        let color = match self.combine {
            Combine::Sum => self.layers.iter().map(color).sum::<DVec3>(),
            Combine::Product => self.layers.iter().map(color).product::<DVec3>(),
        };
        color.max(DVec3::ZERO).as_vec3()
    }

    /// The largest colour of each channel.
    pub fn max(&self) -> Vec3 {
        let most = |layer: &Layer| {
            let weight = layer.blend.as_ref().map_or(Vec3::ONE, |blend| blend.map.max());
            layer.mapped.map.max() * weight * layer.factor as f32
        };
        match self.combine {
            Combine::Sum => self.layers.iter().map(most).sum(),
            Combine::Product => self.layers.iter().map(most).product(),
        }
    }

    /// The map as a sum of products of independent maps.
    pub fn terms(&self) -> Vec<ProductTerm> {
        let maps = |layer: &Layer| std::iter::once(layer.mapped.clone()).chain(layer.blend.clone()).collect::<Vec<_>>();
        match self.combine {
            Combine::Sum => self.layers.iter().map(|layer| ProductTerm::new(layer.factor, &maps(layer))).collect(),
            Combine::Product => {
                let factor = self.layers.iter().map(|layer| layer.factor).product();
                vec![ProductTerm::new(factor, &self.layers.iter().flat_map(maps).collect::<Vec<_>>())]
            }
        }
    }

    /// Returns true if a driver is a property of the surface and not of the place.
    pub fn is_of_surface(&self) -> bool {
        let maps = self.layers.iter().flat_map(|layer| std::iter::once(&layer.mapped).chain(&layer.blend));
        maps.into_iter().any(|mapped| mapped.driver.spec.is_of_surface())
    }

    /// The samples of all textures and noises.
    pub fn places(&self) -> Vec<Arc<PlaceDriver>> {
        fn of(source: &Source, found: &mut Vec<Arc<PlaceDriver>>) {
            match source {
                Source::Place(place) => found.push(place.clone()),
                Source::Sum(terms) => terms.iter().for_each(|(source, _)| of(source, found)),
                _ => {}
            }
        }
        let mut found = Vec::new();
        for layer in &self.layers {
            std::iter::once(&layer.mapped).chain(&layer.blend).for_each(|map| of(&map.driver.source, &mut found));
        }
        found
    }
}

impl DrivenMap {
    fn new(driver: &Driver, unit: StopUnit, stops: &[GradientStop], relief: &Relief, find: &FindPlace<'_>) -> Self {
        let driver = ResolvedDriver::new(driver, relief, find);
        let stops = stop_map(stops);
        let map = match unit {
            StopUnit::Deviation => stops.clone(),
            StopUnit::Value => stops.standardized(driver.unit.mean, driver.unit.deviation),
        };
        Self { driver, map, stops, stop_unit: unit }
    }

    fn color(&self, point: &SurfacePoint, relief: &Relief) -> DVec3 {
        let value = self.driver.source.value(point, relief);
        match self.driver.source {
            // The offset is independent of the point: a facet has the mean over it.
            Source::Height { noise } if noise > 0.0 => self.map.mean(&Normal { mean: value, deviation: noise }),
            _ => self.map.color(value),
        }
    }

    /// Moments in the unit of the stops, from moments in deviations.
    pub fn in_stop_unit(&self, at: Normal) -> Normal {
        match self.stop_unit {
            StopUnit::Deviation => at,
            StopUnit::Value => {
                let Normal { mean, deviation } = self.driver.unit;
                Normal { mean: mean + deviation * at.mean, deviation: deviation * at.deviation }
            }
        }
    }
}

impl ResolvedDriver {
    fn new(spec: &Driver, relief: &Relief, find: &FindPlace<'_>) -> Self {
        let (source, unit) = match spec {
            Driver::Height(height) => {
                let noise = f64::from(height.noise);
                (Source::Height { noise }, relief.height)
            }
            Driver::Slope(slope) => {
                let azimuth = f64::from(slope.azimuth_deg).to_radians();
                (Source::Slope(SlopeDriver::Along { azimuth }), relief.slopes.driver(azimuth))
            }
            Driver::Steepness(_) => (Source::Slope(SlopeDriver::Steepness), relief.steepness),
            Driver::Texture(_) | Driver::Noise(_) => match find(spec) {
                Some(place) => {
                    let unit = Normal { mean: place.grid.mean, deviation: place.grid.deviation };
                    (Source::Place(place), unit)
                }
                None => (Source::Sum(Vec::new()), Normal { mean: 0.0, deviation: 0.0 }),
            },
            Driver::Sum(sum) => {
                let terms: Vec<(Source, f64)> = sum
                    .terms
                    .iter()
                    .map(|term| (Self::new(&term.driver, relief, find).source, f64::from(term.weight)))
                    .collect();
                let deviation = deviation_of_sum(&terms, relief);
                let scale = if deviation > 0.0 { deviation.recip() } else { 0.0 };
                let terms = terms.into_iter().map(|(source, weight)| (source, weight * scale)).collect();
                (Source::Sum(terms), Normal { mean: 0.0, deviation })
            }
        };
        Self { spec: spec.clone(), source, unit }
    }
}

/// The deviation of a weighted sum of standardized drivers on the whole surface.
fn deviation_of_sum(terms: &[(Source, f64)], relief: &Relief) -> f64 {
    let mut variance = 0.0;
    let mut heights = 0.0;
    // Slopes along several azimuths add up to a slope along one.
    let mut across = DVec2::ZERO;
    let mut places: Vec<(&Arc<PlaceDriver>, f64)> = Vec::new();
    for (source, weight) in terms {
        match source {
            Source::Place(place) => match places.iter_mut().find(|(known, _)| Arc::ptr_eq(known, place)) {
                Some((_, sum)) => *sum += weight,
                None => places.push((place, *weight)),
            },
            Source::Height { noise } => {
                heights += weight;
                variance += weight * weight * noise * noise;
            }
            Source::Slope(SlopeDriver::Along { azimuth }) => {
                let deviation = relief.slopes.driver(*azimuth).deviation;
                if deviation > 0.0 {
                    across += DVec2::from_angle(*azimuth) * (weight / deviation);
                }
            }
            Source::Slope(SlopeDriver::Steepness) | Source::Sum(_) => {}
        }
    }
    let of_places: f64 = places.iter().map(|(_, weight)| weight * weight).sum();
    let [xx, xy, yy] = relief.slopes.covariance;
    let slopes = xx * across.x * across.x + 2.0 * xy * across.x * across.y + yy * across.y * across.y;
    (variance + heights * heights + of_places + slopes.max(0.0)).sqrt()
}

/// `(value - mean) / deviation`; 0 for a value that does not vary.
fn standard(value: f64, unit: Normal) -> f64 {
    if unit.deviation > 0.0 { (value - unit.mean) / unit.deviation } else { 0.0 }
}

impl Source {
    /// The value at a point [deviations]. The offset of noisy heights is left out.
    pub fn value(&self, point: &SurfacePoint, relief: &Relief) -> f64 {
        match self {
            Self::Place(place) => place.grid.at(point.place),
            Self::Height { .. } => standard(point.height, relief.height),
            Self::Slope(driver) => standard(driver.value(point.slope), self.unit(relief)),
            Self::Sum(terms) => terms.iter().map(|(source, weight)| weight * source.value(point, relief)).sum(),
        }
    }

    /// Mean and deviation of a driver of the surface in its own unit.
    pub fn unit(&self, relief: &Relief) -> Normal {
        match self {
            Self::Height { .. } => relief.height,
            Self::Slope(SlopeDriver::Along { azimuth }) => relief.slopes.driver(*azimuth),
            Self::Slope(SlopeDriver::Steepness) => relief.steepness,
            Self::Place(_) | Self::Sum(_) => Normal { mean: 0.0, deviation: 1.0 },
        }
    }
}

impl ProductTerm {
    /// One map of slopes, in deviations.
    pub fn of_slope(driver: SlopeDriver, map: StopMap) -> Self {
        Self { factor: 1.0, places: Vec::new(), height: None, slopes: vec![(driver, map)], sums: Vec::new() }
    }

    fn new(factor: f64, maps: &[DrivenMap]) -> Self {
        let mut term = Self { factor, places: Vec::new(), height: None, slopes: Vec::new(), sums: Vec::new() };
        for DrivenMap { driver, map, .. } in maps {
            match &driver.source {
                Source::Place(place) => match term.places.iter_mut().find(|(known, _)| Arc::ptr_eq(known, place)) {
                    Some((_, merged)) => *merged = merged.product(map),
                    None => term.places.push((place.clone(), map.clone())),
                },
                Source::Height { noise } => {
                    let map = if *noise > 0.0 { map.blurred(*noise) } else { map.clone() };
                    term.height = Some(match term.height.take() {
                        Some(merged) => merged.product(&map),
                        None => map,
                    });
                }
                Source::Slope(slope) => match term.slopes.iter_mut().find(|(known, _)| known == slope) {
                    Some((_, merged)) => *merged = merged.product(map),
                    None => term.slopes.push((*slope, map.clone())),
                },
                Source::Sum(terms) => term.sums.push((terms.clone(), map.clone())),
            }
        }
        term
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::scene;

    pub(crate) const RELIEF: Relief = Relief {
        height: Normal { mean: 0.3, deviation: 0.1 },
        slopes: Slopes { mean: DVec2::ZERO, covariance: [0.12, 0.0, 0.12] },
        steepness: Normal { mean: 0.43, deviation: 0.22 },
    };

    pub(crate) fn resolved(map: &str) -> LayeredMap {
        let text = format!("[tile]\ngeometry = {{ kind = \"pyramids\" }}\n{map}");
        let spec = scene::parse(&text).unwrap().color_map.unwrap();
        LayeredMap::new(&spec, RELIEF, &|_| None)
    }

    #[test]
    fn two_layers_of_one_driver_are_merged_and_their_stops_multiplied() {
        let map = resolved(
            "[color_map]\ncombine = \"product\"\n[[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[-1, 0], [1, 1]]\n\
             [[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[0, [1, 0, 0]], [0, [0, 1, 0]]]\n",
        );
        let terms = map.terms();
        assert_eq!(terms.len(), 1);
        let merged = terms[0].height.as_ref().unwrap();
        assert!((merged.color(-0.5) - DVec3::new(0.25, 0.0, 0.0)).abs().max_element() < 1e-3);
        assert!((merged.color(0.5) - DVec3::new(0.0, 0.75, 0.0)).abs().max_element() < 1e-3);
        // The product of the means would be 0.25: far from the mean of the product.
        let mean = merged.mean(&Normal { mean: 0.0, deviation: 1.0 });
        assert!(mean.x < 0.17 && mean.y > 0.33, "{mean}");
    }

    #[test]
    fn stops_in_the_drivers_unit_colour_the_same_points_as_stops_in_deviations() {
        let layer = |unit: &str, at: f64| {
            resolved(&format!(
                "[color_map]\n[[color_map.layer]]\nunit = \"{unit}\"\ndriver = {{ kind = \"height\" }}\nstops = [[{at}, 0], [{at}, 1]]\n"
            ))
        };
        let (value, deviation) = (layer("value", 0.35), layer("deviation", 0.5));
        for height in [0.0, 0.34, 0.36, 1.0] {
            let point = SurfacePoint { place: DVec2::ZERO, height, slope: DVec2::ZERO };
            assert_eq!(value.color(&point), deviation.color(&point));
        }
    }

    #[test]
    fn a_sum_of_drivers_counts_in_its_own_deviations() {
        let map = resolved(
            "[color_map]\n[[color_map.layer]]\nstops = [[0, 0], [1, 1]]\n[color_map.layer.driver]\nkind = \"sum\"\n\
             terms = [{ driver = { kind = \"height\" }, weight = 3.0 }, { driver = { kind = \"slope\" }, weight = 4.0 }]\n",
        );
        assert!((map.layers[0].mapped.driver.unit.deviation - 5.0).abs() < 1e-9);
        let point = SurfacePoint { place: DVec2::ZERO, height: 0.4, slope: DVec2::ZERO };
        assert!((map.color(&point).x - 0.6).abs() < 1e-6);
    }
}
