//! Values made normal by their ranks, so that two moments describe them (after Heitz and Neyret 2018).

use super::normal;
use super::stops::{Stop, StopMap};

/// Knots of the way back from normal values.
const KNOTS: usize = 1024;
/// Error of the map that simplification may add.
const TOLERANCE: f64 = 2e-4;

/// The normal value of each value by its rank among all. Equal values get the mean of their ranks, so that a constant
/// field is 0 everywhere.
pub fn gaussianize(values: &[f32]) -> Vec<f32> {
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    order.sort_unstable_by(|a, b| values[*a as usize].total_cmp(&values[*b as usize]));
    let mut ranked = vec![0.0; values.len()];
    let mut start = 0;
    while start < order.len() {
        let value = values[order[start] as usize];
        let run = order[start..].partition_point(|k| values[*k as usize].total_cmp(&value).is_le());
        let middle = (start as f64 + 0.5 * run as f64) / values.len() as f64;
        let normal = normal::quantile(middle) as f32;
        order[start..start + run].iter().for_each(|k| ranked[*k as usize] = normal);
        start += run;
    }
    ranked
}

/// The way back: a rising, piecewise linear function from a standard normal value to the value of the same quantile.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantiles {
    /// Normal value and value at each knot.
    knots: Vec<[f64; 2]>,
}

impl Quantiles {
    /// Quantiles of values with weights, which are not negative. Without weight, everything is 0.
    pub fn new(mut weighted: Vec<(f32, f32)>) -> Self {
        weighted.retain(|(value, weight)| value.is_finite() && *weight > 0.0);
        weighted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = weighted.iter().map(|(_, weight)| f64::from(*weight)).sum();
        let most = normal::quantile(1.0 - 0.5 / weighted.len().max(2) as f64);
        let mut below = 0.0;
        let mut at = 0;
        let knot = |k: usize| {
            let z = most * (2.0 * k as f64 / (KNOTS - 1) as f64 - 1.0);
            let wanted = normal::cdf(z) * total;
            // Between the middles of two neighbours, values are interpolated.
            let middle = |at: usize, below: f64| below + 0.5 * f64::from(weighted[at].1);
            while at < weighted.len() && middle(at, below) < wanted {
                below += f64::from(weighted[at].1);
                at += 1;
            }
            let value = match (at.checked_sub(1).map(|last| weighted[last]), weighted.get(at)) {
                (None, None) => 0.0,
                (None, Some((value, _))) => f64::from(*value),
                (Some((value, _)), None) => f64::from(value),
                (Some((low, weight)), Some((high, next))) => {
                    let first = below - 0.5 * f64::from(weight);
                    let span = 0.5 * (f64::from(weight) + f64::from(*next));
                    let part = ((wanted - first) / span).clamp(0.0, 1.0);
                    f64::from(low) + part * (f64::from(*high) - f64::from(low))
                }
            };
            [z, value]
        };
        Self { knots: (0..KNOTS).map(knot).collect() }
    }

    /// The value of a normal value; constant beyond the ends.
    pub fn value(&self, z: f64) -> f64 {
        let next = self.knots.partition_point(|knot| knot[0] <= z);
        match (next.checked_sub(1).map(|k| self.knots[k]), self.knots.get(next)) {
            (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (z - a[0]) / (b[0] - a[0]),
            (Some(knot), None) => knot[1],
            (None, Some(knot)) => knot[1],
            (None, None) => 0.0,
        }
    }

    /// The map of a value as a map of its normal value. The jumps stay jumps; stops that change less than 2e-4 are left
    /// out.
    pub fn compose(&self, map: &StopMap) -> StopMap {
        let first = self.knots[0];
        let mut stops = vec![Stop { value: first[0], color: map.color(first[1]) }];
        for pair in self.knots.windows(2) {
            let [[z0, f0], [z1, f1]] = [pair[0], pair[1]];
            let inside = map.stops().iter().filter(|stop| stop.value > f0 && stop.value <= f1);
            for stop in inside {
                let value = z0 + (z1 - z0) * (stop.value - f0) / (f1 - f0);
                stops.push(Stop { value, color: stop.color });
            }
            stops.push(Stop { value: z1, color: map.color(f1) });
        }
        StopMap::new(simplified(&stops))
    }
}

/// Leaves out stops that lie on the line between their neighbours. Ends of jumps are kept.
fn simplified(stops: &[Stop]) -> Vec<Stop> {
    let mut kept: Vec<Stop> = Vec::new();
    let mut anchor = 0;
    let fits = |from: usize, to: usize| {
        let (a, b) = (stops[from], stops[to]);
        b.value > a.value
            && stops[from..to].iter().skip(1).all(|stop| {
                let line = a.color.lerp(b.color, (stop.value - a.value) / (b.value - a.value));
                (stop.color - line).abs().max_element() < TOLERANCE
            })
    };
    if let Some(first) = stops.first() {
        kept.push(*first);
    }
    for k in 1..stops.len() {
        let is_jump = stops[k].value <= stops[k - 1].value;
        if is_jump || !fits(anchor, k) {
            if k - 1 != anchor {
                kept.push(stops[k - 1]);
            }
            anchor = k - 1;
            if is_jump {
                kept.push(stops[k]);
                anchor = k;
            }
        }
    }
    if let Some(last) = stops.last().filter(|last| kept.last() != Some(last)) {
        kept.push(*last);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::Normal;
    use super::super::stops::tests::{MAPS, map};
    use super::*;

    /// Quantiles of four kinds of data, none of them normal.
    fn data() -> Vec<Vec<f32>> {
        let z = |k: usize| normal::quantile((k as f64 + 0.5) / 5000.0);
        let of = |f: &dyn Fn(f64) -> f64| (0..5000).map(|k| f(z(k)) as f32).collect::<Vec<_>>();
        vec![of(&|z| z.abs()), of(&|z| (3.0 * z).tanh()), of(&|z| (0.8 * z).exp() - 1.4), of(&|z| (z > 0.6).into())]
    }

    #[test]
    fn the_map_of_ranks_under_a_standard_normal_is_the_plain_mean_of_the_colours() {
        for (kind, values) in data().into_iter().enumerate() {
            let quantiles = Quantiles::new(values.iter().map(|value| (*value, 1.0)).collect());
            for name in MAPS {
                let composed = quantiles.compose(&map(name));
                let ours = composed.mean(&Normal { mean: 0.0, deviation: 1.0 });
                let plain: glam::DVec3 =
                    values.iter().map(|value| map(name).color(f64::from(*value))).sum::<glam::DVec3>() / 5000.0;
                assert!((ours - plain).abs().max_element() < 0.004, "data {kind}, {name}: {ours} {plain}");
            }
        }
    }

    #[test]
    fn ranks_keep_the_order_have_deviation_one_and_give_ties_their_mean() {
        let ranked = gaussianize(&data()[2]);
        assert!(ranked.is_sorted());
        let square: f64 = ranked.iter().map(|z| f64::from(*z).powi(2)).sum::<f64>() / 5000.0;
        assert!((square - 1.0).abs() < 0.01);
        assert_eq!(gaussianize(&[3.0; 7]), [0.0; 7]);
        let two = gaussianize(&[0.0, 1.0, 0.0, 0.0]);
        assert!(two[0] == two[2] && two[2] == two[3] && (f64::from(two[0]) - normal::quantile(0.375)).abs() < 1e-6);
        assert!(gaussianize(&[]).is_empty());
        assert_eq!(Quantiles::new(Vec::new()).value(0.3), 0.0);
        assert_eq!(Quantiles::new(vec![(5.0, 1.0)]).value(-2.0), 5.0);
    }
}
