//! Fits of analytic models to an effective BRDF, for programs that do not read tables, and the errors of the fits.
//!
//! Each model is a sum of lobes. If the shape of the lobes (edge, roughness, anisotropy) is fixed, the weights enter
//! linearly in each channel. The Nelder-Mead simplex of `argmin` searches the two to four numbers of the shape. For
//! each shape, non-negative least squares gives the weights.

mod gltf;
mod least_squares;
mod materialx;
mod models;
mod transmission;

use std::cell::Cell;

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Vec3};

use crate::base::progress::{in_parallel, part, report};
use crate::base::{Error, Progress, Result, require_finite};
use crate::effective::{EffectiveBrdf, Reflectance};
use crate::metrics::{Errors, Pair, compare, mirror_biased_pairs};

pub use gltf::gltf;
pub use materialx::materialx;
pub use models::{LobeShape, Model};
pub use transmission::{ThinFit, fit_slab, thin_gltf, thin_materialx};

use least_squares::NormalEquations;

/// Number of pairs that are fitted.
const FITTED: usize = 3000;
/// Number of other pairs, over which the error of the fit is measured.
const CHECKED: usize = 1000;
const SEED: u64 = 1997;
/// Simplex steps per start.
const STEPS: u64 = 150;
/// Evaluated shapes per call of the progress function.
const SHAPES_PER_REPORT: u64 = 16;

/// A fitted material.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    pub model: Model,
    pub shape: LobeShape,
    /// One weight per lobe of the model, linear RGB.
    pub weights: Vec<Vec3>,
    /// Errors of `f̄` over pairs that are not part of the fit.
    pub errors: Errors,
}

/// Fits `model` to `brdf` by least squares of `f̄` over directions up to 85° from the normal.
///
/// # Errors
/// [`Error::Cancelled`] if `progress` cancels; a value of the BRDF that is not finite; a search that fails.
pub fn fit(brdf: &EffectiveBrdf, model: Model, progress: &Progress<'_>) -> Result<Fit> {
    let (sampling, searching, checking) =
        (part(progress, 0.0, 0.3), part(progress, 0.3, 0.9), part(progress, 0.9, 1.0));
    let pairs = mirror_biased_pairs(FITTED, SEED);
    let targets = in_parallel(pairs.len(), &sampling, |k| brdf.eval(pairs[k].i, pairs[k].o))?;
    require_finite(&targets)?;
    let starts = model.starts();
    let problem = FitProblem { model, pairs, targets };
    let mut best: Option<(f64, Vec<f64>)> = None;
    for (k, start) in starts.iter().enumerate() {
        let fraction = |k: usize| k as f32 / starts.len() as f32;
        let progress = part(&searching, fraction(k), fraction(k + 1));
        report(&progress, 0.0)?;
        let search = ShapeSearch { problem: &problem, evaluated: Cell::new(0), progress: &progress };
        let solver = NelderMead::new(simplex(start));
        let run = Executor::new(&search, solver).configure(|state| state.max_iters(STEPS)).run().map_err(|error| {
            error.downcast::<Error>().unwrap_or_else(|error| Error::failed(format!("the fit fails: {error}")))
        })?;
        let (cost, parameters) = (run.state.get_best_cost(), run.state.get_best_param().cloned());
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, parameters.unwrap_or_else(|| start.clone())));
        }
    }
    let (_, parameters) = best.ok_or_else(|| Error::failed("the fit has no starting point"))?;
    let shape = model.shape(&parameters);
    let (weights, _) = problem.weights(&shape);
    let mut fit = Fit { model, shape, weights, errors: Errors { rel_l2: 0.0, psnr_db: f64::INFINITY } };
    let checked = mirror_biased_pairs(CHECKED, SEED + 1);
    let exact = in_parallel(checked.len(), &checking, |k| brdf.eval(checked[k].i, checked[k].o))?;
    let fitted: Vec<Vec3> = checked.iter().map(|pair| fit.f_bar(pair.i, pair.o)).collect();
    fit.errors = compare(&fitted, &exact);
    Ok(fit)
}

/// Returns the corners of a simplex with one corner at `start`.
fn simplex(start: &[f64]) -> Vec<Vec<f64>> {
    let mut corners = vec![start.to_vec()];
    for axis in 0..start.len() {
        let mut corner = start.to_vec();
        corner[axis] += 0.5;
        corners.push(corner);
    }
    corners
}

struct FitProblem {
    model: Model,
    pairs: Vec<Pair>,
    targets: Vec<Vec3>,
}

impl FitProblem {
    /// Returns the best weights for a shape and the residual sum of squares.
    fn weights(&self, shape: &LobeShape) -> (Vec<Vec3>, f64) {
        let count = self.model.lobes();
        let mut equations = NormalEquations::new(count);
        for (pair, target) in self.pairs.iter().zip(&self.targets) {
            let lobes = self.model.evaluate(shape, pair.i, pair.o);
            equations.add(&lobes.weighted, target.as_dvec3() - DVec3::splat(lobes.fixed));
        }
        equations.solve()
    }
}

/// The search for the shape from one starting point.
struct ShapeSearch<'a> {
    problem: &'a FitProblem,
    /// Number of evaluated shapes.
    evaluated: Cell<u64>,
    progress: &'a Progress<'a>,
}

impl CostFunction for &ShapeSearch<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, parameters: &Vec<f64>) -> std::result::Result<f64, argmin::core::Error> {
        let evaluated = self.evaluated.replace(self.evaluated.get() + 1);
        // The solver panics if an error occurs in its first simplex, so progress is not reported there.
        if evaluated > 0 && evaluated.is_multiple_of(SHAPES_PER_REPORT) {
            // Most simplex steps evaluate two shapes.
            report(self.progress, (evaluated as f32 / (2 * STEPS) as f32).min(1.0))?;
        }
        let (_, squares) = self.problem.weights(&self.problem.model.shape(parameters));
        Ok(squares)
    }
}

impl Fit {
    /// Returns `f̄` of the fitted material [1/sr], including the light's cosine.
    pub fn f_bar(&self, i: Vec3, o: Vec3) -> Vec3 {
        if i.z <= 0.0 || o.z <= 0.0 {
            return Vec3::ZERO;
        }
        let lobes = self.model.evaluate(&self.shape, i, o);
        let weighted =
            self.weights.iter().zip(&lobes.weighted).map(|(weight, lobe)| *weight * *lobe as f32).sum::<Vec3>();
        (weighted + Vec3::splat(lobes.fixed as f32)).max(Vec3::ZERO)
    }
}

impl Reflectance for Fit {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        for (out, light) in out.iter_mut().zip(lights) {
            *out = self.f_bar(*light, o);
        }
    }
}

#[cfg(test)]
mod tests;
