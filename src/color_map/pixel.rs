//! Colour maps as the pixels of an image read them: the moments of what a pixel filters away, and tables of the maps.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::layers::{LayeredMap, ProductTerm, Relief, Source};
use super::slopes::SlopeDriver;
use super::statistics::{Footprint, PlaceMap};
use super::{Normal, PrefilteredTable, Stop, StopMap};

/// A colour map with the tables of all its maps.
#[derive(Debug)]
pub struct PixelMap {
    terms: Vec<Term>,
    relief: Relief,
    taps: u32,
}

/// A product of independent maps.
#[derive(Debug)]
struct Term {
    factor: f64,
    places: Vec<(PlaceMap, PrefilteredTable)>,
    height: Option<PrefilteredTable>,
    slopes: Vec<(SlopeDriver, Normal, PrefilteredTable)>,
    sums: Vec<Sum>,
}

/// A map of a weighted sum of drivers.
#[derive(Debug)]
struct Sum {
    table: PrefilteredTable,
    /// Textures and noises with their weights.
    places: Vec<(PlaceMap, f64)>,
    /// Weight of the heights, and variance of the noise on them.
    heights: f64,
    noise: f64,
    /// The part of the slope: `offset + s · across`.
    across: DVec2,
    offset: f64,
}

/// A colour map at a footprint: what does not depend on heights and slopes.
#[derive(Debug)]
pub struct PixelColors<'a> {
    map: &'a PixelMap,
    /// Factor of each term.
    factors: Vec<DVec3>,
    /// Moments of the places in each sum.
    sums: Vec<Normal>,
}

/// A normal distribution of slopes that is narrow against the map: its mean and covariance (xx, xy, yy).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NarrowSlopes {
    pub mean: DVec2,
    pub covariance: [f64; 3],
}

impl NarrowSlopes {
    fn variance_along(&self, axis: DVec2) -> f64 {
        let [xx, xy, yy] = self.covariance;
        (xx * axis.x * axis.x + 2.0 * xy * axis.x * axis.y + yy * axis.y * axis.y).max(0.0)
    }
}

/// Directions in which the colour changes with the slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlopeAxes {
    None,
    /// Along one azimuth.
    One(DVec2),
    All,
}

impl PixelMap {
    pub fn new(map: &LayeredMap) -> Self {
        let terms = map.terms().iter().map(|term| Term::new(term, map)).collect();
        Self { terms, relief: map.relief, taps: map.taps }
    }

    /// Number of products that [`PixelColors`] sums.
    pub fn count(&self) -> usize {
        self.terms.len()
    }

    /// The map at a footprint; `None` is the whole tile.
    pub fn at(&self, footprint: Option<&Footprint>) -> PixelColors<'_> {
        let color = |(place, table): &(PlaceMap, PrefilteredTable)| match footprint {
            Some(at) => place.reads(at, self.taps).iter().map(|(weight, at)| table.mean(at) * *weight).sum(),
            None => table.mean(&place.whole()),
        };
        let factor = |term: &Term| term.places.iter().map(color).product::<DVec3>() * term.factor;
        let moments = |sum: &Sum| {
            let mut total = Normal { mean: 0.0, deviation: 0.0 };
            for (place, weight) in &sum.places {
                let at = footprint.map_or(place.whole(), |at| place.moments(at, self.taps));
                total.mean += weight * at.mean;
                total.deviation = total.deviation.hypot(weight * at.deviation);
            }
            total
        };
        PixelColors {
            map: self,
            factors: self.terms.iter().map(factor).collect(),
            sums: self.terms.iter().flat_map(|term| &term.sums).map(moments).collect(),
        }
    }

    pub fn slope_axes(&self) -> SlopeAxes {
        let mut axes = SlopeAxes::None;
        let of_sums = self.terms.iter().flat_map(|term| &term.sums).map(|sum| sum.across.try_normalize());
        let of_slopes = self.terms.iter().flat_map(|term| &term.slopes).map(|(driver, ..)| match driver {
            SlopeDriver::Along { azimuth } => Some(DVec2::from_angle(*azimuth)),
            SlopeDriver::Steepness => Some(DVec2::ZERO),
        });
        for axis in of_slopes.chain(of_sums).flatten() {
            axes = match axes {
                SlopeAxes::None if axis != DVec2::ZERO => SlopeAxes::One(axis),
                SlopeAxes::One(known) if axis != DVec2::ZERO && known.perp_dot(axis).abs() < 1e-6 => axes,
                _ => SlopeAxes::All,
            };
        }
        axes
    }

    /// Variation of the places of the map between footprints of this covariance, in deviations.
    pub fn place_variation(&self, covariance: glam::DMat2) -> f64 {
        const SAMPLES: u32 = 16;
        let of = |place: &PlaceMap| {
            let whole = place.moments_of_whole();
            let (mut first, mut second) = (0.0, 0.0);
            for k in 0..SAMPLES * SAMPLES {
                let centre = DVec2::new(f64::from(k % SAMPLES), f64::from(k / SAMPLES)) / f64::from(SAMPLES);
                let mean = place.moments(&Footprint { centre, covariance }, 1).mean - whole.mean;
                first += mean / f64::from(SAMPLES * SAMPLES);
                second += mean * mean / f64::from(SAMPLES * SAMPLES);
            }
            (second - first * first).max(0.0).sqrt()
        };
        let own = self.terms.iter().flat_map(|term| &term.places).map(|(place, _)| of(place));
        let of_sums = self.terms.iter().flat_map(|term| &term.sums).flat_map(|sum| &sum.places);
        own.chain(of_sums.map(|(place, _)| of(place))).fold(0.0, f64::max)
    }
}

impl Term {
    fn new(term: &ProductTerm, map: &LayeredMap) -> Self {
        let place = |(driver, stops): &(Arc<super::statistics::PlaceDriver>, StopMap)| {
            let place = PlaceMap::new(driver.clone(), stops, map.gaussianize);
            let table = PrefilteredTable::new(place.map());
            (place, table)
        };
        let slope = |(driver, stops): &(SlopeDriver, StopMap)| {
            (*driver, Source::Slope(*driver).unit(&map.relief), PrefilteredTable::new(stops))
        };
        Self {
            factor: term.factor,
            places: term.places.iter().map(place).collect(),
            height: term.height.as_ref().map(PrefilteredTable::new),
            slopes: term.slopes.iter().map(slope).collect(),
            sums: term.sums.iter().map(|(parts, stops)| Sum::new(parts, stops, &map.relief)).collect(),
        }
    }
}

impl Sum {
    fn new(parts: &[(Source, f64)], stops: &StopMap, relief: &Relief) -> Self {
        let table = PrefilteredTable::new(stops);
        let mut sum = Self { table, places: Vec::new(), heights: 0.0, noise: 0.0, across: DVec2::ZERO, offset: 0.0 };
        for (source, weight) in parts {
            match source {
                Source::Place(driver) => {
                    let any = StopMap::new(vec![Stop { value: 0.0, color: DVec3::ONE }]);
                    let place = PlaceMap::new(driver.clone(), &any, crate::scene::Gaussianize::Off);
                    sum.places.push((place, *weight));
                }
                Source::Height { noise } => {
                    sum.heights += weight;
                    sum.noise += (weight * noise).powi(2);
                }
                Source::Slope(SlopeDriver::Along { azimuth }) => {
                    let unit = relief.slopes.driver(*azimuth);
                    if unit.deviation > 0.0 {
                        sum.across -= DVec2::from_angle(*azimuth) * (weight / unit.deviation);
                        sum.offset -= weight * unit.mean / unit.deviation;
                    }
                }
                Source::Slope(SlopeDriver::Steepness) | Source::Sum(_) => {}
            }
        }
        sum
    }

    fn color(&self, places: &Normal, heights: &Normal, slopes: &NarrowSlopes) -> DVec3 {
        let mean = places.mean + self.offset + self.heights * heights.mean + self.across.dot(slopes.mean);
        let variance = places.deviation.powi(2)
            + self.noise
            + (self.heights * heights.deviation).powi(2)
            + slopes.variance_along(self.across);
        self.table.mean(&Normal { mean, deviation: variance.sqrt() })
    }
}

/// `(value - mean) / deviation`; a value that does not vary counts as 0.
fn standardized(at: Normal, unit: Normal) -> Normal {
    if unit.deviation > 0.0 {
        Normal { mean: (at.mean - unit.mean) / unit.deviation, deviation: at.deviation / unit.deviation }
    } else {
        Normal { mean: 0.0, deviation: 0.0 }
    }
}

impl PixelColors<'_> {
    /// The factor of each term that depends on heights [tile units], besides that of its footprint.
    pub fn by_heights(&self, heights: &Normal, out: &mut [DVec3]) {
        let heights = standardized(*heights, self.map.relief.height);
        for ((out, term), factor) in out.iter_mut().zip(&self.map.terms).zip(&self.factors) {
            *out = *factor * term.height.as_ref().map_or(DVec3::ONE, |table| table.mean(&heights));
        }
    }

    /// The factor of each term that depends on slopes.
    pub fn by_slopes(&self, slopes: &NarrowSlopes, out: &mut [DVec3]) {
        for (out, term) in out.iter_mut().zip(&self.map.terms) {
            let color = |(driver, unit, table): &(SlopeDriver, Normal, PrefilteredTable)| {
                let axis = match driver {
                    SlopeDriver::Along { azimuth } => DVec2::from_angle(*azimuth),
                    SlopeDriver::Steepness => slopes.mean.normalize_or(DVec2::X),
                };
                let deviation = slopes.variance_along(axis).sqrt();
                table.mean(&standardized(Normal { mean: driver.value(slopes.mean), deviation }, *unit))
            };
            *out = term.slopes.iter().map(color).product();
        }
    }

    /// Returns true if a map of a sum depends on heights and slopes together.
    pub fn has_sums(&self) -> bool {
        !self.sums.is_empty()
    }

    /// Multiplies each term by its maps of sums.
    pub fn times_sums(&self, heights: &Normal, slopes: &NarrowSlopes, out: &mut [DVec3]) {
        let heights = standardized(*heights, self.map.relief.height);
        let mut places = self.sums.iter();
        for (out, term) in out.iter_mut().zip(&self.map.terms) {
            for sum in &term.sums {
                let Some(places) = places.next() else { return };
                *out *= sum.color(places, &heights, slopes);
            }
        }
    }
}

#[cfg(test)]
#[path = "pixel_tests.rs"]
mod tests;
