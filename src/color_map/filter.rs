//! The mean colour of what is seen and lit (Heitz et al. 2013, Secs. 5 and 6): one distribution per driver, products of
//! independent ones.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::heights::Largest;
use super::layers::{LayeredMap, ProductTerm, Relief, Source, SurfacePoint};
use super::slopes::{Focus, SlopeDriver, Slopes};
use super::statistics::{PlaceDriver, PlaceMap};
use super::{Distribution, Normal, StopMap};
use crate::scene::Gaussianize;

/// Distribution of the heights that are seen and lit [deviations].
#[derive(Debug, Clone)]
pub enum HeightsSeen {
    /// D_h itself (Eq. 16).
    Smith(Largest),
    Normal(Normal),
}

impl HeightsSeen {
    /// The mean of a map of heights.
    pub fn mean(&self, map: &StopMap) -> DVec3 {
        match self {
            Self::Smith(largest) => map.mean(largest),
            Self::Normal(normal) => map.mean(normal),
        }
    }

    /// Mean and deviation of the heights.
    pub fn moments(&self) -> Normal {
        match self {
            Self::Smith(largest) => largest.moments(),
            Self::Normal(normal) => *normal,
        }
    }
}

/// Weights of slopes.
pub enum SlopesSeen<'a> {
    /// By what is seen, lit and reflected: the density is `p(s) weight(s)`.
    Joint { weight: &'a dyn Fn(DVec2) -> DVec3, focus: Option<Focus> },
    /// By what is seen, apart from light and BRDF (Eqs. 19 and 20); the direction to the viewer.
    Apart(DVec3),
}

/// The surface that is visible, lit and reflects.
pub enum SurfaceSeen<'a> {
    /// Points of a tile, with weights for each channel.
    Facets(&'a [(SurfacePoint, DVec3)]),
    /// A surface whose heights and slopes are Gaussian and independent.
    Gaussian { heights: HeightsSeen, slopes: SlopesSeen<'a> },
}

/// Everything that the colour of what is seen and lit depends on.
pub struct VisibleValues<'a> {
    pub surface: SurfaceSeen<'a>,
    pub gaussianize: Gaussianize,
}

impl VisibleValues<'_> {
    /// The mean colour of the map.
    pub fn color(&self, map: &LayeredMap) -> DVec3 {
        map.terms().iter().map(|term| self.of_term(term, &map.relief)).sum()
    }

    /// The mean colour of a product of maps.
    pub fn of_term(&self, term: &ProductTerm, relief: &Relief) -> DVec3 {
        let places = term.places.iter().map(|(place, map)| whole_mean(place, map, self.gaussianize));
        let of_surface = match &self.surface {
            SurfaceSeen::Facets(facets) => mean_of_facets(facets, term, relief),
            SurfaceSeen::Gaussian { heights, slopes } => mean_of_gaussian(heights, slopes, term, relief),
        };
        places.product::<DVec3>() * of_surface * term.factor
    }
}

/// The mean of a term's maps of heights, slopes and sums over facets.
fn mean_of_facets(facets: &[(SurfacePoint, DVec3)], term: &ProductTerm, relief: &Relief) -> DVec3 {
    if term.height.is_none() && term.slopes.is_empty() && term.sums.is_empty() {
        return DVec3::ONE;
    }
    let height = Source::Height { noise: 0.0 };
    let slopes: Vec<_> = term.slopes.iter().map(|(driver, map)| (Source::Slope(*driver), map)).collect();
    // Textures and noise know nothing of the surface: in sums they add variance.
    let variance = |(source, weight): &(Source, f64)| match source {
        Source::Place(_) => weight * weight,
        Source::Height { noise } => (weight * noise).powi(2),
        Source::Slope(_) | Source::Sum(_) => 0.0,
    };
    let sums: Vec<_> =
        term.sums.iter().map(|(sum, map)| (sum, map, sum.iter().map(variance).sum::<f64>().sqrt())).collect();
    let at = |point: &SurfacePoint| {
        let mut color = term.height.as_ref().map_or(DVec3::ONE, |map| map.color(height.value(point, relief)));
        for (source, map) in &slopes {
            color *= map.color(source.value(point, relief));
        }
        for (sum, map, deviation) in &sums {
            let of_surface = sum.iter().filter(|(source, _)| !matches!(source, Source::Place(_)));
            let mean = of_surface.map(|(source, weight)| weight * source.value(point, relief)).sum();
            color *= map.mean(&Normal { mean, deviation: *deviation });
        }
        color
    };
    let total: DVec3 = facets.iter().map(|(_, weight)| *weight).sum();
    let sum: DVec3 = facets.iter().map(|(point, weight)| at(point) * *weight).sum();
    // A channel that reflects nothing takes the colour of the mean height and slope.
    let mean = SurfacePoint { place: DVec2::ZERO, height: relief.height.mean, slope: relief.slopes.mean };
    DVec3::select(total.cmpgt(DVec3::ZERO), sum / total, at(&mean))
}

/// The mean of a term's maps of heights, slopes and sums over a Gaussian surface.
fn mean_of_gaussian(heights: &HeightsSeen, slopes: &SlopesSeen<'_>, term: &ProductTerm, relief: &Relief) -> DVec3 {
    let mut color = DVec3::ONE;
    if let Some(map) = &term.height {
        color *= if relief.height.deviation > 0.0 { heights.mean(map) } else { map.color(0.0) };
    }
    if !term.slopes.is_empty() {
        color *= slopes.color(&term.slopes, relief);
    }
    for (sum, map) in &term.sums {
        color *= map.mean(&sum_moments(heights, slopes, sum, relief));
    }
    color
}

/// Moments of a weighted sum of standardized drivers: sums of means, and of variances of independent parts.
fn sum_moments(heights: &HeightsSeen, slopes: &SlopesSeen<'_>, terms: &[(Source, f64)], relief: &Relief) -> Normal {
    let (mut mean, mut variance, mut of_heights) = (0.0, 0.0, 0.0);
    let mut across = DVec2::ZERO;
    for (source, weight) in terms {
        match source {
            Source::Place(_) => variance += weight * weight,
            Source::Height { noise } => {
                of_heights += weight;
                variance += (weight * noise).powi(2);
            }
            Source::Slope(SlopeDriver::Along { azimuth }) => {
                let unit = relief.slopes.driver(*azimuth);
                if unit.deviation > 0.0 {
                    across -= DVec2::from_angle(*azimuth) * (weight / unit.deviation);
                    mean -= weight * unit.mean / unit.deviation;
                }
            }
            Source::Slope(SlopeDriver::Steepness) | Source::Sum(_) => {}
        }
    }
    if of_heights != 0.0 && relief.height.deviation > 0.0 {
        let at = heights.moments();
        mean += of_heights * at.mean;
        variance += (of_heights * at.deviation).powi(2);
    }
    if across != DVec2::ZERO {
        let seen = slopes.moments(&relief.slopes);
        mean += seen.mean.dot(across);
        variance += seen.variance_along(across);
    }
    Normal { mean, deviation: variance.max(0.0).sqrt() }
}

impl SlopesSeen<'_> {
    /// The mean of the product of maps of slopes.
    fn color(&self, maps: &[(SlopeDriver, StopMap)], relief: &Relief) -> DVec3 {
        let maps: Vec<(SlopeDriver, StopMap)> =
            maps.iter().map(|(driver, map)| (*driver, in_own_unit(map, Source::Slope(*driver).unit(relief)))).collect();
        let at = |s: DVec2| maps.iter().map(|(driver, map)| map.color(driver.value(s))).product::<DVec3>();
        let slopes = &relief.slopes;
        match self {
            Self::Joint { weight, focus } => joint_mean(slopes, &maps, *focus, *weight, &at),
            Self::Apart(o) => match &maps[..] {
                [(SlopeDriver::Along { azimuth }, map)] => map.mean(&slopes.visible(*o).driver(*azimuth)),
                _ => {
                    let seen = |s: DVec2| DVec3::splat((o.z - s.dot(o.truncate())).max(0.0));
                    joint_mean(slopes, &maps, None, &seen, &at)
                }
            },
        }
    }

    fn moments(&self, slopes: &Slopes) -> Slopes {
        match self {
            Self::Apart(o) => slopes.visible(*o),
            Self::Joint { weight, focus } => {
                slopes.weighted_moments(*focus, &|s| weight(s).element_sum()).unwrap_or(*slopes)
            }
        }
    }
}

/// The map of deviations over the driver's own values.
fn in_own_unit(map: &StopMap, unit: Normal) -> StopMap {
    if unit.deviation > 0.0 {
        map.standardized(-unit.mean / unit.deviation, unit.deviation.recip())
    } else {
        map.standardized(0.0, 0.0)
    }
}

fn joint_mean(
    slopes: &Slopes,
    maps: &[(SlopeDriver, StopMap)],
    focus: Option<Focus>,
    weight: &dyn Fn(DVec2) -> DVec3,
    at: &dyn Fn(DVec2) -> DVec3,
) -> DVec3 {
    if let [(driver, map)] = maps {
        let densities = slopes.weighted(driver, focus, weight);
        // A channel that reflects nothing takes its colour from one that does.
        let any = densities.iter().flatten().next();
        let mean = |k: usize| densities[k].as_ref().or(any).map(|density| map.mean(density)[k]);
        return match (mean(0), mean(1), mean(2)) {
            (Some(r), Some(g), Some(b)) => DVec3::new(r, g, b),
            _ => at(slopes.mean),
        };
    }
    slopes.weighted_color(focus, weight, at).unwrap_or_else(|| at(slopes.mean))
}

/// The mean colour of a texture or noise far away.
fn whole_mean(place: &Arc<PlaceDriver>, map: &StopMap, gaussianize: Gaussianize) -> DVec3 {
    let map = PlaceMap::new(place.clone(), map, gaussianize);
    map.map().mean(&map.whole())
}

/// The colour of the mean of every driver, which mip-mapped drivers have far away.
pub fn naive_color(map: &LayeredMap) -> DVec3 {
    let of_term = |term: &ProductTerm| {
        let maps = term.places.iter().map(|(_, map)| map);
        let maps = maps.chain(&term.height).chain(term.slopes.iter().map(|(_, map)| map));
        let maps = maps.chain(term.sums.iter().map(|(_, map)| map));
        maps.map(|map| map.color(0.0)).product::<DVec3>() * term.factor
    };
    map.terms().iter().map(of_term).sum()
}

/// Returns true if the largest deviation of every driver is below a step of the prefiltered table, so that the naive map
/// is as good.
pub fn is_naive_enough(map: &LayeredMap) -> bool {
    let mapped = map.layers.iter().flat_map(|layer| std::iter::once(&layer.mapped).chain(&layer.blend));
    mapped.into_iter().all(|mapped| {
        let (first, last) = mapped.stops.ends();
        let step = (last - first).max(6.0 * mapped.in_stop_unit(Normal { mean: 0.0, deviation: 1.0 }).deviation)
            / super::MEANS as f64;
        mapped.driver.unit.deviation == 0.0
            || mapped.in_stop_unit(Normal { mean: 0.0, deviation: 1.0 }).deviation() < step
    })
}

#[cfg(test)]
#[path = "filter_tests.rs"]
mod tests;
