//! The captured slab of one point: Eq. 11 with a tabulated virtual distribution of slopes.

use glam::{DVec2, DVec3};

use super::super::dual::{Configuration, blend, rough_bottom, rough_top};
use super::super::ellipse::Profile;
use super::super::ndf::Ndf;

/// A square grid of slopes from `-span` to `span` with one node in the middle of each cell, x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlopeGrid {
    pub side: usize,
    pub span: f64,
}

/// Nodes of a value between them, with their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    pub nodes: [u32; 9],
    pub weights: [f64; 9],
}

impl SlopeGrid {
    /// Distance of the nodes.
    pub fn cell(&self) -> f64 {
        2.0 * self.span / self.side as f64
    }

    /// Slope of a node.
    pub fn node(&self, k: usize) -> DVec2 {
        (DVec2::new((k % self.side) as f64, (k / self.side) as f64) + 0.5) * self.cell() - self.span
    }

    /// The biquadratic B-spline of a slope. A function whose logarithm is a quadratic, such as Beckmann's density, is one
    /// exactly. `None` in the outermost half cell and outside.
    pub fn stencil(&self, m: DVec2) -> Option<Stencil> {
        let at = (m + self.span) / self.cell() - 0.5;
        let nearest = at.round();
        let last = (self.side - 2) as f64;
        // NaN fails this comparison.
        if !(nearest.cmpge(DVec2::ONE).all() && nearest.cmple(DVec2::splat(last)).all()) {
            return None;
        }
        let t = at - nearest;
        let along = |t: f64| [0.5 * (0.5 - t).powi(2), 0.75 - t * t, 0.5 * (0.5 + t).powi(2)];
        let (x, y) = (along(t.x), along(t.y));
        let corner = (nearest.y as usize - 1) * self.side + nearest.x as usize - 1;
        let mut stencil = Stencil { nodes: [0; 9], weights: [0.0; 9] };
        for k in 0..9 {
            stencil.nodes[k] = (corner + k / 3 * self.side + k % 3) as u32;
            stencil.weights[k] = x[k % 3] * y[k / 3];
        }
        Some(stencil)
    }
}

impl Stencil {
    /// The value between the nodes.
    pub fn read(&self, values: &[f64]) -> f64 {
        self.nodes.iter().zip(&self.weights).map(|(node, weight)| weight * values[*node as usize]).sum()
    }
}

/// Everything of Eq. 11 at a pair of directions but the distribution of slopes and α: `ln A_t` and `ln A_b`, and the slopes
/// at which both configurations read the distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairTerms {
    pub ln_top: f64,
    pub ln_bottom: f64,
    pub slope_top: DVec2,
    /// The opposite of the slope of `h_b`: one ray has nearly opposite slopes in the two configurations.
    pub slope_bottom: DVec2,
}

/// Index of a captured slab and its masking: Smith's G of one GGX face (`α_b` of Sec. 4.2).
#[derive(Debug, Clone, PartialEq)]
pub struct LobeOptics {
    pub eta: f64,
    /// Roughness of the masking.
    pub shadowing: f64,
    face: Ndf,
}

impl LobeOptics {
    pub fn new(eta: f64, shadowing: f64) -> Self {
        Self { eta, shadowing, face: Ndf::analytic(Profile::Ggx, DVec2::splat(shadowing), 0.0) }
    }

    /// Masking of one rough face along two directions.
    pub fn masking(&self, a: DVec3, b: DVec3) -> f64 {
        self.face.seen(a) * self.face.seen(b)
    }

    /// The terms of a pair; `None` where one of the two configurations transmits nothing. The rough face masks the two
    /// directions that it sees: light and inside if it is the top, inside and viewer if it is the bottom.
    pub fn terms(&self, i: DVec3, o: DVec3) -> Option<PairTerms> {
        let (top, bottom) = (rough_top(i, o, self.eta)?, rough_bottom(i, o, self.eta)?);
        let value = |at: &Configuration, outside: DVec3| at.factor * self.masking(at.inner, outside);
        let (a_top, a_bottom) = (value(&top, i), value(&bottom, o));
        let is_sound = a_top > 0.0 && a_bottom > 0.0;
        is_sound.then(|| PairTerms {
            ln_top: a_top.ln(),
            ln_bottom: a_bottom.ln(),
            slope_top: top.slope,
            slope_bottom: -bottom.slope,
        })
    }
}

/// The model of one point, scaled by nothing: its distribution of slopes has the mass 1.
#[derive(Debug, Clone, PartialEq)]
pub struct PointModel {
    pub grid: SlopeGrid,
    pub alpha: f64,
    /// Coefficients of the biquadratic B-spline of the logarithm of the density.
    pub ln_density: Vec<f64>,
}

impl PointModel {
    /// Eq. 11 [1/sr] at the terms of a pair; 0 outside the grid of slopes.
    pub fn btdf(&self, terms: &PairTerms) -> f64 {
        let part = |ln_factor: f64, slope: DVec2| {
            self.grid.stencil(slope).map_or(0.0, |stencil| (ln_factor + stencil.read(&self.ln_density)).exp())
        };
        let top = part(terms.ln_top, terms.slope_top);
        blend(top, part(terms.ln_bottom, terms.slope_bottom), self.alpha)
    }

    /// Density of a slope.
    pub fn density(&self, m: DVec2) -> f64 {
        self.grid.stencil(m).map_or(0.0, |stencil| stencil.read(&self.ln_density).exp())
    }

    /// Mass of the density, mean slope and mean squares of the slopes along x and y about it.
    pub fn moments(&self) -> (f64, DVec2, DVec2) {
        let (mut mass, mut first, mut second) = (0.0, DVec2::ZERO, DVec2::ZERO);
        let side = 2 * self.grid.side;
        let cell = 0.5 * self.grid.cell();
        for k in 0..side * side {
            let m = (DVec2::new((k % side) as f64, (k / side) as f64) + 0.5) * cell - self.grid.span;
            let part = self.density(m) * cell * cell;
            mass += part;
            first += part * m;
            second += part * m * m;
        }
        if mass.is_nan() || mass <= 0.0 {
            return (0.0, DVec2::ZERO, DVec2::ZERO);
        }
        let mean = first / mass;
        (mass, mean, (second / mass - mean * mean).max(DVec2::ZERO))
    }

    /// Roughness of the isotropic Beckmann face with the same variance of slopes.
    pub fn roughness(&self) -> f64 {
        let (mut mass, mut first, mut second) = (0.0, DVec2::ZERO, 0.0);
        for (k, ln) in self.ln_density.iter().enumerate() {
            let (m, part) = (self.grid.node(k), ln.exp());
            mass += part;
            first += part * m;
            second += part * m.length_squared();
        }
        if mass > 0.0 { (second / mass - (first / mass).length_squared()).max(0.0).sqrt() } else { 0.0 }
    }

    /// Scales the density to the mass 1 and returns the mass that it had; 0 if it had none.
    pub fn normalise(&mut self) -> f64 {
        let mass = self.moments().0;
        if mass > 0.0 && mass.is_finite() {
            self.ln_density.iter_mut().for_each(|value| *value -= mass.ln());
            mass
        } else {
            0.0
        }
    }

    /// Part of the nodes' density outside the square of `part` of the span.
    pub fn outside(&self, part: f64) -> f64 {
        let (mut outside, mut all) = (0.0, 0.0);
        for (k, ln) in self.ln_density.iter().enumerate() {
            let density = ln.exp();
            all += density;
            if self.grid.node(k).abs().max_element() > part * self.grid.span {
                outside += density;
            }
        }
        if all > 0.0 { outside / all } else { 0.0 }
    }

    /// Relative L2 of the density and the density turned by 180°, over 2: 0 for a point-symmetric distribution.
    pub fn skewness(&self) -> f64 {
        let last = self.ln_density.len() - 1;
        let (mut difference, mut norm) = (0.0, 0.0);
        for (k, value) in self.ln_density.iter().enumerate() {
            let (a, b) = (value.exp(), self.ln_density[last - k].exp());
            difference += 0.25 * (a - b).powi(2);
            norm += a * a;
        }
        if norm > 0.0 { (difference / norm).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub fn beckmann(grid: SlopeGrid, roughness: DVec2, alpha: f64) -> PointModel {
        let ln = |m: DVec2| -(m / roughness).length_squared() - (std::f64::consts::PI * roughness.x * roughness.y).ln();
        // A quadratic B-spline lies a quarter of the squared cell times half the second derivative above its coefficients.
        let lift = grid.cell().powi(2) / 8.0 * 2.0 * (1.0 / (roughness * roughness)).element_sum();
        let ln_density = (0..grid.side * grid.side).map(|k| ln(grid.node(k)) + lift).collect();
        PointModel { grid, alpha, ln_density }
    }

    #[test]
    fn a_gaussian_is_a_spline_exactly_and_its_moments_are_those_of_its_roughness() {
        let grid = SlopeGrid { side: 32, span: 1.0 };
        let roughness = DVec2::new(0.2, 0.3);
        let model = beckmann(grid, roughness, 0.5);
        let face = Ndf::analytic(Profile::Beckmann, roughness, 0.0);
        for k in 0..50 {
            let m = 0.4 * DVec2::new((1.7 * f64::from(k)).sin(), (2.3 * f64::from(k)).cos());
            assert!((model.density(m) / face.density(m) - 1.0).abs() < 1e-9, "{m}");
        }
        let (mass, mean, squares) = model.moments();
        assert!((mass - 1.0).abs() < 1e-3 && mean.length() < 1e-9, "{mass}");
        assert!((squares - 0.5 * roughness * roughness).length() < 1e-3, "{squares}");
        assert!(model.skewness() < 1e-12);
    }

    #[test]
    fn slopes_outside_the_grid_and_nan_have_no_density() {
        let model = beckmann(SlopeGrid { side: 8, span: 0.5 }, DVec2::splat(0.2), 0.5);
        for m in [DVec2::splat(0.5), DVec2::new(9.0, 0.0), DVec2::NAN, DVec2::new(f64::INFINITY, 0.0)] {
            assert_eq!(model.density(m), 0.0);
        }
    }
}
