//! The mean colour of what is seen and lit (Heitz et al. 2013, Secs. 5 and 6): one distribution per driver, products of
//! independent ones.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::heights::Largest;
use super::layers::{LayeredMap, ProductTerm, Relief, Source};
use super::slopes::{Focus, SlopeDriver, Slopes};
use super::statistics::{PlaceDriver, PlaceMap};
use super::{Distribution, Normal, Quantiles, StopMap};
use crate::scene::Gaussianize;

/// Distribution of the heights that are seen and lit [deviations].
#[derive(Debug, Clone)]
pub enum HeightsSeen {
    /// D_h itself (Eq. 16).
    Smith(Largest),
    Normal(Normal),
    /// A normal distribution of the ranks of heights, and the way back to heights.
    Ranked(Normal, Arc<Quantiles>),
}

impl HeightsSeen {
    /// The mean of a map of heights.
    pub fn mean(&self, map: &StopMap) -> DVec3 {
        match self {
            Self::Smith(largest) => map.mean(largest),
            Self::Normal(normal) => map.mean(normal),
            Self::Ranked(normal, quantiles) => quantiles.compose(map).mean(normal),
        }
    }

    /// Mean and deviation of the heights.
    pub fn moments(&self) -> Normal {
        match self {
            Self::Smith(largest) => largest.moments(),
            Self::Normal(normal) => *normal,
            Self::Ranked(normal, quantiles) => {
                // Midpoints of equal parts of the normal distribution.
                const PARTS: usize = 256;
                let value = |k: usize| {
                    let z = super::normal::quantile((k as f64 + 0.5) / PARTS as f64);
                    quantiles.value(normal.mean + normal.deviation * z)
                };
                let mean = (0..PARTS).map(value).sum::<f64>() / PARTS as f64;
                let square = (0..PARTS).map(|k| (value(k) - mean).powi(2)).sum::<f64>() / PARTS as f64;
                Normal { mean, deviation: square.sqrt() }
            }
        }
    }
}

/// Weights of slopes.
pub enum SlopesSeen<'a> {
    /// By what is seen, lit and reflected: the density is `p(s) weight(s)`.
    Joint { weight: &'a dyn Fn(DVec2) -> DVec3, focus: Option<Focus> },
    /// By what is seen, apart from light and BRDF (Eqs. 19 and 20); the direction to the viewer.
    Apart(DVec3),
    /// Slopes and weights of facets, where the surface overhangs.
    Facets(&'a [(DVec2, f64)]),
}

/// Everything that the colour of what is seen and lit depends on.
pub struct VisibleValues<'a> {
    pub heights: HeightsSeen,
    pub slopes: SlopesSeen<'a>,
    pub gaussianize: Gaussianize,
}

impl VisibleValues<'_> {
    /// The mean colour of the map.
    pub fn color(&self, map: &LayeredMap) -> DVec3 {
        map.terms().iter().map(|term| self.term(term, &map.relief)).sum()
    }

    fn term(&self, term: &ProductTerm, relief: &Relief) -> DVec3 {
        let mut color = DVec3::splat(term.factor);
        for (place, map) in &term.places {
            color *= whole_mean(place, map, self.gaussianize);
        }
        if let Some(map) = &term.height {
            color *= if relief.height.deviation > 0.0 { self.heights.mean(map) } else { map.color(0.0) };
        }
        if !term.slopes.is_empty() {
            color *= self.slope_color(&term.slopes, relief);
        }
        for (sum, map) in &term.sums {
            color *= map.mean(&self.sum_moments(sum, relief));
        }
        color
    }

    /// The mean of the product of maps of slopes.
    pub fn slope_color(&self, maps: &[(SlopeDriver, StopMap)], relief: &Relief) -> DVec3 {
        let maps: Vec<(SlopeDriver, StopMap)> =
            maps.iter().map(|(driver, map)| (*driver, in_own_unit(map, Source::Slope(*driver).unit(relief)))).collect();
        let at = |s: DVec2| maps.iter().map(|(driver, map)| map.color(driver.value(s))).product::<DVec3>();
        let slopes = &relief.slopes;
        match &self.slopes {
            SlopesSeen::Facets(facets) => {
                let total: f64 = facets.iter().map(|facet| facet.1).sum();
                if total > 0.0 {
                    facets.iter().map(|(s, weight)| at(*s) * *weight).sum::<DVec3>() / total
                } else {
                    at(slopes.mean)
                }
            }
            SlopesSeen::Joint { weight, focus } => joint_mean(slopes, &maps, *focus, *weight, &at),
            SlopesSeen::Apart(o) => match &maps[..] {
                [(SlopeDriver::Along { azimuth }, map)] => map.mean(&slopes.visible(*o).driver(*azimuth)),
                _ => {
                    let seen = |s: DVec2| DVec3::splat((o.z - s.dot(o.truncate())).max(0.0));
                    joint_mean(slopes, &maps, None, &seen, &at)
                }
            },
        }
    }

    /// Moments of a weighted sum of standardized drivers: sums of means, and of variances of independent parts.
    fn sum_moments(&self, terms: &[(Source, f64)], relief: &Relief) -> Normal {
        let (mut mean, mut variance, mut heights) = (0.0, 0.0, 0.0);
        let mut across = DVec2::ZERO;
        for (source, weight) in terms {
            match source {
                Source::Place(_) => variance += weight * weight,
                Source::Height { noise } => {
                    heights += weight;
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
        if heights != 0.0 && relief.height.deviation > 0.0 {
            let at = self.heights.moments();
            mean += heights * at.mean;
            variance += (heights * at.deviation).powi(2);
        }
        if across != DVec2::ZERO {
            let seen = self.slope_moments(&relief.slopes);
            mean += seen.mean.dot(across);
            variance += seen.variance_along(across);
        }
        Normal { mean, deviation: variance.max(0.0).sqrt() }
    }

    fn slope_moments(&self, slopes: &Slopes) -> Slopes {
        match &self.slopes {
            SlopesSeen::Apart(o) => slopes.visible(*o),
            SlopesSeen::Joint { weight, focus } => {
                slopes.weighted_moments(*focus, &|s| weight(s).element_sum()).unwrap_or(*slopes)
            }
            SlopesSeen::Facets(facets) => {
                let total: f64 = facets.iter().map(|facet| facet.1).sum();
                if total <= 0.0 {
                    return *slopes;
                }
                let mean = facets.iter().map(|(s, w)| *s * *w).sum::<DVec2>() / total;
                let second =
                    |f: &dyn Fn(DVec2) -> f64| facets.iter().map(|(s, w)| f(*s - mean) * w).sum::<f64>() / total;
                let covariance = [second(&|d| d.x * d.x), second(&|d| d.x * d.y), second(&|d| d.y * d.y)];
                Slopes { mean, covariance }
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
