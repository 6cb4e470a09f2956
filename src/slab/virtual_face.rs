//! The one face that stands for both: to first order light is deflected by the difference of the slopes of the facets
//! that it meets, so the virtual distribution is the correlation of both.

use std::sync::Arc;

use glam::DVec2;

use super::ndf::Ndf;
use super::slope_table::{Deposit, SlopeTable};
use super::spread::Spread;
use crate::math::fft;

/// The distribution of `m_top - m_bottom` for independent rough facets of both faces. It is closed for Beckmann slopes, and
/// otherwise a table of `side` by `side` slopes, a power of two. Empty if a face has no rough part.
pub fn virtual_face(top: &Ndf, bottom: &Ndf, side: usize) -> Spread {
    if top.is_smooth() || bottom.is_smooth() {
        return Spread::Empty;
    }
    if let (Some(Spread::Analytic(a)), Some(Spread::Analytic(b))) = (top.only_spread(), bottom.only_spread())
        && let Some(sum) = a.difference(b)
    {
        return Spread::Analytic(sum);
    }
    // Slopes up to the sum of both spans occur, and one cell of margin holds the deposits.
    let span = (top.span() + bottom.span()).max(1e-9) * (1.0 + 4.0 / side as f64);
    let grid = |ndf: &Ndf, sign: f64| {
        let mut grid = Deposit::new(side, DVec2::ZERO, span);
        ndf.deposit(&mut grid, sign);
        grid
    };
    let (a, b) = (grid(top, 1.0), grid(bottom, -1.0));
    let sums = fft::convolve(&a.masses, &b.masses, side);
    // Node j of one and node k of the other grid lie at (j - side/2) and (k - side/2) cells.
    let half = side / 2;
    let shifted = |k: usize| {
        let (row, column) = ((k / side + half) % side, (k % side + half) % side);
        // The transform leaves rounding errors of either sign.
        if sums[row * side + column] > 1e-14 { sums[row * side + column] } else { 0.0 }
    };
    let masses = (0..side * side).map(shifted).collect();
    SlopeTable::only_density(side, a.origin, a.cell, masses)
        .map_or(Spread::Empty, |table| Spread::Table(Arc::new(table)))
}

#[cfg(test)]
#[path = "virtual_face_tests.rs"]
mod tests;
