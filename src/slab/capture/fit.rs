//! The virtual distribution of slopes of one point by log least squares (Dai et al. 2009, Eqs. 15 to 17 and 19).

use glam::DVec3;

use super::lobe::{LobeOptics, PointModel, SlopeGrid, Stencil};
use crate::math::linalg::skyline::Skyline;

/// One direction of the light with the BTDF of the point there, without its diffuse part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub i: DVec3,
    /// Irradiance of a dot of intensity 1. It is also the solid angle that the sample stands for, up to a common factor.
    pub irradiance: f64,
    /// BTDF [1/sr]. Values that are not a number are ignored.
    pub btdf: f64,
}

/// The samples of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Direction to the camera, below the sheet.
    pub o: DVec3,
    pub samples: Vec<Sample>,
}

/// A sample inside the grid of slopes, as an equation of Eq. 16.
#[derive(Clone)]
pub(super) struct Equation {
    pub ln_top: f64,
    pub ln_bottom: f64,
    pub top: Stencil,
    pub bottom: Stencil,
    /// Logarithm of the measured BTDF, bounded below or [linearised](PointFit::linearised).
    pub ln_btdf: f64,
    /// `ρ / (ρ + floor)`, where ρ is the measured BTDF or, once linearised, that of the first solution: equal weights would
    /// let dark dots decide. The floor is a part of the peak, of the BTDF and of the
    /// radiance: what a camera adds to all pixels is large in the BTDF of dots that shine weakly.
    pub weight: f64,
    /// BTDF [1/sr].
    pub floor: f64,
    pub sample: Sample,
}

impl Equation {
    /// Logarithm of the model (Eq. 11).
    pub fn ln_model(&self, alpha: f64, x: &[f64]) -> f64 {
        let mut value = 0.0;
        if alpha > 0.0 {
            value += alpha * (self.ln_top + self.top.read(x));
        }
        if alpha < 1.0 {
            value += (1.0 - alpha) * (self.ln_bottom + self.bottom.read(x));
        }
        value
    }
}

/// Point symmetry of the distribution (Eq. 19).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// A slope and its opposite share an unknown.
    Exact,
    /// Only nodes that no sample reaches follow their opposites.
    WhereUnseen,
}

/// Fraction of the peak at which a sample has the weight 1/2.
const FLOOR: f64 = 0.01;
/// Least BTDF in the logarithm, over the floor.
const LEAST: f64 = 0.1;
/// Logarithm of the density at the rim over its peak. The paper sets the rim to 1e-6.
const RIM: f64 = -10.0;
/// Sum of squared factors of a node above which samples see it. Dark samples count: they say that the density is small.
const SEEN: f64 = 0.02;
/// Weight of the equations that tie unseen nodes to their opposites.
const UNSEEN_WEIGHT: f64 = 0.1;

/// The equations of one point.
pub struct PointFit {
    pub grid: SlopeGrid,
    pub(super) equations: Vec<Equation>,
    /// Logarithm of the density of the rim.
    rim: f64,
    pub views: usize,
}

impl PointFit {
    /// The equations of the samples of all cameras. `None` if no sample above 0 lies in the grid of slopes.
    pub fn new(views: &[View], optics: &LobeOptics, grid: SlopeGrid) -> Option<Self> {
        let mut equations = Vec::new();
        let mut peak_density = f64::MIN;
        for View { o, samples } in views {
            let peak = |value: &dyn Fn(&Sample) -> f64| {
                samples.iter().map(value).filter(|value| value.is_finite()).fold(0.0, f64::max)
            };
            let (peak, brightest) = (peak(&|sample| sample.btdf), peak(&|sample| sample.btdf * sample.irradiance));
            if peak <= 0.0 {
                continue;
            }
            for sample in samples.iter().filter(|sample| sample.btdf.is_finite()) {
                let Some(terms) = optics.terms(sample.i, *o) else { continue };
                let stencils = (grid.stencil(terms.slope_top), grid.stencil(terms.slope_bottom));
                let (Some(top), Some(bottom)) = stencils else { continue };
                let floor = FLOOR * peak.max(brightest / sample.irradiance.max(f64::MIN_POSITIVE));
                if !floor.is_finite() {
                    continue;
                }
                let ln_btdf = sample.btdf.max(LEAST * floor).ln();
                let btdf = sample.btdf.max(0.0);
                let weight = btdf / (btdf + floor);
                if weight > 0.5 {
                    peak_density = peak_density.max(ln_btdf - 0.5 * (terms.ln_top + terms.ln_bottom));
                }
                let (ln_top, ln_bottom) = (terms.ln_top, terms.ln_bottom);
                equations.push(Equation { ln_top, ln_bottom, top, bottom, ln_btdf, weight, floor, sample: *sample });
            }
        }
        (peak_density > f64::MIN).then_some(Self { grid, equations, rim: peak_density + RIM, views: views.len() })
    }

    /// Solves Eqs. 16 and 17 for the logarithm of the density at the nodes, whose mass is the scale of the lobe. `smooth` is
    /// the weight of Eq. 17. Equations for which `takes_part` is false are left out. `None` if no solution exists.
    pub fn solve(
        &self,
        alpha: f64,
        smooth: f64,
        symmetry: Symmetry,
        takes_part: impl Fn(usize) -> bool,
    ) -> Option<Vec<f64>> {
        let unknowns = Unknowns::new(self.grid.side, symmetry);
        let mut rows = Vec::new();
        let mut seen = vec![0.0; self.grid.side * self.grid.side];
        for (_, equation) in self.equations.iter().enumerate().filter(|(k, _)| takes_part(*k)) {
            let entries = entries(equation, alpha);
            entries.iter().for_each(|(node, factor)| seen[*node] += factor * factor);
            let known = alpha * equation.ln_top + (1.0 - alpha) * equation.ln_bottom;
            rows.push(unknowns.row(&entries, equation.ln_btdf - known, equation.weight, self.rim));
        }
        self.smoothness(&unknowns, smooth, &mut rows);
        if symmetry == Symmetry::WhereUnseen {
            let last = seen.len() - 1;
            for node in (0..seen.len() / 2).filter(|node| seen[*node].min(seen[last - node]) < SEEN) {
                rows.push(unknowns.row(&[(node, 1.0), (last - node, -1.0)], 0.0, UNSEEN_WEIGHT, self.rim));
            }
        }
        let solution = unknowns.solve(&rows)?;
        solution.iter().all(|value| value.is_finite()).then(|| unknowns.spread(&solution, self.rim))
    }

    /// Eq. 17 at every inner node.
    fn smoothness(&self, unknowns: &Unknowns, smooth: f64, rows: &mut Vec<Row>) {
        let side = self.grid.side;
        for node in (0..side * side).filter(|node| is_inner(*node, side)) {
            let neighbours = [node - 1, node + 1, node - side, node + side].map(|other| (other, -1.0));
            let entries: Vec<_> = std::iter::once((node, 4.0)).chain(neighbours).collect();
            rows.push(unknowns.row(&entries, 0.0, smooth, self.rim));
        }
    }

    /// The symmetry of the first solution: exact for one camera, which cannot tell α from skewness.
    pub fn symmetry(&self) -> Symmetry {
        if self.views > 1 { Symmetry::WhereUnseen } else { Symmetry::Exact }
    }

    /// The weighted sum of squares of Eq. 15 over the equations for which `takes_part` is true, and the sum of the weights.
    pub fn misfit(&self, alpha: f64, x: &[f64], takes_part: impl Fn(usize) -> bool) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for (_, equation) in self.equations.iter().enumerate().filter(|(k, _)| takes_part(*k)) {
            let error = equation.weight * (equation.ln_model(alpha, x) - equation.ln_btdf);
            sums.0 += error * error;
            sums.1 += equation.weight * equation.weight;
        }
        sums
    }

    /// The equations with each logarithm linearised about a first solution, and weighted by it: noise makes the mean of
    /// logarithms too small, and a sample that it makes brighter would weigh more than one that it makes darker. Samples
    /// above twice the solution stay as they are.
    pub fn linearised(&self, alpha: f64, x: &[f64]) -> Self {
        let mut equations = self.equations.clone();
        for equation in &mut equations {
            let ln_model = equation.ln_model(alpha, x);
            let model = ln_model.exp();
            let excess = equation.sample.btdf / model - 1.0;
            if excess < 1.0 {
                equation.ln_btdf = ln_model + excess;
                equation.weight = model / (model + equation.floor);
            }
        }
        Self { equations, ..*self }
    }

    /// Relative L2 of the model against the samples.
    pub fn residual(&self, alpha: f64, x: &[f64]) -> f64 {
        let (mut difference, mut norm) = (0.0, 0.0);
        for equation in &self.equations {
            let btdf = equation.sample.btdf;
            difference += (equation.ln_model(alpha, x).exp() - btdf).powi(2);
            norm += btdf * btdf;
        }
        if norm > 0.0 { (difference / norm).sqrt() } else { 0.0 }
    }

    /// The model of a solution, of mass 1, and its scale `k_s` (Eq. 13).
    pub fn model(&self, alpha: f64, x: Vec<f64>) -> (PointModel, f64) {
        let mut model = PointModel { grid: self.grid, alpha, ln_density: x };
        let scale = model.normalise();
        (model, scale)
    }
}

/// The nodes of Eq. 16 with their factors.
fn entries(equation: &Equation, alpha: f64) -> Vec<(usize, f64)> {
    let of = |stencil: &Stencil, part: f64| {
        let entry = move |(node, weight): (&u32, &f64)| (*node as usize, part * weight);
        stencil.nodes.iter().zip(&stencil.weights).map(entry).collect::<Vec<_>>()
    };
    let mut all = of(&equation.top, alpha);
    all.extend(of(&equation.bottom, 1.0 - alpha));
    all.retain(|(_, factor)| *factor != 0.0);
    all
}

fn is_inner(node: usize, side: usize) -> bool {
    let inside = |at: usize| at > 0 && at + 1 < side;
    inside(node % side) && inside(node / side)
}

/// A weighted equation: factors of unknowns, and the right side.
struct Row {
    factors: Vec<(usize, f64)>,
    right: f64,
}

/// The unknowns: inner nodes, of which opposite ones may share one.
struct Unknowns {
    /// Unknown of each node; `None` on the rim.
    of_node: Vec<Option<usize>>,
    count: usize,
}

impl Unknowns {
    fn new(side: usize, symmetry: Symmetry) -> Self {
        let nodes = side * side;
        let mut of_node = vec![None; nodes];
        let mut count = 0;
        for node in (0..nodes).filter(|node| is_inner(*node, side)) {
            let opposite = nodes - 1 - node;
            of_node[node] = match of_node[opposite] {
                Some(known) if symmetry == Symmetry::Exact => Some(known),
                _ => {
                    count += 1;
                    Some(count - 1)
                }
            };
        }
        Self { of_node, count }
    }

    /// An equation of nodes, times `weight`. Nodes of the rim go to the right side.
    fn row(&self, entries: &[(usize, f64)], right: f64, weight: f64, rim: f64) -> Row {
        let mut row = Row { factors: Vec::with_capacity(entries.len()), right: weight * right };
        for (node, factor) in entries {
            match self.of_node[*node] {
                Some(unknown) => row.factors.push((unknown, weight * factor)),
                None => row.right -= weight * factor * rim,
            }
        }
        row
    }

    /// Least squares of all rows by their normal equations.
    fn solve(&self, rows: &[Row]) -> Option<Vec<f64>> {
        /// Added to the diagonal.
        const DAMPING: f64 = 1e-9;
        let mut first: Vec<usize> = (0..self.count).collect();
        for row in rows {
            let Some(least) = row.factors.iter().map(|(unknown, _)| *unknown).min() else { continue };
            row.factors.iter().for_each(|(unknown, _)| first[*unknown] = first[*unknown].min(least));
        }
        let mut matrix = Skyline::new(first);
        let mut right = vec![0.0; self.count];
        (0..self.count).for_each(|k| matrix.add(k, k, DAMPING));
        for row in rows {
            for (k, (a, factor)) in row.factors.iter().enumerate() {
                right[*a] += factor * row.right;
                matrix.add(*a, *a, factor * factor);
                for (b, other) in &row.factors[..k] {
                    // Two nodes of one unknown meet twice on the diagonal.
                    let times = if a == b { 2.0 } else { 1.0 };
                    matrix.add(*a, *b, times * factor * other);
                }
            }
        }
        matrix.solve(right)
    }

    /// Values of the unknowns at all nodes.
    fn spread(&self, solution: &[f64], rim: f64) -> Vec<f64> {
        self.of_node.iter().map(|unknown| unknown.map_or(rim, |unknown| solution[unknown])).collect()
    }
}
