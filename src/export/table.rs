//! The effective BRDF tabulated on a grid, and its bilinear interpolation.

use std::io;

use glam::Vec3;

use super::ReadingError;
use super::grid::ExportGrid;
use super::sampler::{in_parallel, reading_error};
use crate::base::Progress;
use crate::effective::{EffectiveBrdf, Reflectance};

/// The quantities of an exported file.
#[derive(Debug, Clone)]
pub struct ExportTable {
    pub grid: ExportGrid,
    /// `f̄ / cos θ_i` [1/sr] of each pair, viewer fastest.
    pub brdf: Vec<Vec3>,
    /// `G = a_v(o) f̄ / A` [1/sr], in the same order.
    pub g: Vec<Vec3>,
    /// `a_v(o) / A` of each view direction.
    pub projected_area: Vec<f32>,
}

impl ExportTable {
    /// Evaluates all pairs: views in parallel, and all lights of a view at once.
    ///
    /// # Errors
    /// The errors of [`in_parallel`].
    pub fn new(brdf: &EffectiveBrdf, grid: ExportGrid, progress: &Progress<'_>) -> io::Result<Self> {
        let (lights, views) = (grid.light.directions(), grid.view.directions());
        let mut table = Self {
            brdf: vec![Vec3::ZERO; grid.pairs()],
            g: vec![Vec3::ZERO; grid.pairs()],
            projected_area: Vec::new(),
            grid,
        };
        let columns = in_parallel(views.len(), progress, |view| {
            let mut f_bar = vec![Vec3::ZERO; lights.len()];
            brdf.eval_lights(&lights, views[view], &mut f_bar);
            (f_bar, brdf.relative_projected_area(views[view]))
        })?;
        for (view, (f_bar, area)) in columns.into_iter().enumerate() {
            for (light, value) in f_bar.into_iter().enumerate() {
                let entry = light * views.len() + view;
                // The grid has no direction at the horizon, so the cosine is not zero.
                table.brdf[entry] = value / lights[light].z;
                table.g[entry] = value * area;
            }
            table.projected_area.push(area);
        }
        Ok(table)
    }

    /// Returns `f̄(i, o)` as a program that loads the file computes it: the BRDF, bilinear in all four angles, times
    /// `cos θ_i`.
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

    /// Measures the error of the grid: [`ExportTable::f_bar`] against `eval`.
    pub fn resampling(&self, brdf: &EffectiveBrdf) -> ReadingError {
        reading_error(brdf, |i, o| self.f_bar(i, o))
    }
}
