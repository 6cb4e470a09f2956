//! A sum over facets as a device takes it that makes visibility and product itself.

use std::sync::Arc;

use glam::Vec2;

use super::{FacetSum, Interpolation, Nodes};
use crate::geometry::{Facets, HeightGrid, PeriodicGrid, TileMesh};
use crate::math::directions::PolarGrid;
use crate::visibility::Visibility;

/// Facets and their lobes, and how they come to see.
#[derive(Debug)]
pub struct GpuTileInput {
    pub sum: FacetSum,
    pub sight: GpuVisibilityInput,
    /// Base area `A` of the tile.
    pub base_area: f64,
    /// What a table for pictures is made of; absent where none is expected to pay.
    pub nodes: Option<Nodes<'static>>,
    pub interpolation: Interpolation,
}

/// How facets come to see.
#[derive(Debug)]
pub enum GpuVisibilityInput {
    /// The CPU saw for them.
    Seen(Arc<Visibility>),
    /// By walking this height-field.
    Heights(Heights),
    /// By cutting the tile along azimuths.
    OcclusionIntervals(Box<Sliced>),
    /// By drawing the tile from many directions.
    Maps(Box<Maps>),
}

/// A tile that is cut in vertical slices.
#[derive(Debug)]
pub struct Sliced {
    pub grid: Arc<PeriodicGrid>,
    pub facets: Arc<Facets>,
    pub azimuths: usize,
    /// Width of the soft step at a horizon [rad].
    pub ramp: f32,
    /// Whether anything may hang above a horizon.
    pub overhangs: bool,
}

/// A height-field, its tile and its facets.
#[derive(Debug)]
pub struct Heights {
    pub samples: HeightGrid,
    pub tile_size: Vec2,
    pub facets: Arc<Facets>,
    pub azimuths: usize,
    /// Width of the soft step at a horizon [rad].
    pub ramp: f32,
}

/// A tile that is drawn from the nodes of a grid.
#[derive(Debug)]
pub struct Maps {
    pub mesh: TileMesh,
    pub facets: Arc<Facets>,
    pub grid: PolarGrid,
    /// Texels a side.
    pub resolution: u32,
}
