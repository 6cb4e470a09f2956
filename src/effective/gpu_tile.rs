//! The inputs from which a GPU computes visibility and the sum over facets.

use std::sync::Arc;

use glam::Vec2;

use super::{FacetSum, Interpolation, Nodes};
use crate::geometry::{Facets, HeightGrid, PeriodicGrid, TileMesh};
use crate::math::directions::PolarGrid;
use crate::visibility::Visibility;

/// Facets, their lobes, and the input of their visibility.
#[derive(Debug)]
pub struct GpuTileInput {
    pub sum: Arc<FacetSum>,
    pub visibility_input: GpuVisibilityInput,
    /// Base area `A` of the tile.
    pub base_area: f64,
    /// Nodes of the shading table; `None` if no table is expected to pay.
    pub nodes: Option<Nodes<'static>>,
    pub interpolation: Interpolation,
}

/// The input from which a GPU computes visibility, or the visibility itself.
#[derive(Debug)]
pub enum GpuVisibilityInput {
    /// The CPU computed the visibility.
    Computed(Arc<Visibility>),
    /// The GPU marches over the samples of a height field.
    Heights(HeightMarchInput),
    /// The GPU slices the tile along azimuths.
    OcclusionIntervals(Box<SliceInput>),
    /// The GPU renders shadow maps of the tile from many directions.
    Maps(Box<ShadowMapInput>),
}

/// A tile that is intersected with vertical slices.
#[derive(Debug)]
pub struct SliceInput {
    pub grid: Arc<PeriodicGrid>,
    pub facets: Arc<Facets>,
    pub azimuths: usize,
    /// Width of the transition at a horizon [rad].
    pub transition_width: f32,
    /// True if the tile may have overhangs.
    pub overhangs: bool,
}

/// A height field, its tile and its facets.
#[derive(Debug)]
pub struct HeightMarchInput {
    pub samples: HeightGrid,
    pub tile_size: Vec2,
    pub facets: Arc<Facets>,
    pub azimuths: usize,
    /// Width of the transition at a horizon [rad].
    pub transition_width: f32,
}

/// A tile whose shadow maps are rendered from the nodes of a grid.
#[derive(Debug)]
pub struct ShadowMapInput {
    pub mesh: TileMesh,
    pub facets: Arc<Facets>,
    pub grid: PolarGrid,
    /// Texels per side.
    pub resolution: u32,
}
