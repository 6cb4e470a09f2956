//! A tabulated distribution of slopes, and one on a line of slopes.

use glam::DVec2;

use super::smith::SmithTable;

/// A distribution of slopes on a square grid: each node spreads its mass as a tent over one cell to each side, so that
/// the density is bilinear between the nodes and 0 one cell outside.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeTable {
    pub side: usize,
    /// Slope of the first node.
    pub origin: DVec2,
    /// Distance of the nodes.
    pub cell: f64,
    /// Masses of the nodes, x fastest. They sum to 1.
    pub masses: Vec<f64>,
    /// Cumulative mass of the rows, and within each row.
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// Absent for a table that is only read as a density.
    smith: Option<SmithTable>,
}

impl SlopeTable {
    /// A table of masses, which are scaled to the sum 1. `None` if a mass is negative or not finite, or if all are 0.
    pub fn new(side: usize, origin: DVec2, cell: f64, masses: Vec<f64>) -> Option<Self> {
        let table = Self::only_density(side, origin, cell, masses)?;
        let node = |k: usize| origin + cell * DVec2::new((k % side) as f64, (k / side) as f64);
        let slopes: Vec<(DVec2, f64)> = table
            .masses
            .iter()
            .enumerate()
            .filter(|(_, mass)| **mass > 0.0)
            .map(|(k, mass)| (node(k), *mass))
            .collect();
        Some(Self { smith: Some(SmithTable::new(&slopes)), ..table })
    }

    /// As [`Self::new`], but without masking: [`Self::lambda`] is 0.
    pub fn only_density(side: usize, origin: DVec2, cell: f64, mut masses: Vec<f64>) -> Option<Self> {
        let sum: f64 = masses.iter().sum();
        let is_sound = masses.len() == side * side && masses.iter().all(|mass| *mass >= 0.0);
        let is_distribution = is_sound && sum > 0.0 && sum.is_finite() && side >= 2;
        if !is_distribution {
            return None;
        }
        masses.iter_mut().for_each(|mass| *mass /= sum);
        let cumulative = |values: &[f64]| {
            let mut sum = 0.0;
            values
                .iter()
                .map(|value| {
                    sum += value;
                    sum
                })
                .collect::<Vec<f64>>()
        };
        let columns: Vec<f64> = masses.chunks_exact(side).flat_map(cumulative).collect();
        let totals: Vec<f64> = columns.chunks_exact(side).map(|row| row[side - 1]).collect();
        let rows = cumulative(&totals);
        Some(Self { side, origin, cell, masses, rows, columns, smith: None })
    }

    /// A table of slopes with masses. Slopes beyond `span` of `center` along an axis count at its edge.
    pub fn of_slopes(slopes: &[(DVec2, f64)], side: usize, center: DVec2, span: f64) -> Option<Self> {
        let mut grid = Deposit::new(side, center, span);
        slopes.iter().for_each(|(slope, mass)| grid.add(*slope, *mass));
        Self::new(side, grid.origin, grid.cell, grid.masses)
    }

    /// Density of the slope `m`.
    pub fn density(&self, m: DVec2) -> f64 {
        let at = (m - self.origin) / self.cell;
        let limit = self.side as f64;
        // NaN fails this comparison.
        if !(at.min_element() > -1.0 && at.max_element() < limit) {
            return 0.0;
        }
        let (base, t) = (at.floor(), at - at.floor());
        let value = |dx: isize, dy: isize| {
            let (x, y) = (base.x as isize + dx, base.y as isize + dy);
            let is_inside = x >= 0 && y >= 0 && x < self.side as isize && y < self.side as isize;
            if is_inside { self.masses[y as usize * self.side + x as usize] } else { 0.0 }
        };
        let row = |dy| (1.0 - t.x) * value(0, dy) + t.x * value(1, dy);
        ((1.0 - t.y) * row(0) + t.y * row(1)) / (self.cell * self.cell)
    }

    /// The slope at a point of the unit square; points spread evenly give slopes spread as the density.
    pub fn slope(&self, u: f64, v: f64) -> DVec2 {
        let (row, y) = pick(&self.rows, u);
        let (column, x) = pick(&self.columns[row * self.side..(row + 1) * self.side], v);
        self.origin + self.cell * DVec2::new(column as f64 + tent(x), row as f64 + tent(y))
    }

    /// Smith's Λ of a direction `w` with `k = w.xy / w.z`.
    pub fn lambda(&self, k: DVec2) -> f64 {
        self.smith.as_ref().map_or(0.0, |smith| smith.lambda(k))
    }

    /// Mean slope and mean squared distance from it.
    pub fn moments(&self) -> (DVec2, f64) {
        let node = |k: usize| self.origin + self.cell * DVec2::new((k % self.side) as f64, (k / self.side) as f64);
        let mean: DVec2 = self.masses.iter().enumerate().map(|(k, mass)| *mass * node(k)).sum();
        let square = |(k, mass): (usize, &f64)| mass * (node(k) - mean).length_squared();
        // A tent has the variance of a sixth of a cell squared along each axis.
        (mean, self.masses.iter().enumerate().map(square).sum::<f64>() + self.cell * self.cell / 3.0)
    }

    /// Adds this distribution with the mass `mass` to a grid. Nodes farther apart than those of the grid are spread as their
    /// tents, because two combs of nodes would beat.
    pub fn deposit(&self, grid: &mut Deposit, sign: f64, mass: f64) {
        let count = (1.5 * self.cell / grid.cell).ceil().clamp(1.0, 32.0) as usize;
        let offsets: Vec<f64> = (0..count).map(|k| tent((k as f64 + 0.5) / count as f64)).collect();
        let part = mass / (count * count) as f64;
        for (k, weight) in self.masses.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let node = DVec2::new((k % self.side) as f64, (k / self.side) as f64);
            for y in &offsets {
                for x in &offsets {
                    grid.add(sign * (self.origin + self.cell * (node + DVec2::new(*x, *y))), part * weight);
                }
            }
        }
    }

    /// Largest distance of a node from slope 0 along one axis.
    pub fn reach(&self) -> f64 {
        let far = self.origin + self.cell * (self.side - 1) as f64;
        self.origin.abs().max(far.abs()).max_element() + self.cell
    }

    /// Part of the slopes in the outermost cells.
    pub fn at_edge(&self) -> f64 {
        let last = self.side - 1;
        let is_outer = |k: usize| [k % self.side, k / self.side].iter().any(|at| *at == 0 || *at == last);
        self.masses.iter().enumerate().filter(|(k, _)| is_outer(*k)).map(|(_, mass)| mass).sum()
    }

    /// The table of all slopes turned by 180°.
    pub fn mirrored(&self) -> Option<Self> {
        let far = self.origin + self.cell * (self.side - 1) as f64;
        Self::new(self.side, -far, self.cell, self.masses.iter().rev().copied().collect())
    }
}

/// Index of the entry of a cumulative list in which the part `u` of its sum lies, and the place inside it, 0 to 1.
fn pick(cumulative: &[f64], u: f64) -> (usize, f64) {
    let last = cumulative.len() - 1;
    let wanted = u.clamp(0.0, 1.0) * cumulative[last];
    let at = cumulative.partition_point(|sum| *sum <= wanted).min(last);
    let before = if at == 0 { 0.0 } else { cumulative[at - 1] };
    let width = cumulative[at] - before;
    (at, if width > 0.0 { ((wanted - before) / width).clamp(0.0, 1.0) } else { 0.5 })
}

/// Offset in cells with the density of a tent, from an even variable.
fn tent(u: f64) -> f64 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).max(0.0).sqrt() }
}

/// A grid that collects masses of slopes, each spread over four nodes so that the mean is kept.
pub struct Deposit {
    pub side: usize,
    pub origin: DVec2,
    pub cell: f64,
    pub masses: Vec<f64>,
}

impl Deposit {
    /// A grid of `side` by `side` nodes whose middle node (`side / 2`) lies at `center` and whose edge at `span` from it.
    pub fn new(side: usize, center: DVec2, span: f64) -> Self {
        let cell = 2.0 * span / side as f64;
        let origin = center - cell * (side / 2) as f64;
        Self { side, origin, cell, masses: vec![0.0; side * side] }
    }

    /// Adds a mass. Slopes outside count at the edge.
    pub fn add(&mut self, slope: DVec2, mass: f64) {
        let last = (self.side - 1) as f64 - 1e-9;
        let at = ((slope - self.origin) / self.cell).clamp(DVec2::ZERO, DVec2::splat(last));
        let (base, t) = (at.floor(), at - at.floor());
        let node = base.y as usize * self.side + base.x as usize;
        self.masses[node] += mass * (1.0 - t.x) * (1.0 - t.y);
        self.masses[node + 1] += mass * t.x * (1.0 - t.y);
        self.masses[node + self.side] += mass * (1.0 - t.x) * t.y;
        self.masses[node + self.side + 1] += mass * t.x * t.y;
    }
}

/// Slopes on a line, as one-dimensional relief has them. The density spreads them over one cell to each side of the line;
/// samples lie on it.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeLine {
    /// Slope of the first node, and the step to the next.
    origin: DVec2,
    step: DVec2,
    masses: Vec<f64>,
    cumulative: Vec<f64>,
    smith: SmithTable,
}

impl SlopeLine {
    /// Slopes with masses on the line through `center` along the unit vector `along`. `None` if all masses are 0, or if
    /// the slopes do not spread.
    pub fn new(slopes: &[(DVec2, f64)], center: DVec2, along: DVec2, nodes: usize) -> Option<Self> {
        let place = |slope: DVec2| (slope - center).dot(along);
        let (low, high) = slopes
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), (slope, _)| (low.min(place(*slope)), high.max(place(*slope))));
        let cell = (high - low) / (nodes - 1) as f64;
        let sum: f64 = slopes.iter().map(|(_, mass)| mass).sum();
        if !(cell > 0.0 && sum > 0.0) {
            return None;
        }
        let mut masses = vec![0.0; nodes];
        for (slope, mass) in slopes {
            let at = ((place(*slope) - low) / cell).clamp(0.0, (nodes - 1) as f64 - 1e-9);
            masses[at as usize] += mass / sum * (1.0 - at.fract());
            masses[at as usize + 1] += mass / sum * at.fract();
        }
        let mut total = 0.0;
        let cumulative = masses
            .iter()
            .map(|mass| {
                total += mass;
                total
            })
            .collect();
        let (origin, step) = (center + low * along, cell * along);
        let nodes: Vec<(DVec2, f64)> =
            masses.iter().enumerate().map(|(k, mass)| (origin + k as f64 * step, *mass)).collect();
        Some(Self { origin, step, smith: SmithTable::new(&nodes), masses, cumulative })
    }

    /// Density of the slope `m`.
    pub fn density(&self, m: DVec2) -> f64 {
        let square = self.step.length_squared();
        let (along, across) =
            ((m - self.origin).dot(self.step) / square, (m - self.origin).perp_dot(self.step) / square);
        let width = 1.0 - across.abs();
        if !(width > 0.0 && along > -1.0 && along < self.masses.len() as f64) {
            return 0.0;
        }
        let value = |k: f64| if k >= 0.0 { self.masses.get(k as usize).copied().unwrap_or(0.0) } else { 0.0 };
        let t = along - along.floor();
        width * ((1.0 - t) * value(along.floor()) + t * value(along.floor() + 1.0)) / square
    }

    /// The slope at a point of the unit interval.
    pub fn slope(&self, u: f64) -> DVec2 {
        let (node, part) = pick(&self.cumulative, u);
        self.origin + (node as f64 + tent(part)) * self.step
    }

    pub fn lambda(&self, k: DVec2) -> f64 {
        self.smith.lambda(k)
    }

    /// Slopes of the nodes with their masses.
    pub fn nodes(&self) -> impl Iterator<Item = (DVec2, f64)> {
        self.masses.iter().enumerate().map(|(k, mass)| (self.origin + k as f64 * self.step, *mass))
    }

    /// Distance of the nodes.
    pub fn cell(&self) -> f64 {
        self.step.length()
    }
}

#[cfg(test)]
#[path = "slope_table_tests.rs"]
mod tests;
