//! What a device needs to know to make a table of a sum by itself.

use super::columns::{Column, Weight};
use super::{AREA_GRID, PairTable};
use crate::directions::PolarGrid;
use crate::filtering::Tint;
use crate::filtering::facet_sum::FacetSum;

/// A column that is one lobe of one group, summed over its facets.
#[derive(Debug, Clone)]
pub(crate) struct LobeColumn {
    pub(crate) group: usize,
    pub(crate) lobe: usize,
    /// Which colour weights of the facets; `None` where they are all the same.
    pub(crate) channel: Option<usize>,
    /// What multiplies the column at a query.
    pub(crate) tint: Tint,
}

impl PairTable {
    /// The columns of [`PairTable::build`] where all are lobes; else why not.
    pub(crate) fn lobe_columns(sum: &FacetSum) -> Result<Vec<LobeColumn>, &'static str> {
        let columns = Column::of(sum).ok_or("the sum has too many parts for a table to pay")?;
        let lobes = columns.iter().map(|column| {
            let (group, lobe, channel) = column.lobe()?;
            match column.weight(sum) {
                Weight::Tint(tint) => Ok(LobeColumn { group, lobe, channel, tint }),
                Weight::Lobes { .. } => Err("a column of the table has more than a tint"),
            }
        });
        lobes.collect()
    }

    /// Where a table knows the projected area.
    pub(crate) fn area_grid() -> PolarGrid {
        PolarGrid::new(AREA_GRID[0], AREA_GRID[1])
    }
}
