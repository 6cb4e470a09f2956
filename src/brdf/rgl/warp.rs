//! Bilinear functions on the unit square, given at the vertices of a grid, with one slice per direction.

use crate::base::InputError;

/// A grid of `width` values along x (fastest) and `height` values along y, both at least 2.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub width: usize,
    pub height: usize,
}

/// A cell and a position in it.
#[derive(Clone, Copy)]
struct Cell {
    column: usize,
    row: usize,
    x: f64,
    y: f64,
}

impl Grid {
    pub(crate) fn new(place: &str, width: usize, height: usize) -> Result<Self, InputError> {
        if width < 2 || height < 2 {
            let found = format!("a grid of {height} x {width}");
            return Err(InputError::new(format!("field \"{place}\""), found, "at least 2 x 2"));
        }
        Ok(Self { width, height })
    }

    pub(crate) fn len(self) -> usize {
        self.width * self.height
    }

    fn cell(self, [u, v]: [f64; 2]) -> Cell {
        let split = |t: f64, n: usize| {
            let position = t.clamp(0.0, 1.0) * (n - 1) as f64;
            let lower = (position as usize).min(n - 2);
            (lower, position - lower as f64)
        };
        let ((column, x), (row, y)) = (split(u, self.width), split(v, self.height));
        Cell { column, row, x, y }
    }

    /// Interpolates `values` bilinearly.
    pub(crate) fn eval(self, values: &[f64], at: [f64; 2]) -> f64 {
        let Cell { column, row, x, y } = self.cell(at);
        let along = |row: usize| {
            let first = row * self.width + column;
            lerp(values[first], values[first + 1], x)
        };
        lerp(along(row), along(row + 1), y)
    }
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// A position between two samples of a parameter: the index of the lower one and the weight of the upper one.
#[derive(Clone, Copy)]
pub(crate) struct Between {
    pub lower: usize,
    pub weight: f64,
}

impl Between {
    /// Finds `value` among strictly increasing `values`; positions are constant beyond the ends.
    pub(crate) fn find(values: &[f64], value: f64) -> Self {
        let upper = values.partition_point(|&v| v <= value).clamp(1, values.len().max(2) - 1);
        match (values.get(upper - 1), values.get(upper)) {
            (Some(&a), Some(&b)) => Self { lower: upper - 1, weight: ((value - a) / (b - a)).clamp(0.0, 1.0) },
            _ => Self { lower: 0, weight: 0.0 },
        }
    }
}

/// The four slices of `(phi_i, theta_i)`, `theta_i` fastest, around a direction, and their weights.
#[derive(Clone, Copy)]
pub(crate) struct SliceBlend {
    slices: [(usize, f64); 4],
}

impl SliceBlend {
    pub(crate) fn new(phi: Between, theta: Between, thetas: usize) -> Self {
        let corner = |up: usize, right: usize| {
            let weight = |at: Between, step: usize| if step == 1 { at.weight } else { 1.0 - at.weight };
            let (weight_phi, weight_theta) = (weight(phi, up), weight(theta, right));
            // A slice with weight 0 may not exist, so the lower one replaces it.
            let step = |step: usize, weight: f64| if weight > 0.0 { step } else { 0 };
            let slice = (phi.lower + step(up, weight_phi)) * thetas + theta.lower + step(right, weight_theta);
            (slice, weight_phi * weight_theta)
        };
        Self { slices: [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)] }
    }

    /// The slices and their weights, which sum to one.
    pub(crate) fn slices(self) -> [(usize, f64); 4] {
        self.slices
    }

    /// A blend of one slice only.
    pub(crate) fn only(slice: usize) -> Self {
        Self { slices: [(slice, 1.0), (slice, 0.0), (slice, 0.0), (slice, 0.0)] }
    }

    /// Interpolates the values that `of` returns for the slices.
    pub(crate) fn mix(self, of: impl Fn(usize) -> f64) -> f64 {
        self.slices.iter().map(|&(slice, weight)| if weight > 0.0 { weight * of(slice) } else { 0.0 }).sum()
    }
}

/// Densities per slice, and the map from their domain to uniform numbers (Dupuy and Jakob 2018, Sec. 4). The map
/// inverts the marginal distribution over y, then that of x given y. Integrals are in grid units, and each slice has a
/// total of 1.
pub(crate) struct Warp {
    grid: Grid,
    density: Vec<f64>,
    /// Integral along a row up to each column; the last column is the row's total.
    along_row: Vec<f64>,
    /// Integral over the rows up to each row.
    over_rows: Vec<f64>,
}

impl Warp {
    /// A warp without slices.
    pub(crate) fn empty(grid: Grid) -> Self {
        Self { grid, density: Vec::new(), along_row: Vec::new(), over_rows: Vec::new() }
    }

    /// Creates a warp. `density` has consecutive slices of `grid`, none negative and none entirely 0.
    pub(crate) fn new(grid: Grid, mut density: Vec<f64>) -> Result<Self, InputError> {
        let mut along_row = vec![0.0; density.len()];
        let mut over_rows = Vec::with_capacity(density.len() / grid.width);
        for (slice, (density, along_row)) in
            density.chunks_exact_mut(grid.len()).zip(along_row.chunks_exact_mut(grid.len())).enumerate()
        {
            for (density, along_row) in density.chunks_exact(grid.width).zip(along_row.chunks_exact_mut(grid.width)) {
                for column in 1..grid.width {
                    along_row[column] = along_row[column - 1] + 0.5 * (density[column - 1] + density[column]);
                }
            }
            let row_total = |row: usize| along_row[row * grid.width + grid.width - 1];
            let totals: Vec<f64> = (1..grid.height)
                .scan(0.0, |sum, row| {
                    *sum += 0.5 * (row_total(row - 1) + row_total(row));
                    Some(*sum)
                })
                .collect();
            let total = totals.last().copied().unwrap_or(0.0);
            if !(total > 0.0 && total.is_finite()) || density.iter().any(|&value| value < 0.0) {
                return Err(InputError::new(
                    format!("field \"vndf\", slice {slice}"),
                    format!("a density that adds up to {total}"),
                    "values that are not negative and add up to more than 0",
                ));
            }
            over_rows.push(0.0);
            over_rows.extend(totals.iter().map(|sum| sum / total));
            density.iter_mut().chain(along_row).for_each(|value| *value /= total);
        }
        Ok(Self { grid, density, along_row, over_rows })
    }

    /// Returns the uniform numbers that the warp of the interpolated slice maps to `at`.
    pub(crate) fn invert(&self, slice: SliceBlend, at: [f64; 2]) -> [f64; 2] {
        let Cell { column, row, x, y } = self.grid.cell(at);
        let Grid { width, height } = self.grid;
        let mix = |values: &[f64], row: usize, column: usize| {
            slice.mix(|slice| values[(slice * height + row) * width + column])
        };
        let total = [row, row + 1].map(|row| mix(&self.along_row, row, width - 1));
        let below = slice.mix(|slice| self.over_rows[slice * height + row]);
        let partial = [row, row + 1].map(|row| {
            let (a, b) = (mix(&self.density, row, column), mix(&self.density, row, column + 1));
            mix(&self.along_row, row, column) + part(a, b, x)
        });
        let row_total = lerp(total[0], total[1], y);
        // In a row of zeros, any number is valid.
        let across = if row_total > 0.0 { lerp(partial[0], partial[1], y) / row_total } else { at[0] };
        [across.clamp(0.0, 1.0), (below + part(total[0], total[1], y)).clamp(0.0, 1.0)]
    }

    /// The grid, and the density of each slice at its vertices, up to a factor.
    pub(crate) fn densities(&self) -> (Grid, &[f64]) {
        (self.grid, &self.density)
    }

    /// The density of one slice per unit of the square.
    pub(crate) fn density(&self, slice: usize, at: [f64; 2]) -> f64 {
        let Grid { width, height } = self.grid;
        let cells = ((width - 1) * (height - 1)) as f64;
        self.grid.eval(&self.density[slice * self.grid.len()..][..self.grid.len()], at) * cells
    }

    /// Maps uniform numbers by the warp of one slice. Returns the point and the density there, per unit of the square.
    pub(crate) fn sample(&self, slice: usize, [s, t]: [f64; 2]) -> ([f64; 2], f64) {
        let Grid { width, height } = self.grid;
        let at = |row: usize, column: usize| (slice * height + row) * width + column;
        let over_rows = &self.over_rows[slice * height..][..height];
        let row = over_rows.partition_point(|&sum| sum <= t).clamp(1, height - 1) - 1;
        let total = [row, row + 1].map(|row| self.along_row[at(row, width - 1)]);
        let y = part_inverse(total[0], total[1], t - over_rows[row]);
        let wanted = s * lerp(total[0], total[1], y);
        let along = |column: usize| lerp(self.along_row[at(row, column)], self.along_row[at(row + 1, column)], y);
        let (mut low, mut high) = (0, width - 1);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if along(middle) <= wanted { low = middle } else { high = middle }
        }
        let density = |column: usize| lerp(self.density[at(row, column)], self.density[at(row + 1, column)], y);
        let (a, b) = (density(low), density(low + 1));
        let x = part_inverse(a, b, wanted - along(low));
        let cells = ((width - 1) * (height - 1)) as f64;
        let point = [(low as f64 + x) / (width - 1) as f64, (row as f64 + y) / (height - 1) as f64];
        (point, lerp(a, b, x) * cells)
    }
}

/// Integral of a linear function over the first fraction `t` of its cell.
fn part(a: f64, b: f64, t: f64) -> f64 {
    t * (a + 0.5 * t * (b - a))
}

/// The `t` for which [`part`] is `integral`: the root `2 c / (a + √(a² + 2 c (b-a)))`, stable if `a` is nearly `b`.
fn part_inverse(a: f64, b: f64, integral: f64) -> f64 {
    let below = a + (a * a + 2.0 * integral * (b - a)).max(0.0).sqrt();
    if below > 0.0 { (2.0 * integral / below).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
#[path = "warp_tests.rs"]
mod tests;
