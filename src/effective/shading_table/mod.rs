//! A table of the sum for pictures, which ask millions of times: what depends on the facets is tabulated once over half and
//! difference coordinates, what is known exactly at the query stays out of it.
//!
//! `a_v f̄ = Σ_c w_c(i,o) T_c(i,o)`: a column `T_c` is the sum of one lobe over one group of facets, without its tint; or,
//! where few normals occur, the visible area of the facets of one normal, whose lobe is then a part of the exact weight
//! `w_c` (DESIGN.md, Sec. 4, "Interpolate only what is smooth"). Colours are in the weights: editing them keeps the table.

pub(crate) mod columns;
pub(crate) mod content;
mod facet_columns;
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

/// Columns of a table over pairs of directions, and what multiplies them.
#[derive(Debug, Clone)]
pub struct ShadingTable {
    pub grid: HemispherePairGrid,
    /// Along θ_d; elsewhere it is linear.
    pub interpolation: Interpolation,
    weights: Vec<Weight>,
    /// Whether the columns are those of a sum over facets, else the colours of another form.
    of_sum: bool,
    /// F32x8Array of columns a node.
    fours: usize,
    /// `[θ_h][φ_h][φ_d][θ_d][four]`. There is one step of θ_d more at either end than the grid has, so that a cubic has its
    /// four nodes everywhere: the mirror image of the second before the first, a straight line after the last.
    values: Arc<Vec<Vec4>>,
    /// `a_v(o) / cos θ_o` on the nodes of a polar grid.
    areas: Arc<(PolarGrid, Vec<f32>)>,
}

/// Which nodes of a table are made, and from what.
#[derive(Debug, Clone, Copy)]
pub struct Nodes<'a> {
    pub grid: HemispherePairGrid,
    /// Planes x = const and y = const that mirror the tile: half or a quarter of the nodes are images of the others.
    pub mirrors: [bool; 2],
    /// About how many facets each half vector's sums take, where those are fewer than all.
    pub facets: Option<usize>,
    /// Pairs that will be asked for: other nodes stay black. All, where it is absent.
    pub read_by: Option<&'a [Pair]>,
}

impl Nodes<'_> {
    /// Every node by itself, from all facets.
    pub fn all(grid: HemispherePairGrid) -> Self {
        Self { grid, mirrors: [false; 2], facets: None, read_by: None }
    }
}

/// The eight rows of θ_d around a place, and the step of θ_d below it: what [`simd::row_sums`] reads.
fn rows_around(grid: &HemispherePairGrid, [ring, azimuth, turn, step]: [f32; 4]) -> ([usize; 8], usize) {
    let around = |at: f32, count: usize| {
        let low = (at as usize).min(count - 1);
        [low, if low + 1 == count { 0 } else { low + 1 }]
    };
    let ring = (ring as usize).min(grid.rings - 2);
    let (azimuths, turns) = (around(azimuth, grid.azimuths), around(turn, grid.turn));
    let row = |k: usize| ((ring + (k >> 2)) * grid.azimuths + azimuths[k >> 1 & 1]) * grid.turn + turns[k & 1];
    (std::array::from_fn(row), (step as usize).min(grid.difference - 2))
}

/// Which nodes of a grid these pairs read, or the originals of which those are images.
fn nodes_read(grid: &HemispherePairGrid, made_of: &[(usize, bool)], pairs: &[Pair]) -> Vec<bool> {
    let mut read = vec![false; grid.nodes()];
    let mut places = GridCoordinates::default();
    for Pair { i, o } in pairs {
        grid.places([&[i.x], &[i.y], &[i.z]], *o, &mut places);
        let (rows, low) = rows_around(grid, places.at(0));
        for row in rows {
            let (half_vector, turn) = (row / grid.turn, row % grid.turn);
            let (image, turned) = made_of[half_vector % grid.azimuths];
            let turn = if turned { (grid.turn - turn) % grid.turn } else { turn };
            let row = (half_vector / grid.azimuths * grid.azimuths + image) * grid.turn + turn;
            let steps = low.saturating_sub(1)..(low + 3).min(grid.difference);
            read[row * grid.difference..][steps].fill(true);
        }
    }
    read
}

/// Nodes of the projected area.
const AREA_GRID: [usize; 2] = [30, 72];

impl ShadingTable {
    /// Sums over facets at the nodes that are asked for. `None` where the sum has too many parts for a table to pay.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn build(direct: &Direct, nodes: Nodes, cancel: &Cancel) -> Result<Option<Self>> {
        let Some(columns) = Column::of(&direct.sum) else { return Ok(None) };
        let weights: Vec<Weight> = columns.iter().map(|column| column.weight(&direct.sum)).collect();
        let mirrors = Weight::mirrors(&weights, nodes.mirrors);
        let (nodes, facets) = (Nodes { mirrors, ..nodes }, nodes.facets);
        let area = |o: Vec3| direct.sums(&[], o, |_, _| {});
        let sampled = |h: Vec3| facets.and_then(|count| direct.about(h, count));
        let table = Self::tabulate(nodes, weights, true, area, cancel, sampled, |sampled, i, o, sums| {
            let direct = sampled.as_ref().unwrap_or(direct);
            let pair = PairVectors::new(i, o);
            direct.with_seen(i, o, |v_i, v_o| {
                Column::sums(&columns, &direct.sum, &pair, v_i, v_o, sums);
            });
        });
        table.map(Some)
    }

    /// A table of another form's values, colours and all.
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
            false,
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

    /// `prepare` is told each half vector, `fill` writes the columns of a pair about it, `area` tells `a_v(o)`.
    fn tabulate<P>(
        Nodes { grid, mirrors, read_by, .. }: Nodes,
        weights: Vec<Weight>,
        of_sum: bool,
        area: impl Fn(Vec3) -> f64 + Sync,
        cancel: &Cancel,
        prepare: impl Fn(Vec3) -> P + Sync,
        fill: impl Fn(&P, Vec3, Vec3, &mut [f32]) + Sync,
    ) -> Result<Self> {
        let (fours, stored) = (weights.len().div_ceil(4), grid.difference + 2);
        let mut values = vec![Vec4::ZERO; grid.half_vectors() * grid.turn * stored * fours];
        let (turn, half_vector) = (stored * fours, grid.turn * stored * fours);
        let made_of: Vec<(usize, bool)> = (0..grid.azimuths).map(|azimuth| grid.image(azimuth, mirrors)).collect();
        let read = read_by.map(|pairs| nodes_read(&grid, &made_of, pairs));
        let is_read = |node: usize| read.as_ref().is_none_or(|read| read[node]);
        let half_vectors = values.par_chunks_mut(half_vector).enumerate();
        half_vectors.try_for_each(|(half_vector, nodes)| {
            cancel.check()?;
            let first = half_vector * grid.turn * grid.difference;
            if made_of[half_vector % grid.azimuths].0 != half_vector % grid.azimuths
                || !(first..first + grid.turn * grid.difference).any(is_read)
            {
                return Ok(());
            }
            let (i, o) = grid.pair(first);
            let prepared = prepare(directions::half_vector(i, o));
            let mut sums = vec![0.0; 4 * fours];
            for (turn, row) in nodes.chunks_mut(stored * fours).enumerate() {
                for step in 0..grid.difference {
                    let node = first + turn * grid.difference + step;
                    if !is_read(node) {
                        continue;
                    }
                    let (i, o) = grid.pair(node);
                    fill(&prepared, i, o, &mut sums[..weights.len()]);
                    for (node, sums) in row[(step + 1) * fours..].iter_mut().zip(sums.as_chunks::<4>().0) {
                        *node = Vec4::from_array(*sums);
                    }
                }
                for four in 0..fours {
                    let at = |step: usize| step * fours + four;
                    row[at(0)] = row[at(2)];
                    row[at(grid.difference + 1)] = 2.0 * row[at(grid.difference)] - row[at(grid.difference - 1)];
                }
            }
            Ok::<_, crate::base::Error>(())
        })?;
        for (azimuth, &(image, turned)) in made_of.iter().enumerate().filter(|(azimuth, (image, _))| image != azimuth) {
            for ring in 0..grid.rings {
                let place = |azimuth: usize| (ring * grid.azimuths + azimuth) * half_vector;
                for step in 0..grid.turn {
                    let from = place(image) + turn * if turned { (grid.turn - step) % grid.turn } else { step };
                    values.copy_within(from..from + turn, place(azimuth) + turn * step);
                }
            }
        }
        let directions = Self::area_grid();
        let areas = directions.directions().into_par_iter().map(|o| (area(o) / f64::from(o.z)) as f32).collect();
        Ok(Self {
            grid,
            interpolation: Interpolation::Cubic,
            weights,
            of_sum,
            fours,
            values: Arc::new(values),
            areas: Arc::new((directions, areas)),
        })
    }

    /// The same table for another sum over the same facets seen alike, whose lobes may differ where `same_lobes` is not
    /// told; `None` where the table does not serve it.
    pub fn reused(&self, sum: &FacetSum, same_lobes: bool) -> Option<Self> {
        let weights: Vec<Weight> = Column::of(sum)?.iter().map(|column| column.weight(sum)).collect();
        let areas_only = |weights: &[Weight]| weights.iter().all(Weight::is_lobe);
        let serves = self.of_sum
            && weights.len() == self.weights.len()
            && (same_lobes || areas_only(&weights) && areas_only(&self.weights));
        serves.then(|| Self { weights, ..self.clone() })
    }

    /// The same, read in another way between its nodes.
    pub fn read(self, interpolation: Interpolation) -> Self {
        Self { interpolation, ..self }
    }

    /// Whether two tables differ in their weights only.
    pub fn shares_values_with(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.values, &other.values)
    }

    /// What multiplies each column at a query.
    pub(crate) fn weights(&self) -> &[Weight] {
        &self.weights
    }

    /// F32x8Array of columns a node, black ones after the last.
    pub fn fours(&self) -> usize {
        self.fours
    }

    /// `[θ_h][φ_h][φ_d][θ_d][four]`, with one step of θ_d more at either end than the grid has.
    pub fn values(&self) -> &[Vec4] {
        &self.values
    }

    /// Where a table knows the projected area.
    pub(crate) fn area_grid() -> PolarGrid {
        PolarGrid::new(AREA_GRID[0], AREA_GRID[1])
    }

    /// `a_v(o) / cos θ_o` and the directions it stands on.
    pub fn areas(&self) -> (&PolarGrid, &[f32]) {
        (&self.areas.0, &self.areas.1)
    }

    pub fn bytes(&self) -> usize {
        16 * self.values.len() + 4 * self.areas.1.len()
    }

    /// `a_v(o)` and, for each light, `a_v f̄` into `out`.
    pub fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if o.z <= 0.0 {
            (0..lights.len()).for_each(|k| out(k, DVec3::ZERO));
            return 0.0;
        }
        let relative: f32 = self.areas.0.taps(o).iter().map(|&(node, w)| w * self.areas.1[node]).sum();
        let mut places = GridCoordinates::default();
        let mut components = [[0.0_f32; GridCoordinates::MAX]; 3];
        let mut sums = vec![Vec4::ZERO; GridCoordinates::MAX.min(lights.len()) * self.fours];
        for (part, lights) in lights.chunks(GridCoordinates::MAX).enumerate() {
            for (k, light) in lights.iter().enumerate() {
                for axis in 0..3 {
                    components[axis][k] = light[axis];
                }
            }
            let [x, y, z] = components.each_ref().map(|column| &column[..lights.len()]);
            self.grid.places([x, y, z], o, &mut places);
            let sums = &mut sums[..lights.len() * self.fours];
            let cubic = self.interpolation == Interpolation::Cubic;
            simd::row_sums(&self.values, self.rows(), places.columns(), lights.len(), cubic, sums);
            for ((k, &i), sums) in lights.iter().enumerate().zip(sums.chunks(self.fours)) {
                let sum = if i.z > 0.0 { self.weighted(i, o, places.i_dot_h(k), sums) } else { Vec3::ZERO };
                out(part * GridCoordinates::MAX + k, sum.as_dvec3());
            }
        }
        f64::from(relative * o.z)
    }

    fn rows(&self) -> RowGrid {
        let HemispherePairGrid { rings, azimuths, turn, difference } = self.grid;
        RowGrid { rings, azimuths, turn, stored: difference + 2, fours: self.fours }
    }

    /// `Σ_c w_c T_c`
    #[inline(always)]
    fn weighted(&self, i: Vec3, o: Vec3, i_dot_h: f32, sums: &[Vec4]) -> Vec3 {
        let pair = PairVectors { i, o, h: (i + o) / (2.0 * i_dot_h).max(1e-20), i_dot_h };
        let mut total = Vec3::ZERO;
        for (sums, weights) in sums.iter().zip(self.weights.chunks(4)) {
            // A cubic may swing below zero; no sum does.
            for (sum, weight) in sums.max(Vec4::ZERO).to_array().into_iter().zip(weights) {
                total += weight.at(&pair) * sum;
            }
        }
        total
    }
}
