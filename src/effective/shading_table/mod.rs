//! The shading table: the sum over facets tabulated over half and difference angles, for rendering, which evaluates
//! millions of pairs. Factors that are known exactly at the query are not part of the table.
//!
//! `a_v f̄ = Σ_c w_c(i,o) T_c(i,o)`. A column `T_c` is the sum of one lobe over one group of facets, without its tint.
//! On groups with few distinct normals it is the visible area of one normal cluster, whose lobe is part of the exact
//! weight `w_c`, so that only smooth functions are interpolated. Colours are in the weights, so an edit of a colour
//! keeps the table.

pub(crate) mod columns;
pub(crate) mod content;
#[cfg(test)]
mod half_floats_tests;
pub(crate) mod sampled_facets;

use std::sync::Arc;

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use self::columns::{Column, Weight};
use super::{Direct, FacetSum, Interpolation, Tint};
use crate::base::{Cancel, Result};
use crate::math::directions::{GridCoordinates, HemispherePairGrid, PolarGrid};
use crate::math::simd::{PairVectors, RowGrid};
use crate::math::{directions, simd};
use crate::metrics::Pair;

/// A table of columns over direction pairs, and the weights that multiply the columns.
#[derive(Debug, Clone)]
pub struct ShadingTable {
    pub grid: HemispherePairGrid,
    /// Interpolation along θ_d; along the other axes it is linear.
    pub interpolation: Interpolation,
    weights: Vec<Weight>,
    /// As `weights`, but 0 for all columns except those of [`ShadingTable::plus_bounced`]; empty without these.
    bounced_weights: Vec<Weight>,
    /// Groups of four columns per node.
    vec4s: usize,
    /// `[θ_h][φ_h][φ_d][θ_d][vec4]`, with one more node of θ_d at either end than the grid has, so that a cubic has
    /// four nodes everywhere. The node before the first mirrors the second; the one after the last extrapolates
    /// linearly.
    values: Arc<Vec<Vec4>>,
    /// `a_v(o) / cos θ_o` on the nodes of a polar grid.
    areas: Arc<(PolarGrid, Vec<f32>)>,
}

/// The grid of a shading table, and how its nodes are computed.
#[derive(Debug, Clone, Copy)]
pub struct Nodes<'a> {
    pub grid: HemispherePairGrid,
    /// Planes x = const and y = const that map the tile to itself. With them, a half or a quarter of the nodes is
    /// computed.
    pub mirrors: [bool; 2],
    /// Approximate number of facets in the subset of each half vector; `None` sums over all facets.
    pub facets: Option<usize>,
    /// Pairs that the table will be evaluated at; nodes that they do not read stay zero. `None` computes all nodes.
    pub read_by: Option<&'a [Pair]>,
    /// Pairs, and a table of the nodes that they read. These nodes are taken from it; all else must be equal.
    pub known: Option<(&'a [Pair], &'a ShadingTable)>,
}

impl Nodes<'_> {
    /// Computes every node from all facets.
    pub fn all(grid: HemispherePairGrid) -> Self {
        Self { grid, mirrors: [false; 2], facets: None, read_by: None, known: None }
    }
}

/// The eight rows of θ_d around a point of the grid, and the step of θ_d below it: the rows that [`simd::row_sums`]
/// reads.
fn rows_around(grid: &HemispherePairGrid, [ring, azimuth, phi_d, step]: [f32; 4]) -> ([usize; 8], usize) {
    let around = |at: f32, count: usize| {
        let low = (at as usize).min(count - 1);
        [low, if low + 1 == count { 0 } else { low + 1 }]
    };
    let ring = (ring as usize).min(grid.rings - 2);
    let (azimuths, phi_ds) = (around(azimuth, grid.azimuths), around(phi_d, grid.phi_d));
    let row = |k: usize| ((ring + (k >> 2)) * grid.azimuths + azimuths[k >> 1 & 1]) * grid.phi_d + phi_ds[k & 1];
    (std::array::from_fn(row), (step as usize).min(grid.theta_d - 2))
}

/// Marks the nodes that these pairs read. For mirror images, it marks their originals.
fn nodes_read(grid: &HemispherePairGrid, images: &[(usize, bool)], pairs: &[Pair]) -> Vec<bool> {
    let mut read = vec![false; grid.nodes()];
    let mut coordinates = GridCoordinates::default();
    for Pair { i, o } in pairs {
        grid.coordinates([&[i.x], &[i.y], &[i.z]], *o, &mut coordinates);
        let (rows, low) = rows_around(grid, coordinates.at(0));
        for row in rows {
            let (half_vector, phi_d) = (row / grid.phi_d, row % grid.phi_d);
            let (image, negated) = images[half_vector % grid.azimuths];
            let phi_d = if negated { (grid.phi_d - phi_d) % grid.phi_d } else { phi_d };
            let row = (half_vector / grid.azimuths * grid.azimuths + image) * grid.phi_d + phi_d;
            let steps = low.saturating_sub(1)..(low + 3).min(grid.theta_d);
            read[row * grid.theta_d..][steps].fill(true);
        }
    }
    read
}

/// Rings and azimuths of the grid of projected areas.
const AREA_GRID: [usize; 2] = [30, 72];

impl ShadingTable {
    /// Returns true if a table can hold a sum: if its columns are few enough.
    pub(crate) fn can_hold(sum: &FacetSum) -> bool {
        Column::of(sum).is_some()
    }

    /// Tabulates a sum over facets. `None` if the sum has too many columns for a table to pay.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn build(direct: &Direct, nodes: Nodes, cancel: &Cancel) -> Result<Option<Self>> {
        let Some(columns) = Column::of(&direct.sum) else { return Ok(None) };
        let weights: Vec<Weight> = columns.iter().map(|column| column.weight(&direct.sum)).collect();
        let mirrors = Weight::mirrors(&weights, nodes.mirrors);
        let (nodes, facets) = (Nodes { mirrors, ..nodes }, nodes.facets);
        let area = |o: Vec3| direct.sums(&[], o, |_, _| {});
        let sampled = |h: Vec3| facets.and_then(|count| direct.sampled_about(h, count));
        let table = Self::tabulate(nodes, weights, area, cancel, sampled, |sampled, i, o, sums| {
            let direct = sampled.as_ref().unwrap_or(direct);
            let pair = PairVectors::new(i, o);
            direct.with_visibility(i, o, |v_i, v_o| {
                Column::sums(&columns, &direct.sum, &pair, v_i, v_o, sums);
            });
        });
        table.map(Some)
    }

    /// Tabulates the values of another representation, colours included.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn resample(
        sums: impl Fn(&[Vec3], Vec3, &mut [DVec3]) -> f64 + Sync,
        nodes: Nodes,
        cancel: &Cancel,
    ) -> Result<Self> {
        let weights = Vec3::AXES.map(|color| Weight::Tint(Tint::Fixed(color))).to_vec();
        let area = |o: Vec3| sums(&[], o, &mut []);
        Self::tabulate(
            nodes,
            weights,
            area,
            cancel,
            |_| (),
            |(), i, o, out| {
                let mut sum = [DVec3::ZERO];
                sums(&[i], o, &mut sum);
                out[..3].copy_from_slice(&sum[0].as_vec3().to_array());
            },
        )
    }

    /// Fills a table. `prepare` receives each half vector, `fill` writes the columns of a pair about it, and `area`
    /// returns `a_v(o)`.
    fn tabulate<P>(
        Nodes { grid, mirrors, read_by, known, .. }: Nodes,
        weights: Vec<Weight>,
        area: impl Fn(Vec3) -> f64 + Sync,
        cancel: &Cancel,
        prepare: impl Fn(Vec3) -> P + Sync,
        fill: impl Fn(&P, Vec3, Vec3, &mut [f32]) + Sync,
    ) -> Result<Self> {
        let (vec4s, stored) = (weights.len().div_ceil(4), grid.theta_d + 2);
        let mut values = match known {
            Some((_, table)) => table.values.to_vec(),
            None => vec![Vec4::ZERO; grid.half_vectors() * grid.phi_d * stored * vec4s],
        };
        let (row_len, half_vector_len) = (stored * vec4s, grid.phi_d * stored * vec4s);
        let images: Vec<(usize, bool)> = (0..grid.azimuths).map(|azimuth| grid.image(azimuth, mirrors)).collect();
        let read = read_by.map(|pairs| nodes_read(&grid, &images, pairs));
        let known = known.map(|(pairs, _)| nodes_read(&grid, &images, pairs));
        let is_read = |node: usize| {
            read.as_ref().is_none_or(|read| read[node]) && !known.as_ref().is_some_and(|known| known[node])
        };
        let half_vectors = values.par_chunks_mut(half_vector_len).enumerate();
        half_vectors.try_for_each(|(half_vector, nodes)| {
            cancel.check()?;
            cancel.step(grid.half_vectors());
            let first = half_vector * grid.phi_d * grid.theta_d;
            if images[half_vector % grid.azimuths].0 != half_vector % grid.azimuths
                || !(first..first + grid.phi_d * grid.theta_d).any(is_read)
            {
                return Ok(());
            }
            let (i, o) = grid.pair(first);
            let prepared = prepare(directions::half_vector(i, o));
            let mut sums = vec![0.0; 4 * vec4s];
            // At θ_d = 0 both directions of a pair are the half vector, whatever φ_d is.
            let mut along_half_vector: Option<Vec<f32>> = None;
            for (phi_d, row) in nodes.chunks_mut(row_len).enumerate() {
                for step in 0..grid.theta_d {
                    let node = first + phi_d * grid.theta_d + step;
                    if !is_read(node) {
                        continue;
                    }
                    if let Some(known) = along_half_vector.as_ref().filter(|_| step == 0) {
                        sums.copy_from_slice(known);
                    } else {
                        let (i, o) = grid.pair(node);
                        fill(&prepared, i, o, &mut sums[..weights.len()]);
                    }
                    if step == 0 {
                        along_half_vector.get_or_insert_with(|| sums.clone());
                    }
                    for (node, sums) in row[(step + 1) * vec4s..].iter_mut().zip(sums.as_chunks::<4>().0) {
                        *node = Vec4::from_array(*sums);
                    }
                }
                for vec4 in 0..vec4s {
                    let at = |step: usize| step * vec4s + vec4;
                    row[at(0)] = row[at(2)];
                    row[at(grid.theta_d + 1)] = 2.0 * row[at(grid.theta_d)] - row[at(grid.theta_d - 1)];
                }
            }
            Ok::<_, crate::base::Error>(())
        })?;
        for (azimuth, &(image, negated)) in images.iter().enumerate().filter(|(azimuth, (image, _))| image != azimuth) {
            for ring in 0..grid.rings {
                let start = |azimuth: usize| (ring * grid.azimuths + azimuth) * half_vector_len;
                for step in 0..grid.phi_d {
                    let from = start(image) + row_len * if negated { (grid.phi_d - step) % grid.phi_d } else { step };
                    values.copy_within(from..from + row_len, start(azimuth) + row_len * step);
                }
            }
        }
        let directions = Self::area_grid();
        let areas = directions.directions().into_par_iter().map(|o| (area(o) / f64::from(o.z)) as f32).collect();
        Ok(Self {
            grid,
            interpolation: Interpolation::Cubic,
            bounced_weights: Vec::new(),
            weights,
            vec4s,
            values: Arc::new(values),
            areas: Arc::new((directions, areas)),
        })
    }

    /// The table with light that facets send to each other in three more columns. `g(i, o)` is `a_v f̄` of this light.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn plus_bounced(&self, g: impl Fn(Vec3, Vec3) -> DVec3 + Sync, cancel: &Cancel) -> Result<Self> {
        let sums = |lights: &[Vec3], o: Vec3, out: &mut [DVec3]| {
            out.iter_mut().zip(lights).for_each(|(out, i)| *out = g(*i, o));
            0.0
        };
        let bounced = Self::resample(sums, Nodes::all(self.grid), cancel)?;
        let zeros = vec![Weight::Tint(Tint::Fixed(Vec3::ZERO)); self.weights.len()];
        let bounced_weights = [zeros, bounced.weights.clone()].concat();
        let weights = [self.weights.clone(), bounced.weights].concat();
        let vec4s = weights.len().div_ceil(4);
        let mut values = vec![Vec4::ZERO; self.values.len() / self.vec4s * vec4s];
        let nodes = self.values.par_chunks(self.vec4s).zip(&*bounced.values);
        values.par_chunks_mut(vec4s).zip(nodes).for_each(|(out, (direct, bounced))| {
            out[..direct.len()].copy_from_slice(direct);
            for channel in 0..3 {
                let column = self.weights.len() + channel;
                out[column / 4][column % 4] = bounced[channel];
            }
        });
        Ok(Self { weights, bounced_weights, vec4s, values: Arc::new(values), ..self.clone() })
    }

    /// Changes the interpolation along θ_d.
    pub fn read(self, interpolation: Interpolation) -> Self {
        Self { interpolation, ..self }
    }

    /// Returns true if two tables share their values, so that they differ in weights only.
    pub fn shares_values_with(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.values, &other.values)
    }

    /// The weights that multiply the columns at the query.
    #[cfg(feature = "gpu")]
    pub(crate) fn weights(&self) -> &[Weight] {
        &self.weights
    }

    /// Groups of four columns per node; columns after the last are zero.
    pub fn vec4s_per_node(&self) -> usize {
        self.vec4s
    }

    /// `[θ_h][φ_h][φ_d][θ_d][vec4]`, with one more node of θ_d at either end than the grid has.
    pub fn values(&self) -> &[Vec4] {
        &self.values
    }

    /// The grid of projected areas.
    pub(crate) fn area_grid() -> PolarGrid {
        PolarGrid::new(AREA_GRID[0], AREA_GRID[1])
    }

    /// `a_v(o) / cos θ_o` and the grid of its directions.
    pub fn areas(&self) -> (&PolarGrid, &[f32]) {
        (&self.areas.0, &self.areas.1)
    }

    /// Size of the table in bytes.
    pub fn bytes(&self) -> usize {
        16 * self.values.len() + 4 * self.areas.1.len()
    }

    /// Returns `a_v(o)` and writes `a_v f̄` of each light to `out`.
    pub fn sums(&self, lights: &[Vec3], o: Vec3, out: impl FnMut(usize, DVec3)) -> f64 {
        self.weighted_sums(&self.weights, lights, o, out)
    }

    /// As [`ShadingTable::sums`], of the light that facets send to each other.
    pub fn bounced_sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if self.bounced_weights.is_empty() {
            (0..lights.len()).for_each(|k| out(k, DVec3::ZERO));
            return 0.0;
        }
        self.weighted_sums(&self.bounced_weights, lights, o, out)
    }

    fn weighted_sums(&self, weights: &[Weight], lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if o.z <= 0.0 {
            (0..lights.len()).for_each(|k| out(k, DVec3::ZERO));
            return 0.0;
        }
        let relative: f32 = self.areas.0.taps(o).iter().map(|&(node, w)| w * self.areas.1[node]).sum();
        let mut coordinates = GridCoordinates::default();
        let mut components = [[0.0_f32; GridCoordinates::MAX]; 3];
        let mut sums = vec![Vec4::ZERO; GridCoordinates::MAX.min(lights.len()) * self.vec4s];
        for (part, lights) in lights.chunks(GridCoordinates::MAX).enumerate() {
            for (k, light) in lights.iter().enumerate() {
                for axis in 0..3 {
                    components[axis][k] = light[axis];
                }
            }
            let [x, y, z] = components.each_ref().map(|column| &column[..lights.len()]);
            self.grid.coordinates([x, y, z], o, &mut coordinates);
            let sums = &mut sums[..lights.len() * self.vec4s];
            let cubic = self.interpolation == Interpolation::Cubic;
            simd::row_sums(&self.values, self.row_grid(), coordinates.columns(), lights.len(), cubic, sums);
            for ((k, &i), sums) in lights.iter().enumerate().zip(sums.chunks(self.vec4s)) {
                let sum = if i.z > 0.0 { weighted(weights, i, o, coordinates.i_dot_h(k), sums) } else { Vec3::ZERO };
                out(part * GridCoordinates::MAX + k, sum.as_dvec3());
            }
        }
        f64::from(relative * o.z)
    }

    fn row_grid(&self) -> RowGrid {
        let HemispherePairGrid { rings, azimuths, phi_d, theta_d } = self.grid;
        RowGrid { rings, azimuths, phi_d, stored: theta_d + 2, vec4s: self.vec4s }
    }
}

/// `Σ_c w_c T_c`
#[inline(always)]
fn weighted(weights: &[Weight], i: Vec3, o: Vec3, i_dot_h: f32, sums: &[Vec4]) -> Vec3 {
    let pair = PairVectors { i, o, h: (i + o) / (2.0 * i_dot_h).max(1e-20), i_dot_h };
    let mut total = Vec3::ZERO;
    for (sums, weights) in sums.iter().zip(weights.chunks(4)) {
        // A cubic may be below zero; no sum is.
        for (sum, weight) in sums.max(Vec4::ZERO).to_array().into_iter().zip(weights) {
            total += weight.at(&pair) * sum;
        }
    }
    total
}
