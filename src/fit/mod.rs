//! Parametric materials for pipelines without tables: the best few parameters, and what they lose.
//!
//! Each model is a sum of lobes whose weights enter linearly, in each channel, once its shape (roughness, anisotropy) is
//! fixed. The shape is searched by Nelder and Mead's simplex (argmin); for each shape tried the weights are the least
//! squares without negative ones, so nothing but two to four numbers is left to search.

mod gltf;
mod least_squares;
mod materialx;
mod models;

use std::cell::Cell;

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Vec3};

use crate::base::progress::{in_parallel, part, tell};
use crate::base::{Error, Progress, Result};
use crate::effective::{EffectiveBrdf, Reflectance};
use crate::metrics::{Errors, Pair, compare, mirror_biased_pairs};

pub use gltf::gltf;
pub use materialx::materialx;
pub use models::{LobeShape, Model};

use least_squares::Normal;

/// Pairs that are fitted, and others that tell how well.
const FITTED: usize = 3000;
const CHECKED: usize = 1000;
const SEED: u64 = 1997;
/// Steps of the simplex a start.
const STEPS: u64 = 150;
/// Shapes tried between two calls of the progress function.
const TRIED_A_STEP: u64 = 16;

/// A fitted material.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    pub model: Model,
    pub shape: LobeShape,
    /// A weight a lobe of the model, linear RGB.
    pub weights: Vec<Vec3>,
    /// On pairs that were not fitted, `f̄`.
    pub errors: Errors,
}

/// The best fit of `model` to `brdf`, in least squares of `f̄` over directions up to 85°.
///
/// # Errors
/// [`Error::Cancelled`] when `progress` says so; a search that fails, which no finite BRDF brings about.
pub fn fit(brdf: &EffectiveBrdf, model: Model, progress: &Progress<'_>) -> Result<Fit> {
    let (looking, searching, checking) = (part(progress, 0.0, 0.3), part(progress, 0.3, 0.9), part(progress, 0.9, 1.0));
    let pairs = mirror_biased_pairs(FITTED, SEED);
    let targets = in_parallel(pairs.len(), &looking, |k| brdf.eval(pairs[k].i, pairs[k].o))?;
    let starts = model.starts();
    let problem = Problem { model, pairs, targets };
    let mut best: Option<(f64, Vec<f64>)> = None;
    for (k, start) in starts.iter().enumerate() {
        let of_all = |k: usize| k as f32 / starts.len() as f32;
        let progress = part(&searching, of_all(k), of_all(k + 1));
        tell(&progress, 0.0)?;
        let search = Search { problem: &problem, asked: Cell::new(0), progress: &progress };
        let solver = NelderMead::new(simplex(start));
        let run = Executor::new(&search, solver).configure(|state| state.max_iters(STEPS)).run().map_err(|error| {
            error.downcast::<Error>().unwrap_or_else(|error| Error::failed(format!("the fit: {error}")))
        })?;
        let (cost, shape) = (run.state.get_best_cost(), run.state.get_best_param().cloned());
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, shape.unwrap_or_else(|| start.clone())));
        }
    }
    let (_, parameters) = best.ok_or_else(|| Error::failed("the fit has nowhere to start"))?;
    let shape = model.shape(&parameters);
    let (weights, _) = problem.weights(&shape);
    let mut fit = Fit { model, shape, weights, errors: Errors { rel_l2: 0.0, psnr_db: f64::INFINITY } };
    let checked = mirror_biased_pairs(CHECKED, SEED + 1);
    let exact = in_parallel(checked.len(), &checking, |k| brdf.eval(checked[k].i, checked[k].o))?;
    let found: Vec<Vec3> = checked.iter().map(|pair| fit.f_bar(pair.i, pair.o)).collect();
    fit.errors = compare(&found, &exact);
    Ok(fit)
}

/// A simplex about a place.
fn simplex(start: &[f64]) -> Vec<Vec<f64>> {
    let mut corners = vec![start.to_vec()];
    for axis in 0..start.len() {
        let mut corner = start.to_vec();
        corner[axis] += 0.5;
        corners.push(corner);
    }
    corners
}

struct Problem {
    model: Model,
    pairs: Vec<Pair>,
    targets: Vec<Vec3>,
}

impl Problem {
    /// The best weights for a shape, and the squares that are left.
    fn weights(&self, shape: &LobeShape) -> (Vec<Vec3>, f64) {
        let count = self.model.lobes();
        let mut normal = Normal::new(count);
        for (pair, target) in self.pairs.iter().zip(&self.targets) {
            let lobes = self.model.evaluate(shape, pair.i, pair.o);
            normal.add(&lobes.weighted, target.as_dvec3() - DVec3::splat(lobes.fixed));
        }
        normal.solve()
    }
}

/// One search for the shape.
struct Search<'a> {
    problem: &'a Problem,
    /// Shapes tried.
    asked: Cell<u64>,
    progress: &'a Progress<'a>,
}

impl CostFunction for &Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, parameters: &Vec<f64>) -> std::result::Result<f64, argmin::core::Error> {
        let asked = self.asked.replace(self.asked.get() + 1);
        // Not at the corners of the first simplex: there the solver panics at an error.
        if asked > 0 && asked.is_multiple_of(TRIED_A_STEP) {
            // A step of the simplex tries two shapes, most of the time.
            tell(self.progress, (asked as f32 / (2 * STEPS) as f32).min(1.0))?;
        }
        let (_, squares) = self.problem.weights(&self.problem.model.shape(parameters));
        Ok(squares)
    }
}

impl Fit {
    /// `f̄` of the fitted material [1/sr], the light's cosine included.
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
