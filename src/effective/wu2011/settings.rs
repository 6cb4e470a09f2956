//! Settings of the `wu2011` preset.

use crate::base::{InputError, Result};

/// Truncation and sampling; the defaults are the paper's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wu2011Settings {
    /// Fraction of the power of M that is kept.
    pub keep_m: f64,
    /// Fraction of the power of N that is kept.
    pub keep_n: f64,
    /// Rows of the random projection of N; M has at least 160.
    pub projection_rows: usize,
    /// Number of colour directions of a BRDF, 1 to 3.
    pub colors: usize,
    /// Number of directions of M; `None` applies the rule of Table 3 with a limit on the build time.
    pub m_directions: Option<usize>,
    pub seed: u64,
}

impl Default for Wu2011Settings {
    fn default() -> Self {
        Self { keep_m: 0.98, keep_n: 0.995, projection_rows: 50, colors: 1, m_directions: None, seed: 0 }
    }
}

impl Wu2011Settings {
    /// Largest number of visibility directions in the paper (Sec. 6); the nearest map has 137.
    pub const VISIBILITY_DIRECTIONS: usize = 132;

    pub(super) fn check(&self) -> Result<()> {
        let error = |place: &str, found: String, expected: &str| Err(InputError::new(place, found, expected).into());
        let is_fraction = |kept: f64| kept > 0.0 && kept <= 1.0;
        if !is_fraction(self.keep_m) || !is_fraction(self.keep_n) {
            return error("quality.keep", format!("{}, {}", self.keep_m, self.keep_n), "parts of the power in (0, 1]");
        }
        if !(1..=1000).contains(&self.projection_rows) {
            return error("quality.projection_rows", self.projection_rows.to_string(), "1 to 1000");
        }
        if !(1..=3).contains(&self.colors) {
            return error("quality.colors", self.colors.to_string(), "1 to 3");
        }
        match self.m_directions {
            Some(count) if !(4..=2000).contains(&count) => {
                error("quality.m_directions", count.to_string(), "4 to 2000")
            }
            _ => Ok(()),
        }
    }
}
