//! Symmetric positive definite systems whose rows start late: the lower triangle is stored from the first entry of each
//! row (George and Liu 1981, Sec. 4.2). The factor fills only what is stored.

/// The lower triangle of a symmetric matrix, row by row.
pub struct Skyline {
    /// Column of the first stored entry of each row.
    first: Vec<usize>,
    /// Place of each row's first entry in `values`; one more at the end.
    start: Vec<usize>,
    values: Vec<f64>,
}

impl Skyline {
    /// A matrix of zeros. `first[row] <= row` is the first column of a row that an entry may use.
    pub fn new(first: Vec<usize>) -> Self {
        let mut start = Vec::with_capacity(first.len() + 1);
        let mut sum = 0;
        for (row, column) in first.iter().enumerate() {
            start.push(sum);
            sum += row + 1 - column;
        }
        start.push(sum);
        Self { first, start, values: vec![0.0; sum] }
    }

    /// Adds to the entries `(a, b)` and `(b, a)`; to one entry if they are the same.
    pub fn add(&mut self, a: usize, b: usize, value: f64) {
        let (row, column) = (a.max(b), a.min(b));
        self.values[self.start[row] + column - self.first[row]] += value;
    }

    /// The stored entries of a row; the last one is on the diagonal.
    fn row(&self, row: usize) -> &[f64] {
        &self.values[self.start[row]..self.start[row + 1]]
    }

    /// Solves the system by Cholesky's factorization. `None` if the matrix is not positive definite.
    pub fn solve(mut self, mut right: Vec<f64>) -> Option<Vec<f64>> {
        let count = self.first.len();
        for row in 0..count {
            let (before, rest) = self.values.split_at_mut(self.start[row]);
            let own = &mut rest[..=row - self.first[row]];
            let first = self.first[row];
            for column in first..row {
                let other = &before[self.start[column]..self.start[column + 1]];
                let from = first.max(self.first[column]);
                let sum = dot(&own[from - first..column - first], &other[from - self.first[column]..]);
                own[column - first] = (own[column - first] - sum) / other[column - self.first[column]];
            }
            let last = row - first;
            let square = own[last] - dot(&own[..last], &own[..last]);
            if square.is_nan() || square <= 0.0 || !square.is_finite() {
                return None;
            }
            own[last] = square.sqrt();
        }
        for row in 0..count {
            let own = self.row(row);
            let last = own.len() - 1;
            right[row] = (right[row] - dot(&own[..last], &right[self.first[row]..row])) / own[last];
        }
        for row in (0..count).rev() {
            let own = self.row(row);
            let last = own.len() - 1;
            right[row] /= own[last];
            let value = right[row];
            own[..last].iter().zip(&mut right[self.first[row]..row]).for_each(|(l, x)| *x -= l * value);
        }
        Some(right)
    }
}

/// The sum of products over the shorter slice, in four interleaved sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let (a4, a_rest) = a[..count].as_chunks::<4>();
    let (b4, b_rest) = b[..count].as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of sparse rows and a right side, and the same dense.
    fn system(count: usize) -> (Skyline, Vec<f64>, nalgebra::DMatrix<f64>) {
        let first: Vec<usize> = (0..count).map(|row| row.saturating_sub(1 + row % 7)).collect();
        let mut sparse = Skyline::new(first.clone());
        let mut dense = nalgebra::DMatrix::zeros(count, count);
        for row in 0..count {
            for column in first[row]..=row {
                let value = if row == column { 20.0 } else { ((3 * row + 5 * column) as f64).sin() };
                sparse.add(column, row, value);
                dense[(row, column)] = value;
                dense[(column, row)] = value;
            }
        }
        (sparse, (0..count).map(|k| (k as f64).cos()).collect(), dense)
    }

    #[test]
    fn the_solution_is_that_of_the_dense_matrix() {
        let (sparse, right, dense) = system(60);
        let found = sparse.solve(right.clone()).unwrap();
        let expected = dense.cholesky().unwrap().solve(&nalgebra::DVector::from_vec(right));
        assert!(found.iter().zip(expected.iter()).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_solution() {
        let (mut sparse, right, _) = system(10);
        sparse.add(4, 4, -40.0);
        assert!(sparse.solve(right.clone()).is_none());
        let (mut sparse, ..) = system(10);
        sparse.add(4, 4, f64::NAN);
        assert!(sparse.solve(right).is_none());
    }
}
