//! What of a table is kept between runs: all but what multiplies its columns, which the sum tells.

use std::sync::Arc;

use glam::Vec4;

use super::columns::Column;
use crate::cache::{KeyBuilder, Reader, Stored, Writer};
use crate::effective::{Direct, Interpolation, Nodes, ShadingTable};
use crate::math::directions::HemispherePairGrid;

/// The numbers of a table of a sum; they serve every sum of the same lobes, whatever its colours.
#[derive(Debug, Clone)]
pub struct TableContent {
    values: Arc<Vec<Vec4>>,
    areas: Vec<f32>,
}

/// A larger table is none of ours.
const MAX_WORDS: usize = 1 << 28;

impl Nodes<'_> {
    pub(crate) fn hash_into(&self, key: &mut KeyBuilder) {
        let HemispherePairGrid { rings, azimuths, turn, difference } = self.grid;
        key.counts("grid", [rings, azimuths, turn, difference]).flags("mirrors", self.mirrors);
        key.counts("from facets", self.facets);
        if let Some(pairs) = self.read_by {
            let directions: Vec<[glam::Vec3; 2]> = pairs.iter().map(|pair| [pair.i, pair.o]).collect();
            key.numbers("read by", &directions);
        }
    }
}

impl ShadingTable {
    pub fn content(&self) -> TableContent {
        TableContent { values: self.values.clone(), areas: self.areas.1.clone() }
    }

    /// The table that [`ShadingTable::build`] made, for the same sum but for its colours; `None` for another sum or grid.
    pub fn of_content(direct: &Direct, grid: HemispherePairGrid, content: TableContent) -> Option<Self> {
        let weights: Vec<_> = Column::of(&direct.sum)?.iter().map(|column| column.weight(&direct.sum)).collect();
        let fours = weights.len().div_ceil(4);
        let areas = Self::area_grid();
        let nodes = grid.half_vectors() * grid.turn * (grid.difference + 2) * fours;
        (content.values.len() == nodes && content.areas.len() == areas.len()).then(|| Self {
            grid,
            interpolation: Interpolation::Cubic,
            weights,
            of_sum: true,
            fours,
            values: content.values,
            areas: Arc::new((areas, content.areas)),
        })
    }
}

impl Stored for TableContent {
    fn write(&self, out: &mut Writer) {
        // Trials fill a tenth of their nodes.
        out.sparse(bytemuck::cast_slice(&self.values));
        out.numbers(&self.areas);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let values = bytemuck::pod_collect_to_vec(&from.sparse(MAX_WORDS)?);
        Some(Self { values: Arc::new(values), areas: from.numbers()? })
    }
}
