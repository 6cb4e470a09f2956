//! The columns that a shading table stores of a sum over facets, and their weights, which are evaluated at the query.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::brdf::{LobeAngles, Measured, Term};
use crate::effective::{FacetSum, Tint};
use crate::math::simd::PairVectors;

/// One scalar sum over facets of one group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    pub(crate) group: usize,
    pub(crate) kind: ColumnKind,
    /// The colour channel whose weights are summed; `None` if the colour weights of all facets are equal.
    pub(crate) channel: Option<usize>,
}

/// The quantity that a column sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ColumnKind {
    /// A lobe, by index, summed over all facets.
    Lobe(usize),
    /// A colour channel of a measured BRDF, summed over all facets.
    Measured { table: usize, color: usize },
    /// The visible area of a normal cluster, by index.
    Area(usize),
}

/// Largest number of columns of a table; with more, a query costs more than it saves.
const MAX_COLUMNS: usize = 32;

/// Largest number of normal clusters of a group that get columns of visible area; with more, the columns are lobes.
const MAX_NORMALS: usize = 8;

impl Column {
    /// The columns of a sum; `None` if there are too many.
    pub(crate) fn of(sum: &FacetSum) -> Option<Vec<Self>> {
        let mut columns = Vec::new();
        for (group, facets) in sum.groups().iter().enumerate() {
            if facets.is_black {
                continue;
            }
            // The channels of one quantity follow each other, because one loop over the facets sums all of them.
            let channels: &[Option<usize>] =
                if facets.rgb_areas.is_some() { &[Some(0), Some(1), Some(2)] } else { &[None] };
            let mut add = |kind| columns.extend(channels.iter().map(|&channel| Self { group, kind, channel }));
            match &facets.clusters {
                Some(clusters) if clusters.len() <= MAX_NORMALS => {
                    (0..clusters.len()).for_each(|cluster| add(ColumnKind::Area(cluster)));
                }
                _ => {
                    (0..facets.lobes.len()).for_each(|lobe| add(ColumnKind::Lobe(lobe)));
                    for table in 0..facets.measured.len() {
                        columns.extend((0..3).map(|color| {
                            let channel = facets.rgb_areas.is_some().then_some(color);
                            Self { group, kind: ColumnKind::Measured { table, color }, channel }
                        }));
                    }
                }
            }
        }
        (columns.len() <= MAX_COLUMNS).then_some(columns)
    }

    /// Number of columns that hold the channels of the same quantity as this one, its own included.
    fn channels(&self) -> usize {
        if self.channel.is_some() || matches!(self.kind, ColumnKind::Measured { .. }) { 3 } else { 1 }
    }

    /// The facets that a column sums over.
    #[cfg(feature = "gpu")]
    pub(crate) fn facets(&self, sum: &FacetSum) -> std::ops::Range<usize> {
        let group = &sum.groups()[self.group];
        match (self.kind, &group.clusters) {
            (ColumnKind::Area(cluster), Some(clusters)) => clusters[cluster].range.clone(),
            _ => group.range.clone(),
        }
    }

    /// Writes the sums of all columns for a pair of directions, from the visibilities along them.
    pub(crate) fn sums(
        columns: &[Self],
        sum: &FacetSum,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
        out: &mut [f32],
    ) {
        let mut first = 0;
        while let Some(column) = columns.get(first) {
            let group = &sum.groups()[column.group];
            let sums = match (column.kind, &group.clusters) {
                (ColumnKind::Lobe(lobe), _) => sum.lobe_sum(group, group.lobes[lobe].0, pair, v_i, v_o),
                (ColumnKind::Area(cluster), Some(clusters)) => sum.visible_area(group, &clusters[cluster], v_i, v_o),
                (ColumnKind::Area(_), None) => DVec3::ZERO,
                (ColumnKind::Measured { table, .. }, _) => {
                    sum.measured_sum(group, group.measured[table].as_ref(), pair, v_i, v_o)
                }
            };
            let count = column.channels();
            out[first..first + count].copy_from_slice(&sums.as_vec3().to_array()[..count]);
            first += count;
        }
    }

    /// The weight of the column.
    pub(crate) fn weight(&self, sum: &FacetSum) -> Weight {
        let group = &sum.groups()[self.group];
        let color = group.color * self.channel.map_or(Vec3::ONE, |channel| Vec3::AXES[channel]);
        match self.kind {
            ColumnKind::Lobe(lobe) => Weight::Tint(Tint::Term(group.lobes[lobe].1.clone(), color)),
            ColumnKind::Measured { color: channel, .. } => Weight::Tint(Tint::Fixed(group.color * Vec3::AXES[channel])),
            ColumnKind::Area(cluster) => Weight::Lobes {
                normal: group.clusters.as_ref().map_or(Vec3::Z, |clusters| clusters[cluster].normal),
                terms: group.lobes.iter().map(|(_, term)| term.clone()).collect(),
                measured: group.measured.clone(),
                color,
            },
        }
    }
}

/// A factor that multiplies a column at the query.
#[derive(Debug, Clone)]
pub(crate) enum Weight {
    Tint(Tint),
    /// All lobes at the normal of a cluster, times a colour.
    Lobes {
        normal: Vec3,
        terms: Vec<Term>,
        measured: Vec<Arc<dyn Measured>>,
        color: Vec3,
    },
}

impl Weight {
    pub(crate) fn is_lobe(&self) -> bool {
        matches!(self, Self::Lobes { .. })
    }

    /// The mirror planes of a table, given those of its tile. A column of visible area has none, because the mirror
    /// image of a cluster is another cluster.
    pub(crate) fn mirrors(weights: &[Self], tile_mirrors: [bool; 2]) -> [bool; 2] {
        if weights.iter().any(Self::is_lobe) { [false; 2] } else { tile_mirrors }
    }

    #[inline]
    pub(crate) fn at(&self, pair: &PairVectors) -> Vec3 {
        match self {
            Self::Tint(tint) => tint.at(pair.i_dot_h),
            Self::Lobes { normal, terms, measured, color } => lobes(*normal, terms, measured, pair) * *color,
        }
    }
}

/// The value of all lobes at one normal.
#[inline(never)]
fn lobes(normal: Vec3, terms: &[Term], measured: &[Arc<dyn Measured>], pair: &PairVectors) -> Vec3 {
    let angles = LobeAngles::new(normal, pair.i, pair.o, pair.h);
    if angles.n_dot_i <= 0.0 || angles.n_dot_o <= 0.0 {
        return Vec3::ZERO;
    }
    let mut value = Vec3::ZERO;
    for term in terms {
        value += term.tint(pair.i_dot_h) * term.lobe_cos(&angles);
    }
    for table in measured {
        value += table.f_r(&angles) * (angles.n_dot_i * angles.n_dot_o);
    }
    value
}
