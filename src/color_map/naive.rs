//! Colour maps over the means of their drivers, as mip-mapped drivers give them.

use glam::{DVec2, DVec3};

use super::layers::{LayeredMap, ProductTerm, Relief, Source, SurfacePoint};
use super::statistics::Footprint;

/// A colour map that is evaluated at the mean of every driver. The colour of the mean is not the mean of the colours.
#[derive(Debug, Clone)]
pub struct NaiveMap {
    terms: Vec<ProductTerm>,
    relief: Relief,
}

impl NaiveMap {
    pub fn new(map: &LayeredMap) -> Self {
        Self { terms: map.terms(), relief: map.relief }
    }

    /// The colour at a footprint whose mean height [tile units] and mean slope are given.
    pub fn color(&self, footprint: &Footprint, height: f64, slope: DVec2) -> DVec3 {
        let point = SurfacePoint { place: footprint.centre, height, slope };
        let mean = |source: &Source| self.mean(source, footprint, &point);
        let of_term = |term: &ProductTerm| {
            let places = term.places.iter().map(|(place, map)| map.color(place.mean(footprint)));
            let height = term.height.iter().map(|map| map.color(mean(&Source::Height { noise: 0.0 })));
            let slopes = term.slopes.iter().map(|(driver, map)| map.color(mean(&Source::Slope(*driver))));
            let sum = |sum: &[(Source, f64)]| sum.iter().map(|(source, weight)| weight * mean(source)).sum::<f64>();
            let sums = term.sums.iter().map(|(parts, map)| map.color(sum(parts)));
            places.chain(height).chain(slopes).chain(sums).product::<DVec3>() * term.factor
        };
        self.terms.iter().map(of_term).sum::<DVec3>().max(DVec3::ZERO)
    }

    /// The mean of a driver [deviations].
    fn mean(&self, source: &Source, footprint: &Footprint, point: &SurfacePoint) -> f64 {
        match source {
            Source::Place(place) => place.mean(footprint),
            Source::Sum(terms) => terms.iter().map(|(term, weight)| weight * self.mean(term, footprint, point)).sum(),
            _ => source.value(point, &self.relief),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat2;

    use super::super::filter::naive_color;
    use super::super::layers::tests::{RELIEF, resolved};
    use super::*;

    #[test]
    fn a_naive_pixel_has_the_colour_of_its_point_near_and_of_all_means_far_away() {
        let map = resolved(
            "[color_map]\n[[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[-1, [0.1, 0.2, 0.3]], [1, 0.8]]\n\
             [[color_map.layer]]\ndriver = { kind = \"slope\" }\nstops = [[-1, 0], [1, [0, 0.5, 0.2]]]\nweight = 0.5\n",
        );
        let naive = NaiveMap::new(&map);
        let footprint = Footprint { centre: DVec2::splat(0.3), covariance: DMat2::ZERO };
        let point = SurfacePoint { place: footprint.centre, height: 0.31, slope: DVec2::new(0.2, -0.1) };
        let near = naive.color(&footprint, point.height, point.slope);
        assert!((near - map.color(&point).as_dvec3()).abs().max_element() < 1e-6, "{near}");
        let far = naive.color(&footprint, RELIEF.height.mean, RELIEF.slopes.mean);
        assert!((far - naive_color(&map)).abs().max_element() < 1e-9, "{far}");
        assert!((far - near).abs().max_element() > 0.01);
    }
}
