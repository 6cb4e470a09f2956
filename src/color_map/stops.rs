//! Colour maps as gradient stops, and their mean under a distribution (Heitz et al. 2013, Eq. 8).

use glam::{DVec3, Vec3};

use super::Distribution;

/// A stop: a value of the driver and the colour there, linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    pub value: f64,
    pub color: DVec3,
}

/// A colour map: piecewise linear between stops of ascending values, constant beyond the first and the last. Two stops
/// of one value are a jump, at which the map has the colour of the later stop.
#[derive(Debug, Clone, PartialEq)]
pub struct StopMap {
    stops: Vec<Stop>,
    /// Smallest and largest colour of each channel.
    range: (DVec3, DVec3),
}

/// A ramp shorter than this multiple of the deviation counts as a jump in its middle. The mean differs by less than
/// 1e-10, while the difference of two ramps would lose more to rounding.
const SHORT: f64 = 1e-5;
/// Largest error of a product of two maps, which is quadratic between its stops and stored as ramps.
const PRODUCT_ERROR: f64 = 5e-4;

impl StopMap {
    /// A map of ascending stops. A map without stops is white.
    pub fn new(mut stops: Vec<Stop>) -> Self {
        debug_assert!(stops.windows(2).all(|pair| pair[0].value <= pair[1].value), "stops must ascend");
        if stops.is_empty() {
            stops.push(Stop { value: 0.0, color: DVec3::ONE });
        }
        let low = stops.iter().fold(DVec3::INFINITY, |low, stop| low.min(stop.color));
        let high = stops.iter().fold(DVec3::NEG_INFINITY, |high, stop| high.max(stop.color));
        Self { stops, range: (low, high) }
    }

    pub fn stops(&self) -> &[Stop] {
        &self.stops
    }

    /// Values of the first and the last stop.
    pub fn ends(&self) -> (f64, f64) {
        (self.stops[0].value, self.stops[self.stops.len() - 1].value)
    }

    /// The colour at a value.
    pub fn color(&self, value: f64) -> DVec3 {
        let next = self.stops.partition_point(|stop| stop.value <= value);
        let (Some(high), Some(low)) = (self.stops.get(next), next.checked_sub(1).map(|k| self.stops[k])) else {
            return self.stops[next.min(self.stops.len() - 1)].color;
        };
        low.color.lerp(high.color, (value - low.value) / (high.value - low.value))
    }

    /// The colour just below a value: the left limit at a jump.
    fn color_below(&self, value: f64) -> DVec3 {
        let next = self.stops.partition_point(|stop| stop.value < value);
        let (Some(high), Some(low)) = (self.stops.get(next), next.checked_sub(1).map(|k| self.stops[k])) else {
            return self.stops[next.min(self.stops.len() - 1)].color;
        };
        low.color.lerp(high.color, (value - low.value) / (high.value - low.value))
    }

    /// The mean of the map under a distribution, in closed form: `C = c₀ + Σ Δₖ wₖ`, where `wₖ` is P(X ≥ v) for a jump
    /// and the mean of the clamped position within the segment for a ramp. The weights fall from 1 to 0, so that the
    /// result is a convex combination of the stops' colours.
    pub fn mean(&self, distribution: &impl Distribution) -> DVec3 {
        let mut color = self.stops[0].color;
        let mut most = 1.0;
        let mut last: Option<(f64, f64)> = None;
        let short = SHORT * distribution.deviation();
        let mut ramp_at = |v: f64| match last {
            Some((at, ramp)) if at == v => ramp,
            _ => {
                let ramp = distribution.ramp(v);
                last = Some((v, ramp));
                ramp
            }
        };
        for pair in self.stops.windows(2) {
            let step = pair[1].color - pair[0].color;
            if step == DVec3::ZERO {
                continue;
            }
            let (from, to) = (pair[0].value, pair[1].value);
            let weight = if to - from <= short || to == from {
                distribution.tail(0.5 * (from + to))
            } else {
                let first = ramp_at(from);
                (first - ramp_at(to)) / (to - from)
            };
            most = if weight > 0.0 { weight.min(most) } else { 0.0 };
            color += step * most;
        }
        color.clamp(self.range.0, self.range.1)
    }

    /// The same map over `(value - offset) / scale`. A scale that is not positive gives the constant map of the colour at
    /// `offset`.
    pub fn standardized(&self, offset: f64, scale: f64) -> Self {
        if !(scale > 0.0 && scale.is_finite()) {
            return Self::new(vec![Stop { value: 0.0, color: self.color(offset) }]);
        }
        let moved = |stop: &Stop| Stop { value: (stop.value - offset) / scale, color: stop.color };
        Self::new(self.stops.iter().map(moved).collect())
    }

    /// The map with every colour multiplied by a number.
    pub fn times(&self, factor: f64) -> Self {
        Self::new(self.stops.iter().map(|stop| Stop { color: stop.color * factor, ..*stop }).collect())
    }

    /// The sum of two maps of one driver.
    pub fn plus(&self, other: &Self) -> Self {
        self.combined(other, |a, b| a + b, |_, _| 1)
    }

    /// The product of two maps of one driver. Between stops it is quadratic and stored as ramps, within 5e-4 of the
    /// largest colour.
    pub fn product(&self, other: &Self) -> Self {
        let largest = (self.range.1 * other.range.1).max_element().max(f64::MIN_POSITIVE);
        let parts = |a: DVec3, b: DVec3| {
            let bend = (a * b).abs().max_element() / (4.0 * PRODUCT_ERROR * largest);
            (bend.sqrt().ceil() as usize).clamp(1, 64)
        };
        self.combined(other, |a, b| a * b, parts)
    }

    /// Combines two maps at all of their stops. `parts` is the number of ramps between two stops, given the changes of
    /// both maps.
    fn combined(
        &self,
        other: &Self,
        combine: impl Fn(DVec3, DVec3) -> DVec3,
        parts: impl Fn(DVec3, DVec3) -> usize,
    ) -> Self {
        let mut values: Vec<f64> = self.stops.iter().chain(&other.stops).map(|stop| stop.value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let mut stops = Vec::with_capacity(2 * values.len());
        for (k, &value) in values.iter().enumerate() {
            let below = combine(self.color_below(value), other.color_below(value));
            let at = combine(self.color(value), other.color(value));
            if below != at {
                stops.push(Stop { value, color: below });
            }
            stops.push(Stop { value, color: at });
            let Some(&next) = values.get(k + 1) else { continue };
            let (a, b) = ([self.color(value), self.color_below(next)], [other.color(value), other.color_below(next)]);
            let count = parts(a[1] - a[0], b[1] - b[0]);
            for part in 1..count {
                let t = part as f64 / count as f64;
                let color = combine(a[0].lerp(a[1], t), b[0].lerp(b[1], t));
                stops.push(Stop { value: value + t * (next - value), color });
            }
        }
        Self::new(stops)
    }

    /// The map convolved with a normal distribution, as ramps: what the map of a value plus independent noise is on
    /// average.
    pub fn blurred(&self, deviation: f64) -> Self {
        const PER_DEVIATION: f64 = 16.0;
        let (first, last) = self.ends();
        // So many stops resolve the noise; more of them would only repeat a map that is wide against it.
        let (low, high) = (first - 5.0 * deviation, last + 5.0 * deviation);
        let count = ((high - low) / deviation * PER_DEVIATION).ceil();
        if !(deviation > 0.0 && count.is_finite() && count <= 16_384.0) {
            return self.clone();
        }
        let at = |k: usize| {
            let value = low + (high - low) * k as f64 / count;
            Stop { value, color: self.mean(&super::Normal { mean: value, deviation }) }
        };
        Self::new((0..=count as usize).map(at).collect())
    }

    /// The largest colour of each channel.
    pub fn max(&self) -> Vec3 {
        self.range.1.as_vec3()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::{Normal, normal};
    use super::*;

    /// The maps of the measurements: a smooth ramp, four hard bands and a thin line.
    pub(crate) fn map(name: &str) -> StopMap {
        let rows: &[(f64, [f64; 3])] = match name {
            "ramp" => &[(-2.0, [0.05, 0.05, 0.2]), (0.0, [0.1, 0.5, 0.1]), (2.0, [1.0, 0.95, 0.8])],
            "bands" => &[
                (-1.2, [0.6, 0.3, 0.1]),
                (-1.2, [0.05, 0.05, 0.05]),
                (-0.4, [0.05, 0.05, 0.05]),
                (-0.4, [0.9, 0.8, 0.2]),
                (0.3, [0.9, 0.8, 0.2]),
                (0.3, [0.1, 0.4, 0.7]),
                (1.0, [0.1, 0.4, 0.7]),
                (1.0, [0.95, 0.95, 0.95]),
            ],
            _ => &[
                (0.45, [0.02, 0.02, 0.02]),
                (0.5, [1.0, 0.3, 0.05]),
                (0.6, [1.0, 0.3, 0.05]),
                (0.65, [0.02, 0.02, 0.02]),
            ],
        };
        StopMap::new(rows.iter().map(|(value, color)| Stop { value: *value, color: DVec3::from(*color) }).collect())
    }

    pub(crate) const MAPS: [&str; 3] = ["ramp", "bands", "line"];

    /// The mean by quadrature with nodes at the stops, so that jumps are exact.
    pub(crate) fn by_quadrature(map: &StopMap, mean: f64, deviation: f64) -> DVec3 {
        let ends = (mean - 9.0 * deviation, mean + 9.0 * deviation);
        let mut cuts: Vec<f64> = map.stops().iter().map(|stop| stop.value.clamp(ends.0, ends.1)).collect();
        cuts.extend([ends.0, ends.1, mean]);
        cuts.sort_by(f64::total_cmp);
        let mut sum = DVec3::ZERO;
        for cut in cuts.windows(2) {
            let h = (cut[1] - cut[0]) / 2000.0;
            for k in 0..2000 {
                let x = cut[0] + h * (f64::from(k) + 0.5);
                sum += map.color(x) * normal::pdf((x - mean) / deviation) * h / deviation;
            }
        }
        sum
    }

    #[test]
    fn the_closed_form_of_every_map_agrees_with_quadrature_to_1e_5() {
        for name in MAPS {
            for (mean, deviation) in [(-0.7, 0.2), (0.3, 1.0), (1.2, 0.05), (0.0, 30.0), (0.55, 1e-3)] {
                let ours = map(name).mean(&Normal { mean, deviation });
                let exact = by_quadrature(&map(name), mean, deviation);
                assert!((ours - exact).abs().max_element() < 1e-6, "{name} {mean} {deviation}: {ours} {exact}");
            }
        }
    }

    #[test]
    fn a_point_distribution_is_the_map_itself_and_at_a_jump_the_colour_of_the_right_side() {
        for name in MAPS {
            for value in [-9.0, -1.2, -0.4, 0.0, 0.3, 0.47, 0.5, 1.0, 1e9] {
                let ours = map(name).mean(&Normal { mean: value, deviation: 0.0 });
                assert!((ours - map(name).color(value)).abs().max_element() < 1e-12, "{name} {value}");
            }
        }
        assert_eq!(map("bands").color(0.3), DVec3::new(0.1, 0.4, 0.7));
    }

    #[test]
    fn means_stay_between_the_colours_of_the_stops_for_any_stops_mean_and_deviation() {
        let stop = |value: f64, c: f64| Stop { value, color: DVec3::new(c, 1.0 - c, 0.5) };
        let maps = [
            StopMap::new(vec![stop(0.0, 0.3)]),
            StopMap::new(vec![stop(1.0, 0.0), stop(1.0, 1.0), stop(1.0, 0.2)]),
            StopMap::new(vec![stop(0.0, 0.0), stop(1e-12, 1.0)]),
            StopMap::new(vec![stop(-1e9, 0.0), stop(1e9, 1.0)]),
            StopMap::new((0..256).map(|k| stop(f64::from(k) / 50.0, f64::from(k % 7) / 6.0)).collect()),
        ];
        for map in &maps {
            for mean in [-1e6, -1.0, 0.0, 1e-13, 1.0, 2.5, 1e6] {
                for deviation in [0.0, 1e-300, 1e-9, 1e-3, 1.0, 1e6] {
                    let color = map.mean(&Normal { mean, deviation });
                    let (low, high) = map.range;
                    assert!(color.cmpge(low).all() && color.cmple(high).all(), "{mean} {deviation} {color}");
                }
            }
        }
    }

    #[test]
    fn sums_and_products_of_maps_are_those_of_their_colours_jumps_included() {
        let (a, b) = (map("bands"), map("ramp").standardized(0.1, 0.7));
        let (sum, product) = (a.plus(&b), a.product(&b));
        let square = b.product(&b);
        for k in 0..4000 {
            let v = -4.0 + 0.002 * f64::from(k);
            assert!((sum.color(v) - a.color(v) - b.color(v)).abs().max_element() < 1e-9);
            assert!((product.color(v) - a.color(v) * b.color(v)).abs().max_element() < 1e-3, "{v}");
            assert!((square.color(v) - b.color(v) * b.color(v)).abs().max_element() < 1e-3, "{v}");
        }
    }

    #[test]
    fn blurring_a_map_adds_the_variance_of_the_noise() {
        for name in MAPS {
            let ours = map(name).blurred(0.4).mean(&Normal { mean: 0.2, deviation: 0.3 });
            let exact = map(name).mean(&Normal { mean: 0.2, deviation: 0.5 });
            assert!((ours - exact).abs().max_element() < 1e-3, "{name}: {ours} {exact}");
        }
    }
}
