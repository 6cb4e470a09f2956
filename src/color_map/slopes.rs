//! Slopes that are seen and lit on a surface with Gaussian slopes (Heitz et al. 2013, Sec. 5.2).

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::{Normal, Tabulated, normal};

/// Normally distributed slopes `(∂h/∂x, ∂h/∂y)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes {
    pub mean: DVec2,
    /// Covariance: xx, xy, yy.
    pub covariance: [f64; 3],
}

/// A direction in which the slopes' density is narrow: the lobe of a glossy BRDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// Slope of the facets that mirror the light towards the viewer.
    pub slope: DVec2,
    /// Width of the lobe [slope].
    pub width: f64,
}

/// The polar angle's cotangent and the azimuth's unit vector of a direction. The horizon has cotangent 0, and so has
/// every direction below it.
pub fn cotangent(direction: DVec3) -> (f64, DVec2) {
    let across = direction.truncate();
    let sine = across.length();
    if sine == 0.0 {
        return (f64::INFINITY, DVec2::X);
    }
    (direction.z.max(0.0) / sine, across / sine)
}

/// A direction from its polar angle and azimuth [rad]. Angles at or beyond the horizon lie on it exactly.
pub fn direction(theta: f64, phi: f64) -> DVec3 {
    let (sin_phi, cos_phi) = phi.sin_cos();
    let (sine, cosine) = if theta.abs() >= FRAC_PI_2 { (1.0, 0.0) } else { theta.sin_cos() };
    DVec3::new(sine * cos_phi, sine * sin_phi, cosine)
}

impl Slopes {
    /// Variance along a unit vector.
    pub fn variance_along(&self, t: DVec2) -> f64 {
        (t.x * self.times(t).x + t.y * self.times(t).y).max(0.0)
    }

    /// The covariance times a vector.
    fn times(&self, t: DVec2) -> DVec2 {
        let [xx, xy, yy] = self.covariance;
        DVec2::new(xx * t.x + xy * t.y, xy * t.x + yy * t.y)
    }

    /// `(cot θ - mean along the azimuth) / deviation along it`, of which masking and visible slopes are functions. Infinite
    /// for slopes that do not vary and face the direction.
    pub fn nu(&self, direction: DVec3) -> f64 {
        let (cot, t) = cotangent(direction);
        let (above, deviation) = (cot - self.mean.dot(t), self.variance_along(t).sqrt());
        if deviation > 0.0 {
            above / deviation
        } else if above > 0.0 {
            f64::INFINITY
        } else {
            0.0
        }
    }

    /// Λ of a direction (Eq. 3).
    pub fn lambda(&self, direction: DVec3) -> f64 {
        super::heights::lambda(self.nu(direction))
    }

    /// The slopes that a viewer sees: density `p(s) (cot θ - s·t)+`, as its mean and covariance, which are exact for any
    /// mean and covariance.
    pub fn visible(&self, o: DVec3) -> Self {
        let (_, t) = cotangent(o);
        let deviation = self.variance_along(t).sqrt();
        let nu = self.nu(o);
        if !(deviation > 0.0 && nu < 1e8) {
            return *self;
        }
        let (mean, variance) = visible_moments(nu);
        // In deviations, slopes towards the viewer are -s·t.
        let shift = self.times(t) / deviation;
        let change = variance - 1.0;
        let [xx, xy, yy] = self.covariance;
        Self {
            mean: self.mean - shift * mean,
            covariance: [
                (xx + shift.x * shift.x * change).max(0.0),
                xy + shift.x * shift.y * change,
                (yy + shift.y * shift.y * change).max(0.0),
            ],
        }
    }

    /// The product of this density with a normal one of a variance about a slope: its mass, and the normalized product.
    pub fn times_normal(&self, centre: DVec2, variance: f64) -> (f64, Self) {
        let [xx, xy, yy] = self.covariance;
        // Σ (Σ + v)⁻¹ maps the distance of the centres and the variance alike.
        let (a, d) = (xx + variance, yy + variance);
        let determinant = (a * d - xy * xy).max(f64::MIN_POSITIVE);
        let inverse = [d / determinant, -xy / determinant, a / determinant];
        let solve = |t: DVec2| DVec2::new(inverse[0] * t.x + inverse[1] * t.y, inverse[1] * t.x + inverse[2] * t.y);
        let away = centre - self.mean;
        let mass = (-0.5 * away.dot(solve(away))).exp() / (std::f64::consts::TAU * determinant.sqrt());
        let (x, y) = (solve(DVec2::X), solve(DVec2::Y));
        let narrowed = [variance * self.times(x).x, variance * self.times(x).y, variance * self.times(y).y];
        let covariance = [narrowed[0].max(0.0), narrowed[1], narrowed[2].max(0.0)];
        (mass, Self { mean: self.mean + self.times(solve(away)), covariance })
    }

    /// The driver of a slope layer, the slope `-∂h/∂a` along an azimuth [rad].
    pub fn driver(&self, azimuth: f64) -> Normal {
        let e = DVec2::from_angle(azimuth);
        Normal { mean: -self.mean.dot(e), deviation: self.variance_along(e).sqrt() }
    }

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

/// Mean and variance of z under the density `φ(z) (ν + z)+`, normalized.
pub fn visible_moments(nu: f64) -> (f64, f64) {
    if nu < -30.0 {
        // Only facets far from the mean are seen, and the difference of large terms would be left.
        let u = 1.0 / (nu * nu);
        return (-nu * (1.0 + 2.0 * u), 2.0 * u);
    }
    if nu > 38.0 {
        return (1.0 / nu, 1.0);
    }
    let mills = normal::mills(nu);
    let mean = if nu < -5.0 { normal::cdf(nu) / normal::ramp(nu) } else { 1.0 / (nu + mills) };
    (mean, (1.0 + mills * mean - mean * mean).max(0.0))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::stops::tests::map;
    use super::super::{Distribution, normal};
    use super::*;

    const GENERAL: Slopes = Slopes { mean: DVec2::new(0.15, -0.1), covariance: [0.09, 0.03, 0.05] };

    fn sample(slopes: &Slopes, random: &mut ChaCha8Rng) -> DVec2 {
        let mut draw = || normal::quantile(random.random::<f64>().max(1e-300));
        Frame::new(slopes, DVec2::X).slope(draw(), draw())
    }

    #[test]
    fn visible_slopes_have_the_mean_and_covariance_of_samples_weighted_by_projected_area() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        for (theta, phi) in [(50.0_f64, 40.0_f64), (80.0, 200.0), (20.0, 0.0)] {
            let o = direction(theta.to_radians(), phi.to_radians());
            let mut sums = [0.0; 6];
            for _ in 0..600_000 {
                let s = sample(&GENERAL, &mut random);
                let w = (o.z - s.dot(o.truncate())).max(0.0);
                for (sum, value) in sums.iter_mut().zip([1.0, s.x, s.y, s.x * s.x, s.x * s.y, s.y * s.y]) {
                    *sum += w * value;
                }
            }
            let [mass, x, y, xx, xy, yy] = sums.map(|sum| sum / sums[0]);
            assert_eq!(mass, 1.0);
            let ours = GENERAL.visible(o);
            assert!((ours.mean - DVec2::new(x, y)).length() < 1.5e-3, "{theta}: {} {x} {y}", ours.mean);
            for (ours, exact) in ours.covariance.iter().zip([xx - x * x, xy - x * y, yy - y * y]) {
                assert!((ours - exact).abs() < 1e-3, "{theta}");
            }
            let quadrature = GENERAL.weighted_moments(None, &|s| (o.z - s.dot(o.truncate())).max(0.0)).unwrap();
            assert!((ours.mean - quadrature.mean).length() < 1e-3);
        }
    }

    #[test]
    fn visible_slopes_keep_the_projected_area_of_the_mean_plane() {
        // Facets together cover, along the view, what the mean plane covers: ∫ p(s) (cot θ - s·t) = cot θ - s̄·t, of
        // which the visible part is what masking leaves: M τ / (1 + Λ) = cot θ - s̄·t.
        for theta in [10.0_f64, 45.0, 70.0, 80.0] {
            let o = direction(theta.to_radians(), 0.7);
            let (cot, t) = cotangent(o);
            let nu = GENERAL.nu(o);
            let seen = normal::ramp(nu) * GENERAL.variance_along(t).sqrt() / (1.0 + GENERAL.lambda(o));
            assert!((seen / (cot - GENERAL.mean.dot(t)) - 1.0).abs() < 1e-9, "{theta}");
        }
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

    #[test]
    fn visible_moments_are_smooth_and_finite_from_above_to_far_behind_the_plane() {
        for nu in [-30.0, -5.0, 38.0] {
            let (a, b) = (visible_moments(nu - 1e-6), visible_moments(nu + 1e-6));
            assert!((a.0 / b.0 - 1.0).abs() < 1e-3 && (a.1 - b.1).abs() < 2e-3, "{nu}: {a:?} {b:?}");
        }
        for nu in [-1e6, -40.0, -1.0, 0.0, 3.0, 1e8, f64::INFINITY] {
            let (mean, variance) = visible_moments(nu);
            assert!(mean.is_finite() && (0.0..=1.0).contains(&variance), "{nu}: {mean} {variance}");
        }
        let (mean, variance) = visible_moments(0.0);
        assert!((mean - 1.2533).abs() < 1e-4 && (variance - 0.4292).abs() < 1e-4);
        let singular = Slopes { mean: DVec2::ZERO, covariance: [0.1, 0.0, 0.0] };
        for theta in [0.0, 0.7, 1.57, FRAC_PI_2] {
            for phi in [0.0, FRAC_PI_2] {
                let seen = singular.visible(direction(theta, phi));
                assert!(seen.mean.is_finite() && seen.covariance.iter().all(|c| c.is_finite()));
            }
        }
    }
}
