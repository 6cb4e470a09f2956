//! The part of a shading table that is cached on disk: everything but the weights of its columns, which follow from the
//! sum.

use std::sync::Arc;

use glam::Vec4;

use super::columns::Column;
use crate::cache::{KeyBuilder, Reader, Stored, Writer};
use crate::effective::{Direct, Interpolation, Nodes, ShadingTable};
use crate::math::directions::HemispherePairGrid;

/// The numbers of a shading table. They are valid for every sum with the same lobes, regardless of its colours.
#[derive(Debug, Clone)]
pub struct TableContent {
    values: Arc<Vec<Vec4>>,
    areas: Vec<f32>,
}

/// Largest number of words in a stored table; a file with more is not read.
const MAX_WORDS: usize = 1 << 28;

impl Nodes<'_> {
    /// Hashes the grid and everything that selects and computes its nodes. Known nodes change no value.
    pub(crate) fn hash_into(&self, key: &mut KeyBuilder) {
        let HemispherePairGrid { rings, azimuths, phi_d, theta_d } = self.grid;
        key.counts("grid", [rings, azimuths, phi_d, theta_d]).flags("mirrors", self.mirrors);
        key.counts("from facets", self.facets);
        if let Some(pairs) = self.read_by {
            let directions: Vec<[glam::Vec3; 2]> = pairs.iter().map(|pair| [pair.i, pair.o]).collect();
            key.numbers("read by", &directions);
        }
    }
}

impl ShadingTable {
    /// The numbers of the table, to be stored.
    pub fn content(&self) -> TableContent {
        TableContent { values: self.values.clone(), areas: self.areas.1.clone() }
    }

    /// Makes the table that [`ShadingTable::build`] returned from its content, for a sum that may differ in colours.
    /// `None` if the content does not fit the sum or grid.
    pub fn from_content(direct: &Direct, grid: HemispherePairGrid, content: TableContent) -> Option<Self> {
        let weights: Vec<_> = Column::of(&direct.sum)?.iter().map(|column| column.weight(&direct.sum)).collect();
        let vec4s = weights.len().div_ceil(4);
        let areas = Self::area_grid();
        let nodes = grid.half_vectors() * grid.phi_d * (grid.theta_d + 2) * vec4s;
        (content.values.len() == nodes && content.areas.len() == areas.len()).then(|| Self {
            grid,
            interpolation: Interpolation::Cubic,
            bounced_weights: Vec::new(),
            weights,
            vec4s,
            values: content.values,
            areas: Arc::new((areas, content.areas)),
        })
    }
}

impl TableContent {
    /// The size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&**self.values) + size_of_val(&*self.areas)
    }
}

impl Stored for TableContent {
    fn write(&self, out: &mut Writer) {
        // Most nodes of a trial table are zero.
        out.sparse(bytemuck::cast_slice(&self.values));
        out.numbers(&self.areas);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let values = bytemuck::pod_collect_to_vec(&from.sparse(MAX_WORDS)?);
        Some(Self { values: Arc::new(values), areas: from.numbers()? })
    }
}
