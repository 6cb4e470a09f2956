//! The density of slopes weighted by what is visible, lit and reflected: quadrature over slopes.

use glam::{DVec2, DVec3};

use super::Slopes;
use crate::color_map::{Tabulated, normal};

/// A direction in which the slopes' density is narrow: the lobe of a glossy BRDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// Slope of the facets that mirror the light towards the viewer.
    pub slope: DVec2,
    /// Width of the lobe [slope].
    pub width: f64,
}

impl Slopes {
    /// The distribution of `driver` under the density `p(s) weight(s)`, a channel at a time: the weight of a coloured
    /// BRDF differs between channels. `focus` adds nodes where the weight is narrow. `None` for a channel without mass.
    pub fn weighted(
        &self,
        driver: &SlopeDriver,
        focus: Option<Focus>,
        weight: &dyn Fn(DVec2) -> DVec3,
    ) -> [Option<Tabulated>; 3] {
        let frame = Frame::new(self, driver.axis());
        let nodes = frame.nodes(focus);
        match driver {
            SlopeDriver::Along { .. } => {
                let mut densities = [const { Vec::new() }; 3];
                for p in &nodes[0] {
                    let mut sum = DVec3::ZERO;
                    for (q, step) in steps(&nodes[1]) {
                        sum += weight(frame.slope(*p, q)) * (normal::pdf(q) * step);
                    }
                    let sum = sum * normal::pdf(*p);
                    densities.iter_mut().zip(sum.to_array()).for_each(|(density, value)| density.push(value));
                }
                // The driver falls as the slope along the axis rises.
                let deviation = frame.along.max(f64::MIN_POSITIVE);
                let value = |p: &f64| -(frame.mean.x + p * deviation);
                let values: Vec<f64> = nodes[0].iter().rev().map(value).collect();
                densities.map(|density| Tabulated::new(values.clone(), density.into_iter().rev().collect()))
            }
            SlopeDriver::Steepness => self.steepness(focus, weight),
        }
    }

    /// The distribution of |s|: rings about the origin.
    fn steepness(&self, focus: Option<Focus>, weight: &dyn Fn(DVec2) -> DVec3) -> [Option<Tabulated>; 3] {
        const RINGS: usize = 240;
        const ANGLES: usize = 180;
        let [xx, xy, yy] = self.covariance;
        // Slopes that vary less than this along an axis would make the density a line.
        let floor = (1e-6 * (xx + yy)).max(1e-18);
        let (xx, yy) = (xx + floor, yy + floor);
        let determinant = (xx * yy - xy * xy).max(floor * floor);
        let reach = self.mean.length() + 5.0 * (xx + yy).sqrt();
        let mut radii: Vec<f64> = (0..=RINGS).map(|k| reach * k as f64 / RINGS as f64).collect();
        if let Some(Focus { slope, width }) = focus {
            radii.extend((-30..=30).map(|k| slope.length() + 0.15 * f64::from(k) * width));
        }
        radii.retain(|r| (0.0..=reach).contains(r));
        radii.sort_by(f64::total_cmp);
        radii.dedup();
        let mut densities = [const { Vec::new() }; 3];
        for &r in &radii {
            let mut sum = DVec3::ZERO;
            for k in 0..ANGLES {
                let s = DVec2::from_angle(std::f64::consts::TAU * k as f64 / ANGLES as f64) * r;
                let d = s - self.mean;
                let square = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / determinant;
                sum += weight(s) * (r * (-0.5 * square).exp());
            }
            densities.iter_mut().zip(sum.to_array()).for_each(|(density, value)| density.push(value));
        }
        densities.map(|density| Tabulated::new(radii.clone(), density))
    }

    /// Mean and covariance of the slopes under the density `p(s) weight(s)`; `None` if it has no mass.
    pub fn weighted_moments(&self, focus: Option<Focus>, weight: &dyn Fn(DVec2) -> f64) -> Option<Self> {
        let mut sums = [0.0; 6];
        self.each_node(focus, &mut |s, w| {
            let w = w * weight(s);
            for (sum, value) in sums.iter_mut().zip([1.0, s.x, s.y, s.x * s.x, s.x * s.y, s.y * s.y]) {
                *sum += w * value;
            }
        });
        let [mass, x, y, xx, xy, yy] = sums;
        if !(mass > 0.0 && mass.is_finite()) {
            return None;
        }
        let (x, y) = (x / mass, y / mass);
        let covariance = [(xx / mass - x * x).max(0.0), xy / mass - x * y, (yy / mass - y * y).max(0.0)];
        Some(Self { mean: DVec2::new(x, y), covariance })
    }

    /// The mean of a colour over the density `p(s) weight(s)`, for maps of several slope drivers at once. Jumps blur over
    /// a step of the quadrature. `None` if the density has no mass.
    pub fn weighted_color(
        &self,
        focus: Option<Focus>,
        weight: &dyn Fn(DVec2) -> DVec3,
        color: &dyn Fn(DVec2) -> DVec3,
    ) -> Option<DVec3> {
        let (mut sum, mut mass) = (DVec3::ZERO, DVec3::ZERO);
        self.each_node(focus, &mut |s, w| {
            let w = weight(s) * w;
            mass += w;
            sum += w * color(s);
        });
        (mass.min_element() > 0.0 && mass.is_finite()).then(|| sum / mass)
    }

    fn each_node(&self, focus: Option<Focus>, visit: &mut dyn FnMut(DVec2, f64)) {
        let frame = Frame::new(self, DVec2::X);
        let nodes = frame.nodes(focus);
        for (p, across) in steps(&nodes[0]) {
            for (q, along) in steps(&nodes[1]) {
                visit(frame.slope(p, q), normal::pdf(p) * normal::pdf(q) * across * along);
            }
        }
    }
}

/// Drivers that are functions of the slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlopeDriver {
    /// `-∂h/∂a` along an azimuth [rad].
    Along { azimuth: f64 },
    /// |s|.
    Steepness,
}

impl SlopeDriver {
    fn axis(&self) -> DVec2 {
        match self {
            Self::Along { azimuth } => DVec2::from_angle(*azimuth),
            Self::Steepness => DVec2::X,
        }
    }

    /// The driver's value at a slope.
    pub fn value(&self, s: DVec2) -> f64 {
        match self {
            Self::Along { .. } => -s.dot(self.axis()),
            Self::Steepness => s.length(),
        }
    }
}

/// Slopes as functions of two independent standard normals p and q; p is the slope along an axis.
struct Frame {
    axis: DVec2,
    /// Mean along the axis and across it.
    mean: DVec2,
    along: f64,
    shear: f64,
    across: f64,
}

impl Frame {
    fn new(slopes: &Slopes, axis: DVec2) -> Self {
        let side = axis.perp();
        let along = slopes.variance_along(axis).sqrt();
        let shear = if along > 0.0 { slopes.times(axis).dot(side) / along } else { 0.0 };
        let across = (slopes.variance_along(side) - shear * shear).max(0.0).sqrt();
        Self { axis, mean: DVec2::new(slopes.mean.dot(axis), slopes.mean.dot(side)), along, shear, across }
    }

    fn slope(&self, p: f64, q: f64) -> DVec2 {
        let (x, y) = (self.mean.x + self.along * p, self.mean.y + self.shear * p + self.across * q);
        self.axis * x + self.axis.perp() * y
    }

    /// Nodes of p and q: even to five deviations, and dense where a lobe is narrow.
    fn nodes(&self, focus: Option<Focus>) -> [Vec<f64>; 2] {
        const REACH: f64 = 5.2;
        let even = |count: i32| (-count..=count).map(|k| REACH * f64::from(k) / f64::from(count)).collect::<Vec<_>>();
        let mut nodes = [even(64), even(32)];
        if let Some(Focus { slope, width }) = focus {
            let p = (slope.dot(self.axis) - self.mean.x) / self.along.max(f64::MIN_POSITIVE);
            let q = (slope.dot(self.axis.perp()) - self.mean.y - self.shear * p) / self.across.max(f64::MIN_POSITIVE);
            for (nodes, (centre, scale)) in nodes.iter_mut().zip([(p, self.along), (q, self.across)]) {
                let step = 0.16 * width / scale.max(f64::MIN_POSITIVE);
                if step < REACH / 32.0 {
                    nodes.extend((-24..=24).map(|k| centre + step * f64::from(k)));
                    nodes.retain(|node| node.abs() <= REACH);
                    nodes.sort_by(f64::total_cmp);
                    nodes.dedup();
                }
            }
        }
        nodes
    }
}

/// Nodes with the weights of the trapezoidal rule.
fn steps(nodes: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    (0..nodes.len()).map(|k| (nodes[k], 0.5 * (nodes[(k + 1).min(nodes.len() - 1)] - nodes[k.saturating_sub(1)])))
}

#[cfg(test)]
pub(super) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::direction;
    use super::*;
    use crate::color_map::Distribution;
    use crate::color_map::stops::tests::map;

    pub(in super::super) const GENERAL: Slopes =
        Slopes { mean: DVec2::new(0.15, -0.1), covariance: [0.09, 0.03, 0.05] };

    pub(in super::super) fn sample(slopes: &Slopes, random: &mut ChaCha8Rng) -> DVec2 {
        let mut draw = || normal::quantile(random.random::<f64>().max(1e-300));
        Frame::new(slopes, DVec2::X).slope(draw(), draw())
    }

    #[test]
    fn directions_of_visible_slopes_pass_the_chi_squared_test_at_one_percent() {
        let slopes = Slopes { mean: DVec2::ZERO, covariance: [0.12, 0.0, 0.12] };
        let o = direction(75_f64.to_radians(), 0.3);
        let weight = |s: DVec2| DVec3::splat((o.z - s.dot(o.truncate())).max(0.0));
        let [Some(density), ..] = slopes.weighted(&SlopeDriver::Along { azimuth: 0.3 }, None, &weight) else {
            panic!("no mass");
        };
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let edges: Vec<f64> = (-3..=5).map(|k| 0.2 * f64::from(k)).collect();
        let mut counts = vec![0.0; edges.len() + 1];
        let draws = 40_000;
        let mut taken = 0;
        while taken < draws {
            let s = sample(&slopes, &mut random);
            // Rejection: slopes beyond five deviations do not occur.
            if random.random::<f64>() * (o.z + 1.8) < (o.z - s.dot(o.truncate())).max(0.0) {
                let v = SlopeDriver::Along { azimuth: 0.3 }.value(s);
                counts[edges.partition_point(|edge| *edge <= v)] += 1.0;
                taken += 1;
            }
        }
        let tails: Vec<f64> = std::iter::once(1.0).chain(edges.iter().map(|v| density.tail(*v))).chain([0.0]).collect();
        let mut chi = 0.0;
        let mut cells = 0;
        for (count, tail) in counts.iter().zip(tails.windows(2)) {
            let expected = (tail[0] - tail[1]) * f64::from(draws);
            if expected > 5.0 {
                chi += (count - expected).powi(2) / expected;
                cells += 1;
            }
        }
        // 99 % of chi squared with up to 9 degrees of freedom lies below 21.7.
        assert!(chi < 21.7 && cells > 5, "{chi} of {cells}");
    }

    #[test]
    fn the_joint_density_of_slopes_gives_the_color_that_samples_have_along_any_azimuth_and_by_steepness() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let (i, o) = (direction(0.9, 2.0), direction(1.2, 0.4));
        let weight = |s: DVec2| {
            let n = 1.0 / (1.0 + s.length_squared()).sqrt();
            DVec3::splat((o.z - s.dot(o.truncate())).max(0.0) * (i.z - s.dot(i.truncate())).max(0.0) * n)
        };
        for driver in [SlopeDriver::Along { azimuth: 0.4 }, SlopeDriver::Along { azimuth: 2.0 }, SlopeDriver::Steepness]
        {
            let map = map("bands").standardized(0.0, 4.0);
            let (mut sum, mut mass, mut square) = (DVec3::ZERO, 0.0, 0.0);
            for _ in 0..400_000 {
                let s = sample(&GENERAL, &mut random);
                let w = weight(s).x;
                sum += map.color(driver.value(s)) * w;
                mass += w;
                square += w * w;
            }
            let error = square.sqrt() / mass;
            let [Some(density), ..] = GENERAL.weighted(&driver, None, &weight) else { panic!("no mass") };
            let ours = map.mean(&density);
            assert!((ours - sum / mass).abs().max_element() < 4.0 * error, "{driver:?}: {ours} {}", sum / mass);
            let pointwise = GENERAL.weighted_color(None, &weight, &|s| map.color(driver.value(s))).unwrap();
            assert!((ours - pointwise).abs().max_element() < 0.02, "{driver:?}: {ours} {pointwise}");
        }
    }
}
