//! The effective BRDF as low-rank factors that are multiplied at the query: `G(i,o) = Σ_c U_c(i,o) P_c(h,d)` (Wu et al.
//! 2011, Eq. 12). Each factor is smooth in its own coordinates and is interpolated there.

pub(crate) mod bvndf;
pub(crate) mod gram;
pub(crate) mod rotated_basis;

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use self::bvndf::{leading_features, visibility_at, visibility_table};
use super::{BasisGrid, RotatedBasis, RotatedLobe, Tint, VisibilityRows};
use crate::base::Result;
use crate::brdf::{Brdf, ColorBasis, Material, Term, analytic_lobe};
use crate::geometry::Facets;
use crate::math::directions::{HalfDifferenceGrid, PolarGrid, half_vector};
use crate::math::simd;
use crate::math::simd::Lobe;
use crate::visibility::Visibility;

/// Resolution and truncation of low-rank factors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowRankSettings {
    /// Directions of the visibility factors.
    pub directions: PolarGrid,
    pub basis: BasisGrid,
    /// Fraction of the energy of M that is kept.
    pub keep_m: f64,
    /// Fraction of the energy of N, in M's metric, that is kept.
    pub keep_n: f64,
    pub max_rank: usize,
    /// Number of colour directions of a measured BRDF; `None` uses as many as keep the fraction `keep_color` of its
    /// energy.
    pub colors: Option<usize>,
    pub keep_color: f64,
    pub seed: u64,
}

/// The origin of a channel's tint: the indices of a material and its term, and a colour or colour direction that no
/// edit of the material changes.
#[derive(Debug, Clone, Copy)]
struct TintSource {
    material: usize,
    term: usize,
    along: Vec3,
}

impl TintSource {
    fn tint(&self, materials: &[Material]) -> Tint {
        let material = &materials[self.material];
        let color = material.color * self.along;
        match &material.brdf.terms[self.term] {
            Term::Measured(_) => Tint::Fixed(color),
            term => Tint::Term(term.clone(), color),
        }
    }
}

/// One scalar BRDF over one group of facets with one set of weights.
#[derive(Debug, Clone)]
pub struct ChannelTables {
    /// Visibility factors, `[o][i][column]`.
    pub(crate) u: Arc<Vec<f32>>,
    /// Lobe factors, `[node of (h, d)][column]`; `None` for a Lambertian lobe, whose cosines are in `u`.
    pub(crate) p: Option<Arc<Vec<f32>>>,
    pub(crate) columns: usize,
    pub tint: Tint,
    source: TintSource,
    /// Rank of the basis, and rank of N in its metric.
    pub ranks: (usize, usize),
}

/// The effective BRDF as low-rank factors.
#[derive(Debug, Clone)]
pub struct LowRank {
    pub directions: PolarGrid,
    pub pairs: HalfDifferenceGrid,
    pub channels: Vec<ChannelTables>,
    /// `a_v(o) / cos θ_o` on the nodes of `directions`.
    pub projected_area: Arc<Vec<f32>>,
}

impl ChannelTables {
    /// Size of the factors in bytes.
    pub fn bytes(&self) -> usize {
        4 * (self.u.len() + self.p.as_ref().map_or(0, |p| p.len()))
    }
}

/// Consecutive facets of one slot with their material and weights.
#[derive(Debug)]
struct WeightedGroup {
    range: Range<usize>,
    material: usize,
    /// Area times colour weight, and the colour that multiplies it: one column for equal colours, else one per channel.
    columns: Vec<(Vec<f32>, Vec3)>,
}

/// Groups facets, which are sorted by slot, and leaves out black materials.
fn groups(facets: &Facets, material_of_slot: &[usize], materials: &[Material]) -> Vec<WeightedGroup> {
    let mut groups = Vec::new();
    let mut start = 0;
    while start < facets.len() {
        let slot = facets.slots[start];
        let end = start + facets.slots[start..].iter().take_while(|&&other| other == slot).count();
        let range = start..end;
        start = end;
        let material = material_of_slot[usize::from(slot)];
        if materials[material].color == Vec3::ZERO {
            continue;
        }
        let colors = &facets.colors[range.clone()];
        let areas = &facets.areas[range.clone()];
        let columns = if colors.iter().all(|&color| color == colors[0]) {
            vec![(areas.to_vec(), colors[0])]
        } else {
            (0..3)
                .map(|c| (colors.iter().zip(areas).map(|(color, area)| color[c] * area).collect(), Vec3::AXES[c]))
                .collect()
        };
        groups.push(WeightedGroup { range, material, columns });
    }
    groups
}

/// A factored channel before its table over direction pairs is computed.
#[derive(Debug)]
struct FactoredChannel {
    range: Range<usize>,
    /// Area times colour weight.
    weights: Vec<f32>,
    /// `[facet][column]`; absent for a Lambertian lobe.
    y: Option<Vec<f32>>,
    p: Option<Arc<Vec<f32>>>,
    columns: usize,
    tint: Tint,
    source: TintSource,
    ranks: (usize, usize),
}

impl FactoredChannel {
    /// A Lambertian lobe, which needs no basis.
    fn lambertian(range: Range<usize>, weights: Vec<f32>, source: TintSource, tint: Tint) -> Self {
        Self { range, weights, y: None, p: None, columns: 1, tint, source, ranks: (1, 1) }
    }

    /// Factors any lobe through its rotated basis.
    fn factored(
        (range, rows, normals): (Range<usize>, &VisibilityRows, &[Vec3]),
        weights: Vec<f32>,
        basis: &RotatedBasis,
        settings: &LowRankSettings,
        (source, tint): (TintSource, Tint),
    ) -> Result<Self> {
        let count = basis.features();
        let mut features = vec![0.0; normals.len() * count];
        for (normal, row) in normals.iter().zip(features.chunks_mut(count.max(1))) {
            basis.write_features(*normal, row);
        }
        let (kept, max_rank, seed) = (settings.keep_n, settings.max_rank, settings.seed);
        let (leading, rank) = leading_features(rows, &weights, &features, count, kept, max_rank, seed)?;
        let mut y = vec![0.0; normals.len() * rank];
        crate::math::linalg::gemm::multiply_parallel(normals.len(), count, rank, &features, &leading, &mut y);
        let p = Some(Arc::new(basis.left_table(&leading, rank)));
        let ranks = (basis.rank, rank);
        Ok(Self { range, weights, y: Some(y), p, columns: rank, tint, source, ranks })
    }

    /// Tabulates the visibility factors at all pairs of nodes, or at the pairs in `read`.
    fn tabulated(&self, rows: &VisibilityRows, normals: &[Vec3], read: Option<&[(usize, usize)]>) -> ChannelTables {
        let table = |rows: &VisibilityRows, y: &[f32]| match read {
            None => visibility_table(rows, &self.weights, y, self.columns),
            Some(nodes) => visibility_at(rows, &self.weights, y, self.columns, nodes),
        };
        let u = match &self.y {
            Some(y) => table(rows, y),
            // `Σ w V(i)(n·i)+ V(o)(n·o)+ / π` is smooth.
            None => table(&rows.with_cosines(normals), &vec![std::f32::consts::FRAC_1_PI; self.weights.len()]),
        };
        let (p, columns, ranks) = (self.p.clone(), self.columns, self.ranks);
        ChannelTables { u: Arc::new(u), p, columns, tint: self.tint.clone(), source: self.source, ranks }
    }
}

/// All factors before tabulation over direction pairs, which takes most of the time: the bases of all materials, and N
/// of each group in their metric.
#[derive(Debug)]
pub struct Factors {
    facets: Arc<Facets>,
    rows: Arc<VisibilityRows>,
    pairs: HalfDifferenceGrid,
    channels: Vec<FactoredChannel>,
}

impl Factors {
    /// Factors all materials and groups. `rows` is the visibility of all facets at the nodes of the settings'
    /// directions.
    ///
    /// # Errors
    /// A factorization that does not converge, or values that are not finite.
    pub fn new(
        facets: Arc<Facets>,
        rows: Arc<VisibilityRows>,
        material_of_slot: &[usize],
        materials: &[Material],
        settings: &LowRankSettings,
    ) -> Result<Self> {
        let mut channels = Vec::new();
        for group in groups(&facets, material_of_slot, materials) {
            let group_rows = rows.part(group.range.clone());
            let over = || (group.range.clone(), &group_rows, &facets.normals[group.range.clone()]);
            for (k, term) in materials[group.material].brdf.terms.iter().enumerate() {
                for (lobe, along) in &lobes_of(term, settings) {
                    let basis = match lobe {
                        RotatedLobe::Analytic(Lobe::Lambertian) => None,
                        _ => Some(RotatedBasis::new(*lobe, settings.basis, settings.keep_m)?),
                    };
                    for (weights, column_color) in &group.columns {
                        let source = TintSource { material: group.material, term: k, along: *along * *column_color };
                        let (weights, tint) = (weights.clone(), source.tint(materials));
                        match &basis {
                            None => {
                                let range = group.range.clone();
                                channels.push(FactoredChannel::lambertian(range, weights, source, tint));
                            }
                            // A lobe that is 0 at every node has no features.
                            Some(basis) if basis.features() == 0 => {}
                            Some(basis) => {
                                let tint = (source, tint);
                                channels.push(FactoredChannel::factored(over(), weights, basis, settings, tint)?);
                            }
                        }
                    }
                }
            }
        }
        Ok(Self { facets, rows, pairs: settings.basis.pairs, channels })
    }

    /// Tabulates over all direction pairs.
    pub fn tabulate(&self) -> LowRank {
        self.tabulated(None)
    }

    /// Tabulates only the nodes that these pairs `(i, o)` read.
    pub fn tabulate_for(&self, pairs: impl Iterator<Item = (Vec3, Vec3)>) -> LowRank {
        let grid = self.rows.grid;
        let mut read: Vec<(usize, usize)> = pairs
            .filter(|(i, o)| i.z > 0.0 && o.z > 0.0)
            .flat_map(|(i, o)| grid.taps(o).map(|(view, _)| grid.taps(i).map(|(light, _)| (view, light))))
            .flatten()
            .collect();
        read.sort_unstable();
        read.dedup();
        self.tabulated(Some(&read))
    }

    fn tabulated(&self, read: Option<&[(usize, usize)]>) -> LowRank {
        let channels = self.channels.chunk_by(|a, b| a.range == b.range).flat_map(|channels| {
            let range = channels[0].range.clone();
            let rows = self.rows.part(range.clone());
            channels
                .iter()
                .map(|channel| channel.tabulated(&rows, &self.facets.normals[range.clone()], read))
                .collect::<Vec<_>>()
        });
        LowRank {
            directions: self.rows.grid,
            pairs: self.pairs,
            channels: channels.collect(),
            projected_area: Arc::new(projected_area_table(&self.facets, &self.rows)),
        }
    }
}

impl LowRank {
    /// Computes [`Factors`] and tabulates them over all direction pairs.
    ///
    /// # Errors
    /// As [`Factors::new`].
    pub fn build(
        facets: &Facets,
        visibility: &Visibility,
        material_of_slot: &[usize],
        materials: &[Material],
        settings: &LowRankSettings,
    ) -> Result<Self> {
        let rows = VisibilityRows::new(visibility, 0..facets.len(), settings.directions);
        Ok(Factors::new(Arc::new(facets.clone()), Arc::new(rows), material_of_slot, materials, settings)?.tabulate())
    }
}

/// The scalar lobes of a term, and the colour direction of each: one for analytic terms, up to three for measured ones.
fn lobes_of<'a>(term: &'a Term, settings: &LowRankSettings) -> Vec<(RotatedLobe<'a>, Vec3)> {
    if let Some(lobe) = analytic_lobe(term) {
        return vec![(RotatedLobe::Analytic(lobe), Vec3::ONE)];
    }
    let Term::Measured(table) = term else { return Vec::new() };
    let colors = ColorBasis::of(&Brdf { terms: vec![term.clone()] });
    let count = settings.colors.unwrap_or_else(|| colors.count_for(settings.keep_color)).clamp(1, 3);
    let lobe = |along: Vec3| (RotatedLobe::Measured { table: table.as_ref(), along }, along);
    colors.directions[..count].iter().map(|along| lobe(*along)).collect()
}

/// `a_v(o) / cos θ_o` at each node, in tile units squared.
fn projected_area_table(facets: &Facets, visibility: &VisibilityRows) -> Vec<f32> {
    let component = |pick: fn(&Vec3) -> f32| -> Vec<f32> { facets.normals.iter().map(pick).collect() };
    let (x, y, z) = (component(|n| n.x), component(|n| n.y), component(|n| n.z));
    let grid = visibility.grid;
    if facets.is_empty() {
        return vec![0.0; grid.len()];
    }
    visibility
        .rows
        .chunks(facets.len().max(1))
        .enumerate()
        .map(|(node, row)| {
            let direction = grid.direction(node);
            (simd::projected_area([&x, &y, &z], &facets.areas, row, direction) / f64::from(direction.z)) as f32
        })
        .collect()
}

impl LowRank {
    /// Replaces the colours of the factors. `materials` must have the lobes that these factors were built from
    /// ([`Material::same_lobes`]).
    pub fn recolored(&self, materials: &[Material]) -> Self {
        let mut recolored = self.clone();
        for channel in &mut recolored.channels {
            channel.tint = channel.source.tint(materials);
        }
        recolored
    }

    /// Returns `a_v(o)` and writes `a_v f̄` of each light to `out`.
    pub fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if o.z <= 0.0 {
            (0..lights.len()).for_each(|k| out(k, DVec3::ZERO));
            return 0.0;
        }
        let nodes = self.directions.len();
        let view = self.directions.taps(o);
        let relative: f32 = view.iter().map(|&(node, w)| w * self.projected_area[node]).sum();
        for (k, &i) in lights.iter().enumerate() {
            if i.z <= 0.0 {
                out(k, DVec3::ZERO);
                continue;
            }
            let light = self.directions.taps(i);
            let io: [(usize, f32); 16] = std::array::from_fn(|t| {
                let ((a, wa), (b, wb)) = (view[t / 4], light[t % 4]);
                (a * nodes + b, wa * wb)
            });
            let hd = self.pairs.taps(i, o);
            let i_dot_h = i.dot(half_vector(i, o));
            let mut total = DVec3::ZERO;
            for channel in &self.channels {
                let value = match &channel.p {
                    Some(p) => simd::gathered_dot(&channel.u, &io, p, &hd, channel.columns),
                    None => io.iter().map(|&(node, w)| w * channel.u[node]).sum(),
                };
                total += (channel.tint.at(i_dot_h) * value).as_dvec3();
            }
            // Truncated factors may be slightly below zero; no BRDF is.
            let taper = PolarGrid::horizon_taper(i.z) * PolarGrid::horizon_taper(o.z);
            out(k, total.max(DVec3::ZERO) * f64::from(taper));
        }
        f64::from(relative * o.z)
    }

    /// Size of all factors in bytes.
    pub fn bytes(&self) -> usize {
        self.channels.iter().map(ChannelTables::bytes).sum()
    }
}
