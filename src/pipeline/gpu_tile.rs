//! The input of a GPU that computes visibility and product itself: the stages that come before them.

use super::inputs::{Processor, TileInputs};
use super::stages::{BuildCells, FindMirrorPlanes};
use super::{Pipeline, StageTimes, notes};
use crate::base::Result;
use crate::effective::{
    FacetSum, GpuTileInput, GpuVisibilityInput, HeightMarchInput, Nodes, ShadowMapInput, SliceInput,
};
use crate::plan::{Plan, Preset, Settings, VisibilityAlgorithm, VisibilityMethod};
use crate::scene::{LoadedScene, Switch};

/// A tile without its visibility and product, which the GPU computes.
#[derive(Debug)]
pub struct GpuTile {
    pub input: GpuTileInput,
    pub plan: Plan,
    pub settings: Settings,
    /// The stages that ran.
    pub times: StageTimes,
    pub notes: Vec<String>,
}

/// Finding mirror planes takes some milliseconds of the CPU, which is more than half of a table of fewer nodes takes
/// the GPU.
const MIRRORS_FROM: usize = 60_000;

/// Facets that the GPU draws for each half vector of a table.
const FACETS_PER_HALF_VECTOR: usize = 1600;

/// The most azimuths of visibility from which the GPU computes a table: on height fields, and under overhangs.
const MAX_AZIMUTHS: [usize; 2] = [48, 96];

/// Facets of a tile with few distinct normals, whose lobes are exact. The sequence that places facets spreads this many
/// well over the shipped tiles; a stride through more of them would cover grooves and pyramids unevenly.
const CLUSTERED_FACETS: usize = 700;

/// The most distinct normals that the GPU sums as clusters. With more, too few facets are left for each.
const MAX_CLUSTERS: usize = 16;

/// Returns true if the tile has few distinct normals and its visibility is a horizon map.
fn is_clustered(sum: &FacetSum, algorithm: VisibilityAlgorithm) -> bool {
    sum.supports_clustered_sum() && has_horizon_map(algorithm)
}

fn has_horizon_map(algorithm: VisibilityAlgorithm) -> bool {
    matches!(algorithm, VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan)
}

impl Pipeline {
    /// The input of a GPU that computes visibility and product itself. `None` if only the CPU computes all that the
    /// scene calls for: measured BRDFs summed over facets, interreflection, the paper's own tables.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn gpu_tile(&self, loaded: &LoadedScene) -> Result<Option<GpuTile>> {
        let mut times = StageTimes::new();
        let clustered = self.clustered_inputs(loaded, &mut times)?;
        let is_clustered_tile = clustered.is_some();
        let inputs = match clustered {
            Some(inputs) => inputs,
            None => self.tile_inputs(loaded, Processor::Gpu { max_facets: None }, &mut times)?,
        };
        let TileInputs { tile, sum, plan, settings, .. } = &inputs;
        if settings.preset == Preset::Wu2011 || plan.interreflection.is_some() || sum.measured_count() > 0 {
            return Ok(None);
        }
        if !is_clustered_tile && is_clustered(sum, plan.algorithm) {
            return Ok(None);
        }
        // A clustered sum is exact between the nodes of a table as well.
        let wants_table = plan.try_shading_table && !is_clustered_tile;
        // Nothing checks this table, so that it is finer than the first one of a CPU.
        let grid = settings.image_grids.iter().take(2).next_back().copied().filter(|_| wants_table);
        let visibility_input = self.gpu_visibility(&inputs, grid.is_some(), &mut times)?;
        let is_large = grid.is_some_and(|grid| grid.nodes() > MIRRORS_FROM);
        let mirrors = if is_large && settings.effects.mirror_symmetry != Switch::Off {
            let cells = match &visibility_input {
                GpuVisibilityInput::OcclusionIntervals(sliced) => Some(&*sliced.grid),
                _ => None,
            };
            *self.get(FindMirrorPlanes { tile, cells }, &mut times)?
        } else {
            [false; 2]
        };
        let base_area = f64::from(tile.mesh.base_area());
        let nodes = grid.map(|grid| Nodes { mirrors, facets: Some(FACETS_PER_HALF_VECTOR), ..Nodes::all(grid) });
        let notes = notes(&loaded.scene, &tile.mesh, &inputs.facets);
        let TileInputs { sum, plan, settings, .. } = inputs;
        let interpolation = settings.interpolation;
        let input = GpuTileInput { sum, visibility_input, base_area, nodes, interpolation };
        Ok(Some(GpuTile { input, plan, settings, times, notes }))
    }

    /// The input from which the GPU computes visibility by the plan's algorithm, or visibility by the CPU. A table
    /// needs fewer azimuths.
    fn gpu_visibility(
        &self,
        inputs: &TileInputs,
        for_table: bool,
        times: &mut StageTimes,
    ) -> Result<GpuVisibilityInput> {
        let TileInputs { tile, facets, plan, settings, .. } = inputs;
        let [of_horizons, of_intervals] = MAX_AZIMUTHS.map(|most| if for_table { most } else { usize::MAX });
        let of_horizons = settings.horizon_azimuths.min(of_horizons);
        let of_intervals = settings.slice_azimuths.min(of_intervals);
        let (mesh, facets) = (&tile.mesh, facets.value.clone());
        Ok(match (plan.algorithm, &mesh.height_grid) {
            // The GPU computes no horizons across grooves, and the CPU needs only two of each facet.
            (VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan, _) if tile.across.is_some() => {
                GpuVisibilityInput::Computed(self.visibility(inputs, times)?.value)
            }
            (VisibilityAlgorithm::HeightMarch, Some(samples)) => GpuVisibilityInput::Heights(HeightMarchInput {
                samples: samples.clone(),
                tile_size: mesh.size,
                facets,
                azimuths: of_horizons,
                transition_width: settings.penumbra,
            }),
            (VisibilityAlgorithm::GpuMaps | VisibilityAlgorithm::CpuMaps, _)
                if settings.visibility_method == VisibilityMethod::Maps =>
            {
                GpuVisibilityInput::Maps(Box::new(ShadowMapInput {
                    mesh: mesh.clone(),
                    facets,
                    grid: settings.map_grid,
                    resolution: settings.map_resolution,
                }))
            }
            (VisibilityAlgorithm::None | VisibilityAlgorithm::HeightMarch, _) => {
                GpuVisibilityInput::Computed(self.visibility(inputs, times)?.value)
            }
            (algorithm, _) => {
                let overhangs = algorithm != VisibilityAlgorithm::HorizonScan;
                GpuVisibilityInput::OcclusionIntervals(Box::new(SliceInput {
                    grid: self.get(BuildCells { tile }, times)?.value,
                    facets,
                    azimuths: if overhangs { of_intervals } else { of_horizons },
                    transition_width: settings.penumbra,
                    overhangs,
                }))
            }
        })
    }

    /// The inputs with few facets, if the tile has few distinct normals and a horizon map. More facets are taken if one
    /// material has a small share of the area.
    fn clustered_inputs(&self, loaded: &LoadedScene, times: &mut StageTimes) -> Result<Option<TileInputs>> {
        if self.tile(loaded, times)?.mesh.distinct_normals(MAX_CLUSTERS).is_none() {
            return Ok(None);
        }
        for max_facets in [1, 4, 16].map(|times| times * CLUSTERED_FACETS) {
            let inputs = self.tile_inputs(loaded, Processor::Gpu { max_facets: Some(max_facets) }, times)?;
            let TileInputs { sum, plan, settings, .. } = &inputs;
            let is_small = sum.reflecting_normal_count().is_some_and(|normals| normals <= MAX_CLUSTERS);
            if is_clustered(sum, plan.algorithm) && is_small {
                return Ok(Some(inputs));
            }
            if !has_horizon_map(plan.algorithm) || sum.colors_vary() || settings.facets < max_facets {
                break;
            }
        }
        Ok(None)
    }
}
