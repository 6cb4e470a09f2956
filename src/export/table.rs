//! The effective BRDF on the grid of a table, and reading it back bilinearly.

use glam::Vec3;
use rayon::prelude::*;

use super::grid::Grid;
use crate::accuracy::{Errors, compare, mirror_biased_pairs};
use crate::filtering::{EffectiveBrdf, Reflectance};

/// Views between two calls of the progress function.
const VIEWS_A_STEP: usize = 32;
/// Pairs of the resampling error, and the seed that fixes them.
const CHECKED_PAIRS: usize = 200;
const CHECKED_SEED: u64 = 2011;

/// What a file holds.
#[derive(Debug, Clone)]
pub struct Table {
    pub grid: Grid,
    /// `f̄ / cos θ_i` [1/sr] of each pair, viewer fastest.
    pub brdf: Vec<Vec3>,
    /// `G = a_v(o) f̄ / A` [1/sr], in the same order.
    pub g: Vec<Vec3>,
    /// `a_v(o) / A` of each viewing direction.
    pub projected_area: Vec<f32>,
}

impl Table {
    /// Evaluates all pairs: all lights of a view at once, views in parallel.
    pub fn new(brdf: &EffectiveBrdf, grid: Grid, progress: &dyn Fn(f32)) -> Self {
        let (lights, views) = (grid.light.directions(), grid.view.directions());
        let mut table = Self {
            brdf: vec![Vec3::ZERO; grid.pairs()],
            g: vec![Vec3::ZERO; grid.pairs()],
            projected_area: Vec::new(),
            grid,
        };
        for (step, chunk) in views.chunks(VIEWS_A_STEP).enumerate() {
            let first = step * VIEWS_A_STEP;
            progress(first as f32 / views.len() as f32);
            let columns: Vec<(Vec<Vec3>, f32)> = chunk
                .par_iter()
                .map(|&o| {
                    let mut f_bar = vec![Vec3::ZERO; lights.len()];
                    brdf.eval_lights(&lights, o, &mut f_bar);
                    (f_bar, brdf.relative_projected_area(o))
                })
                .collect();
            for (column, (f_bar, area)) in columns.iter().enumerate() {
                for (light, &value) in f_bar.iter().enumerate() {
                    let entry = light * views.len() + first + column;
                    // Midpoints keep the cosine away from zero.
                    table.brdf[entry] = value / lights[light].z;
                    table.g[entry] = value * *area;
                }
                table.projected_area.push(*area);
            }
        }
        progress(1.0);
        table
    }

    /// `f̄(i, o)` as a program that loads the file would read it: the BRDF bilinearly in all four angles, times `cos θ_i`.
    pub fn f_bar(&self, i: Vec3, o: Vec3) -> Vec3 {
        let views = self.grid.view.len();
        let view_taps = self.grid.view.taps(o);
        let mut value = Vec3::ZERO;
        for (light, light_weight) in self.grid.light.taps(i) {
            for (view, view_weight) in view_taps {
                value += self.brdf[light * views + view] * (light_weight * view_weight);
            }
        }
        value * i.z
    }

    /// What the grid costs: [`Table::f_bar`] against `eval` over a fixed set of pairs up to 85°.
    pub fn resampling(&self, brdf: &EffectiveBrdf) -> Errors {
        let pairs = mirror_biased_pairs(CHECKED_PAIRS, CHECKED_SEED);
        let read: Vec<Vec3> = pairs.iter().map(|pair| self.f_bar(pair.i, pair.o)).collect();
        let exact: Vec<Vec3> = pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect();
        compare(&read, &exact)
    }
}
