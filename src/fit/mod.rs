//! Parametric materials for pipelines without tables: the best few parameters, and what they lose.
//!
//! Each model is a sum of lobes whose weights enter linearly, in each channel, once its shape (roughness, anisotropy) is
//! fixed. The shape is searched by Nelder and Mead's simplex (argmin); for each shape tried the weights are the least
//! squares without negative ones, so nothing but two to four numbers is left to search.

mod gltf;
mod least_squares;
mod materialx;
mod models;

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::accuracy::{Errors, Pair, compare, mirror_biased_pairs};
use crate::error::{Error, Result};
use crate::filtering::{EffectiveBrdf, Reflectance};

pub use gltf::gltf;
pub use materialx::materialx;
pub use models::{Model, Shape};

use least_squares::Normal;

/// Pairs that are fitted, and others that tell how well.
const FITTED: usize = 3000;
const CHECKED: usize = 1000;
const SEED: u64 = 1997;
/// Steps of the simplex a start.
const STEPS: u64 = 150;

/// A fitted material.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    pub model: Model,
    pub shape: Shape,
    /// A weight a lobe of the model, linear RGB.
    pub weights: Vec<Vec3>,
    /// On pairs that were not fitted, `f̄`.
    pub errors: Errors,
}

/// The best fit of `model` to `brdf`, in least squares of `f̄` over directions up to 85°.
///
/// # Errors
/// The search fails, which no finite BRDF brings about.
pub fn fit(brdf: &EffectiveBrdf, model: Model) -> Result<Fit> {
    let pairs = mirror_biased_pairs(FITTED, SEED);
    let targets: Vec<Vec3> = pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect();
    let problem = Problem { model, pairs, targets };
    let mut best: Option<(f64, Vec<f64>)> = None;
    for start in model.starts() {
        let solver = NelderMead::new(simplex(&start));
        let run = Executor::new(&problem, solver)
            .configure(|state| state.max_iters(STEPS))
            .run()
            .map_err(|error| Error::failed(format!("the fit: {error}")))?;
        let (cost, shape) = (run.state.get_best_cost(), run.state.get_best_param().cloned().unwrap_or(start));
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, shape));
        }
    }
    let (_, parameters) = best.ok_or_else(|| Error::failed("the fit has nowhere to start"))?;
    let shape = model.shape(&parameters);
    let (weights, _) = problem.weights(&shape);
    let mut fit = Fit { model, shape, weights, errors: Errors { rel_l2: 0.0, psnr_db: f64::INFINITY } };
    let checked = mirror_biased_pairs(CHECKED, SEED + 1);
    let exact: Vec<Vec3> = checked.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect();
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
    fn weights(&self, shape: &Shape) -> (Vec<Vec3>, f64) {
        let count = self.model.lobes();
        let mut normal = Normal::new(count);
        for (pair, target) in self.pairs.iter().zip(&self.targets) {
            let lobes = self.model.evaluate(shape, pair.i, pair.o);
            normal.add(&lobes.weighted, target.as_dvec3() - DVec3::splat(lobes.fixed));
        }
        normal.solve()
    }
}

impl CostFunction for &Problem {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, parameters: &Vec<f64>) -> std::result::Result<f64, argmin::core::Error> {
        let (_, squares) = self.weights(&self.model.shape(parameters));
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
