//! Distributions of facet normals as densities over slopes, with level facets and other single slopes kept apart.
//!
//! With the slope `m = h.xy / h.z` and the density `p(m)` per base area, `D(h) = p(m) / (n·h)⁴`, and `∫ (n·h) D dω = 1`
//! is `∫ p dm = 1`.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::ellipse::{Ellipse, Profile};
use super::slope_table::{Deposit, SlopeTable};
use super::spread::Spread;

/// The normals of a face. Masses are parts of the base area; all masses together are 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Ndf {
    /// Part that is exactly level.
    level: f64,
    /// Slopes other than 0 that many facets share, with their masses.
    points: Vec<(DVec2, f64)>,
    /// Half width of the tent that stands for a point in the density.
    point_width: f64,
    /// The other slopes, with their mass.
    spread: Spread,
    spread_mass: f64,
}

/// A face of at most so many different slopes consists of points.
const MAX_POINTS: usize = 64;
/// A slope that holds more than this part of a face is a point, however many other slopes there are.
const POINT_MASS: f64 = 0.02;
/// Slopes below this are level. The normals of a mesh are exact to some 1e-7.
const LEVEL_SLOPE: f64 = 2e-6;
impl Ndf {
    /// A face whose facets are all level.
    pub fn smooth() -> Self {
        Self { level: 1.0, points: Vec::new(), point_width: 0.0, spread: Spread::Empty, spread_mass: 0.0 }
    }

    fn of_spread(spread: Spread) -> Self {
        Self { spread, spread_mass: 1.0, level: 0.0, ..Self::smooth() }
    }

    /// Beckmann or GGX slopes with two roughnesses along axes that are turned by `rotation` [rad].
    pub fn analytic(profile: Profile, roughness: DVec2, rotation: f64) -> Self {
        Ellipse::new(profile, roughness, rotation)
            .map_or_else(Self::smooth, |ellipse| Self::of_spread(Spread::Analytic(ellipse)))
    }

    /// A tabulated distribution.
    pub fn of_table(table: SlopeTable) -> Self {
        Self::of_spread(Spread::Table(Arc::new(table)))
    }

    /// The distribution of facets, given as slopes with masses. Slopes that many facets share become points, slopes on a
    /// line become a line, and the others a table of `side` by `side` nodes. `None` if no mass is above 0, or if a slope
    /// is not finite.
    pub fn of_facets(facets: &[(DVec2, f64)], side: usize) -> Option<Self> {
        let total: f64 = facets.iter().map(|(_, mass)| mass).sum();
        let is_sound = |(slope, mass): &(DVec2, f64)| slope.is_finite() && *mass >= 0.0;
        let is_distribution = total > 0.0 && total.is_finite() && facets.iter().all(is_sound);
        if !is_distribution {
            return None;
        }
        let groups = groups(facets, total);
        let all_points = groups.len() <= MAX_POINTS;
        let (points, rest): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|(slope, mass)| all_points || *mass > POINT_MASS || slope.length() < LEVEL_SLOPE);
        let level = points.iter().filter(|(slope, _)| slope.length() < LEVEL_SLOPE).map(|(_, mass)| mass).sum();
        let points: Vec<_> = points.into_iter().filter(|(slope, _)| slope.length() >= LEVEL_SLOPE).collect();
        let spread_mass: f64 = rest.iter().map(|(_, mass)| mass).sum();
        let spread = Spread::of_slopes(&rest, side);
        let spread_mass = if spread == Spread::Empty { 0.0 } else { spread_mass };
        let farthest = points.iter().map(|(slope, _)| slope.length()).fold(0.0, f64::max);
        let point_width = (farthest / 32.0).max(1e-3);
        Some(Self { level, points, point_width, spread, spread_mass })
    }

    /// Part of the face that is exactly level.
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Part of the face that is not level.
    pub fn rough(&self) -> f64 {
        1.0 - self.level
    }

    /// Returns true if all facets are level.
    pub fn is_smooth(&self) -> bool {
        self.level >= 1.0
    }

    /// Returns true if the slopes are the same at every azimuth.
    pub fn is_round(&self) -> bool {
        self.is_smooth() || self.only_ellipse().is_some_and(Ellipse::is_round)
    }

    /// Density of the slopes that are not level; its integral is [`Self::rough`]. Points are tents of a small width.
    pub fn density(&self, m: DVec2) -> f64 {
        let width = self.point_width;
        let tent = |point: DVec2| {
            let t = (1.0 - ((m - point) / width).abs()).max(DVec2::ZERO);
            t.x * t.y / (width * width)
        };
        let points: f64 = self.points.iter().map(|(slope, mass)| mass * tent(*slope)).sum();
        points + self.spread_mass * self.spread.density(m)
    }

    /// Smith's Λ of a direction, up or down. It is negative if the mean slope tilts away from the direction.
    pub fn signed_lambda(&self, w: DVec3) -> f64 {
        if self.is_smooth() {
            return 0.0;
        }
        let k = w.truncate() / w.z.abs().max(1e-9).copysign(w.z);
        let of_points = |(slope, mass): &(DVec2, f64)| mass * ((1.0 + k.dot(*slope)).max(0.0) - 1.0);
        self.points.iter().map(of_points).sum::<f64>() + self.spread_mass * self.spread.lambda(k)
    }

    /// Smith's masking of a direction: the part of the facets that face it and that it sees, `1 / (1 + Λ)`.
    pub fn seen(&self, w: DVec3) -> f64 {
        1.0 / (1.0 + self.signed_lambda(w).max(0.0))
    }

    /// The slope at a point of the unit square, and whether the facet is level. Random points give random facets, by base
    /// area.
    pub fn facet(&self, u: f64, v: f64) -> (DVec2, bool) {
        if u < self.spread_mass {
            return (self.spread.slope(u / self.spread_mass, v), false);
        }
        let mut left = u - self.spread_mass;
        for (slope, mass) in &self.points {
            left -= mass;
            if left < 0.0 {
                return (*slope, false);
            }
        }
        match self.points.last() {
            // Rounding must not create a level facet.
            Some((slope, _)) if self.level <= 0.0 => (*slope, false),
            None if self.level <= 0.0 => (self.spread.slope(1.0, v), false),
            _ => (DVec2::ZERO, true),
        }
    }

    /// The slope of a facet that the direction `w`, up or down, sees, at a point of the unit square. Random points give facets by
    /// their areas as seen along `w`. `None` unless all slopes are those of a GGX distribution.
    pub fn visible_slope(&self, w: DVec3, u: f64, v: f64) -> Option<DVec2> {
        let ellipse = self.only_ellipse().filter(|_| self.level <= 0.0)?;
        ellipse.visible_slope(if w.z < 0.0 { -w } else { w }, u, v)
    }

    /// `count` evenly spread slopes of the spread part and all points, with their masses: the rough part of the face.
    pub fn facets(&self, count: usize) -> Vec<(DVec2, f64)> {
        let spread = if self.spread_mass > 0.0 { self.spread.facets(count) } else { Vec::new() };
        let part = self.spread_mass / count.max(1) as f64;
        spread.into_iter().map(|slope| (slope, part)).chain(self.points.iter().copied()).collect()
    }

    /// Dimension of the rough slopes: 0 for single slopes, 1 for a line, 2 for others.
    pub fn dimension(&self) -> usize {
        match &self.spread {
            Spread::Empty => 0,
            Spread::Line(_) => 1,
            _ => 2,
        }
    }

    /// Mean slope of the rough part and mean squared distance from it; zero without a rough part. GGX counts as Beckmann
    /// of the same roughness.
    pub fn rough_moments(&self) -> (DVec2, f64) {
        let rough = self.rough();
        if rough <= 0.0 {
            return (DVec2::ZERO, 0.0);
        }
        let (center, variance) = self.spread.moments();
        let mean =
            (self.points.iter().map(|(slope, mass)| *slope * *mass).sum::<DVec2>() + self.spread_mass * center) / rough;
        let of_points = self.points.iter().map(|(slope, mass)| mass * (*slope - mean).length_squared()).sum::<f64>();
        (mean, (of_points + self.spread_mass * (variance + (center - mean).length_squared())) / rough)
    }

    /// Root mean square slope of the whole face, about slope 0.
    pub fn deviation(&self) -> f64 {
        let (mean, variance) = self.rough_moments();
        (self.rough() * (variance + mean.length_squared())).sqrt()
    }

    /// The face seen from its other side: all slopes turned by 180°.
    pub fn mirrored(&self) -> Self {
        let points = self.points.iter().map(|(slope, mass)| (-*slope, *mass)).collect();
        Self { points, spread: self.spread.mirrored(), ..self.clone() }
    }

    /// The slopes with a density of the spread part, if it is the whole rough part.
    pub(super) fn only_spread(&self) -> Option<&Spread> {
        self.points.is_empty().then_some(&self.spread)
    }

    /// Largest slope of the rough part along one axis that a table should hold.
    pub(super) fn span(&self) -> f64 {
        let points = self.points.iter().map(|(slope, _)| slope.abs().max_element()).fold(0.0, f64::max);
        points.max(if self.spread_mass > 0.0 { self.spread.span() } else { 0.0 })
    }

    /// Width of the finest detail that the density resolves: a cell of a table or a line, or the width of a point. 0 for
    /// analytic slopes.
    pub fn resolution(&self) -> f64 {
        let points = if self.points.is_empty() { f64::MAX } else { self.point_width };
        let spread = match &self.spread {
            Spread::Table(table) => table.cell,
            Spread::Line(line) => line.cell(),
            _ => f64::MAX,
        };
        let finest = points.min(spread);
        if finest == f64::MAX { 0.0 } else { finest }
    }

    /// Width of single slopes and lines of slopes in the density; 0 without any.
    fn width_of_lines(&self) -> f64 {
        match &self.spread {
            _ if self.is_smooth() => 0.0,
            Spread::Line(_) => self.resolution(),
            _ if !self.points.is_empty() => self.point_width,
            _ => 0.0,
        }
    }

    /// Width of the finest detail of light through two faces, per refraction; 0 for smooth lobes.
    pub(super) fn finest_of(top: &Self, bottom: &Self) -> f64 {
        let widths = [top, bottom].map(Self::width_of_lines);
        widths.into_iter().filter(|width| *width > 0.0).reduce(f64::min).unwrap_or(0.0)
    }

    /// Smallest width of the slopes with a density: a roughness, or the finest detail that is resolved.
    pub(super) fn narrowest(&self) -> f64 {
        match &self.spread {
            Spread::Analytic(ellipse) if self.points.is_empty() => ellipse.narrowest(),
            Spread::Analytic(ellipse) => ellipse.narrowest().min(self.point_width),
            _ => self.resolution(),
        }
    }

    /// Part of the face whose slopes lie in the outermost cells of a table.
    pub fn at_edge(&self) -> f64 {
        match &self.spread {
            Spread::Table(table) => self.spread_mass * table.at_edge(),
            _ => 0.0,
        }
    }

    /// Adds the rough part, scaled to mass 1, to a grid; `sign` is -1 for slopes turned by 180°.
    pub(super) fn deposit(&self, grid: &mut Deposit, sign: f64) {
        let rough = self.rough();
        self.points.iter().for_each(|(slope, mass)| grid.add(sign * *slope, mass / rough));
        self.spread.deposit(grid, sign, self.spread_mass / rough);
    }

    /// Describes the distribution in words.
    pub fn describe(&self) -> String {
        let mut parts = Vec::new();
        match &self.spread {
            Spread::Empty => {}
            Spread::Analytic(ellipse) => parts.push(format!(
                "{:?} of roughness {:.3}",
                ellipse.profile,
                (2.0 * ellipse.variance()).sqrt() / 2f64.sqrt()
            )),
            Spread::Table(table) => parts.push(format!("a table of {0} x {0} slopes", table.side)),
            Spread::Line(_) => parts.push("a line of slopes".to_owned()),
        }
        if !self.points.is_empty() {
            parts.push(format!("{} single slopes", self.points.len()));
        }
        if self.level > 0.0 {
            parts.push(format!("{:.1} % level", 100.0 * self.level));
        }
        parts.join(", ")
    }
}

/// Sums the masses of facets with the same slope; the masses are scaled by `1 / total`.
fn groups(facets: &[(DVec2, f64)], total: f64) -> Vec<(DVec2, f64)> {
    // Normals of a mesh are exact to some 1e-7, so that equal slopes agree to 1e-5 of their size.
    let rounded = |slope: DVec2| {
        let step = 4e-6 * (1.0 + slope.length_squared()).sqrt().log2().floor().exp2();
        let at = (slope / step).round();
        (step.to_bits(), at.x as i64, at.y as i64)
    };
    let mut keyed: Vec<_> = facets
        .iter()
        .filter(|(_, mass)| *mass > 0.0)
        .map(|(slope, mass)| (rounded(*slope), *slope, *mass / total))
        .collect();
    keyed.sort_by_key(|(key, ..)| *key);
    keyed
        .chunk_by(|a, b| a.0 == b.0)
        .map(|group| {
            let mass: f64 = group.iter().map(|(.., mass)| mass).sum();
            (group.iter().map(|(_, slope, mass)| *slope * *mass).sum::<DVec2>() / mass, mass)
        })
        .collect()
}

/// The unit normal of a facet of slope `m`, which points up.
pub fn normal(m: DVec2) -> DVec3 {
    let z = 1.0 / (1.0 + m.length_squared()).sqrt();
    (m * z).extend(z)
}

#[cfg(test)]
mod tests {
    use super::super::spread::r2;
    use super::*;

    #[test]
    fn facets_of_a_groove_are_points_and_the_floor_is_level() {
        let facets = [(DVec2::new(0.5, 0.0), 1.0), (DVec2::new(-0.5, 0.0), 1.0), (DVec2::ZERO, 2.0)];
        let ndf = Ndf::of_facets(&facets, 64).unwrap();
        assert_eq!((ndf.level(), ndf.points.len()), (0.5, 2));
        assert_eq!(ndf.spread, Spread::Empty);
        // A side of slope 1/2 is turned away from directions beyond 63.4°.
        let w = DVec3::new(3.0, 0.0, 1.0).normalize();
        assert!((1.0 + ndf.signed_lambda(w) - (0.25 * 2.5 + 0.5)).abs() < 1e-12);
        assert_eq!(ndf.signed_lambda(DVec3::Z), 0.0);
    }

    #[test]
    fn slopes_on_a_line_are_a_line_and_others_a_table_with_the_same_moments() {
        let line: Vec<_> = (0..500).map(|k| (DVec2::new((f64::from(k) * 0.1).sin(), 0.0), 1.0)).collect();
        assert!(matches!(Ndf::of_facets(&line, 128).unwrap().spread, Spread::Line(_)));
        let ellipse = Ellipse::new(Profile::Beckmann, DVec2::new(0.3, 0.1), 0.7).unwrap();
        let slopes: Vec<_> = (0..20_000).map(|k| (ellipse.slope(r2(k)[0], r2(k)[1]) + 0.05, 1.0)).collect();
        let ndf = Ndf::of_facets(&slopes, 128).unwrap();
        let (mean, variance) = ndf.rough_moments();
        assert!(
            (mean - 0.05).length() < 1e-3 && (variance / ellipse.variance() - 1.0).abs() < 0.01,
            "{mean} {variance}"
        );
        let mirrored = ndf.mirrored();
        assert!((mirrored.rough_moments().0 + mean).length() < 1e-12);
        let m = DVec2::new(0.1, 0.2);
        assert!((mirrored.density(m) - ndf.density(-m)).abs() < 1e-9);
    }

    #[test]
    fn random_facets_have_the_masses_of_all_parts() {
        let mut slopes: Vec<_> =
            (0..300).map(|k| (DVec2::from_angle(f64::from(k)) * f64::from(k) / 300.0, 1.0)).collect();
        slopes.extend([(DVec2::ZERO, 200.0), (DVec2::new(0.4, 0.4), 100.0)]);
        let ndf = Ndf::of_facets(&slopes, 64).unwrap();
        let count = 30_000;
        let facets: Vec<_> = (0..count).map(|k| ndf.facet(r2(k)[0], r2(k)[1])).collect();
        let part =
            |is: &dyn Fn(&(DVec2, bool)) -> bool| facets.iter().filter(|facet| is(facet)).count() as f64 / count as f64;
        assert!((part(&|facet| facet.1) - ndf.level()).abs() < 2e-3);
        assert!((part(&|facet| facet.0 == DVec2::new(0.4, 0.4)) - 1.0 / 6.0).abs() < 2e-3);
        let masses: f64 = ndf.facets(64).iter().map(|(_, mass)| mass).sum();
        assert!((masses - ndf.rough()).abs() < 1e-12);
    }

    #[test]
    fn slopes_that_are_no_distribution_are_refused() {
        assert!(Ndf::of_facets(&[], 64).is_none());
        assert!(Ndf::of_facets(&[(DVec2::ZERO, 0.0)], 64).is_none());
        assert!(Ndf::of_facets(&[(DVec2::new(f64::INFINITY, 0.0), 1.0)], 64).is_none());
    }
}
