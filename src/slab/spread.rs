//! Distributions of slopes with a density: analytic, tabulated, or on a line.

use std::sync::Arc;

use glam::{DMat2, DVec2};

use super::ellipse::Ellipse;
use super::slope_table::{Deposit, SlopeLine, SlopeTable};

/// A distribution of slopes with a density and mass 1.
#[derive(Debug, Clone, PartialEq)]
pub enum Spread {
    Empty,
    Analytic(Ellipse),
    Table(Arc<SlopeTable>),
    Line(Arc<SlopeLine>),
}

/// Part of the slopes that the span of a table holds; the others count at its edge.
const SPAN_MASS: f64 = 0.999;
/// Ratio of the variances across and along a line of slopes, below which they count as one.
const LINE_RATIO: f64 = 1e-6;

impl Spread {
    /// A line of slopes with masses, or a table of `side` by `side` nodes; empty without any mass.
    pub(super) fn of_slopes(slopes: &[(DVec2, f64)], side: usize) -> Self {
        let mass: f64 = slopes.iter().map(|(_, mass)| mass).sum();
        if mass.is_nan() || mass <= 0.0 {
            return Self::Empty;
        }
        let mean = slopes.iter().map(|(slope, mass)| *slope * *mass).sum::<DVec2>() / mass;
        let mut covariance = DMat2::ZERO;
        for (slope, part) in slopes {
            let d = *slope - mean;
            covariance += DMat2::from_cols(d * d.x, d * d.y) * (part / mass);
        }
        let (along, major, minor) = principal(covariance);
        if minor <= LINE_RATIO * major
            && let Some(line) = SlopeLine::new(slopes, mean, along, side)
        {
            return Self::Line(Arc::new(line));
        }
        let (center, span) = box_of(slopes, mass);
        SlopeTable::of_slopes(slopes, side, center, span).map_or(Self::Empty, |table| Self::Table(Arc::new(table)))
    }
}

/// Direction of the largest variance, and both variances.
fn principal(covariance: DMat2) -> (DVec2, f64, f64) {
    let (xx, xy, yy) = (covariance.x_axis.x, covariance.x_axis.y, covariance.y_axis.y);
    let middle = 0.5 * (xx + yy);
    let radius = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
    (DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy)), middle + radius, (middle - radius).max(0.0))
}

/// Centre and half width of the square that holds nearly all slopes.
fn box_of(slopes: &[(DVec2, f64)], mass: f64) -> (DVec2, f64) {
    let interval = |axis: usize| -> (f64, f64) {
        let mut values: Vec<(f64, f64)> = slopes.iter().map(|(slope, mass)| (slope[axis], *mass)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        let outside = 0.25 * (1.0 - SPAN_MASS) * mass;
        let mut sum = 0.0;
        let low = values.iter().find(|(_, mass)| {
            sum += mass;
            sum > outside
        });
        sum = 0.0;
        let high = values.iter().rev().find(|(_, mass)| {
            sum += mass;
            sum > outside
        });
        (low.map_or(0.0, |(value, _)| *value), high.map_or(0.0, |(value, _)| *value))
    };
    let ((x0, x1), (y0, y1)) = (interval(0), interval(1));
    let center = 0.5 * DVec2::new(x0 + x1, y0 + y1);
    let half: f64 = 0.5 * (x1 - x0).max(y1 - y0);
    (center, (1.03 * half).max(1e-6))
}

impl Spread {
    /// Density of the slope `m`.
    pub fn density(&self, m: DVec2) -> f64 {
        match self {
            Self::Empty => 0.0,
            Self::Analytic(ellipse) => ellipse.density(m),
            Self::Table(table) => table.density(m),
            Self::Line(line) => line.density(m),
        }
    }

    pub(super) fn lambda(&self, k: DVec2) -> f64 {
        match self {
            Self::Empty => 0.0,
            Self::Analytic(ellipse) => ellipse.lambda(k),
            Self::Table(table) => table.lambda(k),
            Self::Line(line) => line.lambda(k),
        }
    }

    pub(super) fn slope(&self, u: f64, v: f64) -> DVec2 {
        match self {
            Self::Empty => DVec2::ZERO,
            Self::Analytic(ellipse) => ellipse.slope(u, v),
            Self::Table(table) => table.slope(u, v),
            Self::Line(line) => line.slope(u),
        }
    }

    /// `count` evenly spread slopes.
    pub(super) fn facets(&self, count: usize) -> Vec<DVec2> {
        let even = |k: usize| {
            let [u, v] = r2(k);
            // Slopes on a line have one coordinate, which the first `count` steps divide evenly.
            let u = if matches!(self, Self::Line(_)) { (k as f64 + 0.5) / count as f64 } else { u };
            self.slope(u, v)
        };
        (0..count).map(even).collect()
    }

    pub(super) fn moments(&self) -> (DVec2, f64) {
        match self {
            Self::Empty => (DVec2::ZERO, 0.0),
            Self::Analytic(ellipse) => (DVec2::ZERO, ellipse.variance()),
            Self::Table(table) => table.moments(),
            Self::Line(line) => {
                let mean = line.nodes().map(|(slope, mass)| slope * mass).sum::<DVec2>();
                (mean, line.nodes().map(|(slope, mass)| mass * (slope - mean).length_squared()).sum())
            }
        }
    }

    pub(super) fn span(&self) -> f64 {
        match self {
            Self::Empty => 0.0,
            Self::Analytic(ellipse) => ellipse.span(),
            Self::Table(table) => table.reach(),
            Self::Line(line) => line.nodes().map(|(slope, _)| slope.abs().max_element()).fold(0.0, f64::max),
        }
    }

    pub(super) fn mirrored(&self) -> Self {
        match self {
            Self::Table(table) => table.mirrored().map_or_else(|| self.clone(), |table| Self::Table(Arc::new(table))),
            Self::Line(line) => {
                let nodes: Vec<_> = line.nodes().map(|(slope, mass)| (-slope, mass)).collect();
                let along = (nodes[0].0 - nodes[nodes.len() - 1].0).try_normalize().unwrap_or(DVec2::X);
                SlopeLine::new(&nodes, nodes[0].0, along, nodes.len())
                    .map_or_else(|| self.clone(), |line| Self::Line(Arc::new(line)))
            }
            other => other.clone(),
        }
    }

    /// Adds this distribution with the mass `mass` to a grid.
    pub(super) fn deposit(&self, grid: &mut Deposit, sign: f64, mass: f64) {
        match self {
            Self::Empty => {}
            Self::Analytic(ellipse) if ellipse.narrowest() >= 1.5 * grid.cell => {
                let span = ellipse.span();
                let node =
                    |k: usize| grid.origin + grid.cell * DVec2::new((k % grid.side) as f64, (k / grid.side) as f64);
                let inside = |m: DVec2| if m.abs().max_element() <= span { ellipse.density(m) } else { 0.0 };
                let area = grid.cell * grid.cell;
                let values: Vec<f64> = (0..grid.side * grid.side).map(|k| area * inside(node(k))).collect();
                let sum: f64 = values.iter().sum();
                // The sum over nodes of a smooth density is exact; what lies outside the span stays outside.
                grid.masses.iter_mut().zip(values).for_each(|(node, value)| *node += mass * value);
                let outside = (1.0 - sum) / OUTSIDE_SLOPES as f64;
                for k in 0..OUTSIDE_SLOPES {
                    let along = DVec2::from_angle(std::f64::consts::TAU * k as f64 / OUTSIDE_SLOPES as f64);
                    grid.add(span * along, mass * outside.max(0.0));
                }
            }
            Self::Table(table) => table.deposit(grid, sign, mass),
            Self::Line(line) => line.nodes().for_each(|(slope, part)| grid.add(sign * slope, mass * part)),
            Self::Analytic(_) => {
                self.facets(DEPOSITED_FACETS)
                    .into_iter()
                    .for_each(|slope| grid.add(sign * slope, mass / DEPOSITED_FACETS as f64));
            }
        }
    }
}

/// Number of slopes that stand for an analytic distribution that is narrower than a cell.
const DEPOSITED_FACETS: usize = 1 << 14;

/// Number of slopes around a span that stand for those outside.
const OUTSIDE_SLOPES: usize = 512;

/// Point `k` of the R2 sequence of evenly spread points of the unit square (Roberts 2018).
pub(super) fn r2(k: usize) -> [f64; 2] {
    let at = |step: f64| (0.5 + (k + 1) as f64 * step).fract();
    [at(0.754_877_666_246_692_7), at(0.569_840_290_998_053_2)]
}
