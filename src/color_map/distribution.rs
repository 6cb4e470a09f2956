//! Distributions of a driver, as colour maps need them: the tail and the integral of the tail.

use super::normal;

/// A distribution of real values. A colour map needs only its tail and the integral of its tail, because a map is a
/// sum of jumps and ramps ([`super::StopMap::mean`]).
pub trait Distribution {
    /// P(X ≥ v).
    fn tail(&self, v: f64) -> f64;
    /// E (X - v)+ = ∫ P(X ≥ x) dx over x ≥ v.
    fn ramp(&self, v: f64) -> f64;
    /// The length below which a ramp of the map counts as a jump, relative to which rounding is judged.
    fn deviation(&self) -> f64;
}

/// A normal distribution. A deviation of 0 is a single point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normal {
    pub mean: f64,
    pub deviation: f64,
}

impl Distribution for Normal {
    fn tail(&self, v: f64) -> f64 {
        if self.deviation > 0.0 {
            normal::cdf((self.mean - v) / self.deviation)
        } else {
            f64::from(u8::from(self.mean >= v))
        }
    }

    fn ramp(&self, v: f64) -> f64 {
        let above = self.mean - v;
        if self.deviation > 0.0 { self.deviation * normal::ramp(above / self.deviation) } else { above.max(0.0) }
    }

    fn deviation(&self) -> f64 {
        self.deviation
    }
}

/// A distribution given by a density at increasing nodes, linear between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Tabulated {
    nodes: Vec<f64>,
    density: Vec<f64>,
    /// Tail and ramp at each node.
    tails: Vec<f64>,
    ramps: Vec<f64>,
    mean: f64,
    deviation: f64,
}

impl Tabulated {
    /// Normalizes a density that is not negative. `None` if it has no mass or is not finite.
    pub fn new(nodes: Vec<f64>, mut density: Vec<f64>) -> Option<Self> {
        let count = nodes.len();
        if count < 2 || density.len() != count {
            return None;
        }
        let segment = |k: usize, density: &[f64]| {
            let h = nodes[k + 1] - nodes[k];
            let (a, b) = (density[k], density[k + 1]);
            // Mass, and the moments about the segment's first node.
            (h * (a + b) / 2.0, h * h * (a + 2.0 * b) / 6.0, h * h * h * (a + 3.0 * b) / 12.0)
        };
        let mass: f64 = (0..count - 1).map(|k| segment(k, &density).0).sum();
        if !(mass > 0.0 && mass.is_finite()) {
            return None;
        }
        density.iter_mut().for_each(|density| *density /= mass);
        let (mut tails, mut ramps) = (vec![0.0; count], vec![0.0; count]);
        let (mut first, mut second) = (0.0, 0.0);
        for k in (0..count - 1).rev() {
            let (mass, moment, square) = segment(k, &density);
            tails[k] = tails[k + 1] + mass;
            ramps[k] = ramps[k + 1] + tails[k + 1] * (nodes[k + 1] - nodes[k]) + moment;
            // Moments about the first node of all keep small numbers small.
            let offset = nodes[k] - nodes[0];
            first += offset * mass + moment;
            second += offset * offset * mass + 2.0 * offset * moment + square;
        }
        let (mean, deviation) = (nodes[0] + first, (second - first * first).max(0.0).sqrt());
        Some(Self { nodes, density, tails, ramps, mean, deviation })
    }

    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Values from `v` to the end of its segment: the mass, and the ramp from `v`.
    fn rest(&self, v: f64) -> Option<(usize, f64, f64)> {
        let k = self.nodes.partition_point(|node| *node <= v).checked_sub(1)?;
        if k + 1 >= self.nodes.len() {
            return Some((k, 0.0, 0.0));
        }
        let (left, right) = (self.nodes[k], self.nodes[k + 1]);
        let slope = (self.density[k + 1] - self.density[k]) / (right - left);
        let (h, a, b) = (right - v, self.density[k] + slope * (v - left), self.density[k + 1]);
        Some((k, h * (a + b) / 2.0, self.tails[k + 1] * h + h * h * (a + 2.0 * b) / 6.0))
    }
}

impl Distribution for Tabulated {
    fn tail(&self, v: f64) -> f64 {
        match self.rest(v) {
            None => 1.0,
            Some((k, mass, _)) => mass + self.tails.get(k + 1).copied().unwrap_or(0.0),
        }
    }

    fn ramp(&self, v: f64) -> f64 {
        match self.rest(v) {
            None => self.mean - v,
            Some((k, _, ramp)) => ramp + self.ramps.get(k + 1).copied().unwrap_or(0.0),
        }
    }

    fn deviation(&self) -> f64 {
        self.deviation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tabulated_normal_density_has_the_tails_ramps_and_moments_of_the_normal_distribution() {
        let nodes: Vec<f64> = (0..2001).map(|k| 3.0 + 0.5 * (f64::from(k) / 100.0 - 10.0)).collect();
        let density = nodes.iter().map(|x| 7.0 * normal::pdf((x - 3.0) / 0.5)).collect();
        let (table, exact) = (Tabulated::new(nodes, density).unwrap(), Normal { mean: 3.0, deviation: 0.5 });
        assert!((table.mean() - 3.0).abs() < 1e-9 && (table.deviation() - 0.5).abs() < 1e-5);
        for k in 0..400 {
            let v = 0.5 + 0.0137 * f64::from(k);
            assert!((table.tail(v) - exact.tail(v)).abs() < 1e-5, "{v}");
            assert!((table.ramp(v) - exact.ramp(v)).abs() < 1e-5, "{v}");
        }
        assert!(Tabulated::new(vec![0.0, 1.0], vec![0.0, 0.0]).is_none());
    }
}
