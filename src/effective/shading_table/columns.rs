//! What a pair table tabulates of a sum over facets, and what it leaves to the query.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use crate::brdf::{LobeAngles, Measured, Term};
use crate::effective::{FacetSum, Tint};
use crate::math::simd::PairVectors;

/// One scalar sum over facets of one group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    pub(crate) group: usize,
    pub(crate) part: Part,
    /// Which colour weights of the facets; `None` where they are all the same.
    pub(crate) channel: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// A lobe, by number, summed over all facets.
    Lobe(usize),
    /// A colour of a measured BRDF, summed over all facets.
    Measured { table: usize, color: usize },
    /// The visible area of a run of facets with one normal.
    Area(usize),
}

/// More columns than these cost a query more than they save it.
const MAX_COLUMNS: usize = 32;

/// More normals than these are summed as if each facet had its own.
const MAX_NORMALS: usize = 8;

impl Column {
    /// The columns of a sum; `None` where there are too many.
    pub(crate) fn of(sum: &FacetSum) -> Option<Vec<Self>> {
        let mut columns = Vec::new();
        for (group, facets) in sum.groups().iter().enumerate() {
            if facets.is_black {
                continue;
            }
            let channels: &[Option<usize>] =
                if facets.rgb_areas.is_some() { &[Some(0), Some(1), Some(2)] } else { &[None] };
            for &channel in channels {
                let mut add = |part| columns.push(Self { group, part, channel });
                match &facets.patches {
                    Some(patches) if patches.len() <= MAX_NORMALS => {
                        (0..patches.len()).for_each(|patch| add(Part::Area(patch)));
                    }
                    _ => {
                        (0..facets.lobes.len()).for_each(|lobe| add(Part::Lobe(lobe)));
                        for table in 0..facets.measured.len() {
                            // Colour weights of the facets are a colour's own already.
                            let colors = channel.map_or(0..3, |channel| channel..channel + 1);
                            colors.for_each(|color| add(Part::Measured { table, color }));
                        }
                    }
                }
            }
        }
        (columns.len() <= MAX_COLUMNS).then_some(columns)
    }

    /// Those that it sums over.
    pub(crate) fn facets(&self, sum: &FacetSum) -> Range<usize> {
        let group = &sum.groups()[self.group];
        match (self.part, &group.patches) {
            (Part::Area(patch), Some(patches)) => patches[patch].range.clone(),
            _ => group.range.clone(),
        }
    }

    /// The sums of columns at a pair of directions, from the visibilities along them.
    pub(crate) fn sums(
        columns: &[Self],
        sum: &FacetSum,
        pair: &PairVectors,
        v_i: &[f32],
        v_o: &[f32],
        out: &mut [f32],
    ) {
        // All colours of a measured BRDF come from one walk over the facets.
        let mut last = None;
        for (column, out) in columns.iter().zip(out) {
            let Self { group, channel, .. } = *column;
            *out = match column.part {
                Part::Lobe(lobe) => sum.lobe_sum(group, lobe, channel, pair, v_i, v_o),
                Part::Area(patch) => sum.visible_area(group, patch, channel, v_i, v_o),
                Part::Measured { table, color } => {
                    let colors = match last {
                        Some((of, colors)) if of == (group, table) => colors,
                        _ => {
                            let group = &sum.groups()[group];
                            sum.measured_sum(group, group.measured[table].as_ref(), pair, v_i, v_o)
                        }
                    };
                    last = Some(((group, table), colors));
                    colors[color]
                }
            } as f32;
        }
    }

    /// What multiplies the column at a query.
    pub(crate) fn weight(&self, sum: &FacetSum) -> Weight {
        let group = &sum.groups()[self.group];
        let color = group.color * self.channel.map_or(Vec3::ONE, |channel| Vec3::AXES[channel]);
        match self.part {
            Part::Lobe(lobe) => Weight::Tint(Tint::Term(group.lobes[lobe].1.clone(), color)),
            Part::Measured { color: of, .. } => Weight::Tint(Tint::Fixed(group.color * Vec3::AXES[of])),
            Part::Area(patch) => Weight::Lobes {
                normal: group.patches.as_ref().map_or(Vec3::Z, |patches| patches[patch].normal),
                terms: group.lobes.iter().map(|(_, term)| term.clone()).collect(),
                measured: group.measured.clone(),
                color,
            },
        }
    }
}

/// What multiplies a column at a query.
#[derive(Debug, Clone)]
pub(crate) enum Weight {
    Tint(Tint),
    /// All that facets of one normal reflect, times a colour.
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

    /// The planes of a tile that mirror its table: facets of one normal are not what their mirror image is.
    pub(crate) fn mirrors(weights: &[Self], of_tile: [bool; 2]) -> [bool; 2] {
        if weights.iter().any(Self::is_lobe) { [false; 2] } else { of_tile }
    }

    #[inline]
    pub(crate) fn at(&self, pair: &PairVectors) -> Vec3 {
        match self {
            Self::Tint(tint) => tint.at(pair.i_dot_h),
            Self::Lobes { normal, terms, measured, color } => lobes(*normal, terms, measured, pair) * *color,
        }
    }
}

/// All that facets of one normal reflect.
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
