//! Visibility of the facets, by the algorithm that the plan chose.

use crate::base::Result;
use crate::cache::KeyBuilder;
use crate::geometry::{Facets, PeriodicGrid};
use crate::pipeline::Env;
use crate::pipeline::stage::{Codec, Keyed, Stage};
use crate::plan::{Settings, VisibilityAlgorithm};
use crate::visibility::{Azimuths, HorizonMap, OcclusionIntervals, SoftMaps, Visibility, cancellable_maps_cpu};

use super::TileShape;
use super::tile::hash_sampling_into;

/// Computes which directions each facet sees.
pub struct ComputeVisibility<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub algorithm: VisibilityAlgorithm,
    pub settings: &'a Settings,
    /// True if the settings are refined: visibility of the main settings stays in the memo.
    pub refined: bool,
    /// Visibility of the same facets along fewer azimuths. Its slices are reused, and the result has the same bits without it.
    pub coarser: Option<&'a Visibility>,
}

impl Stage for ComputeVisibility<'_> {
    type Output = Visibility;
    const NAME: &'static str = "visibility";
    const CODEC: Option<Codec<Visibility>> = Some(Codec::new("cached_visibility"));

    fn hash_into(&self, key: &mut KeyBuilder) {
        let settings = self.settings;
        key.key("surface", &self.tile.placing_key());
        hash_sampling_into(settings, key);
        key.counts("algorithm", [self.algorithm as usize]);
        key.counts("azimuths", [settings.horizon_azimuths, settings.slice_azimuths]);
        key.numbers("penumbra", &[settings.penumbra]);
        key.counts("maps", [settings.map_grid.rings, settings.map_grid.azimuths]);
        key.numbers("texels", &[settings.map_resolution]);
    }

    fn slot(&self) -> &'static str {
        if self.refined { "refined visibility" } else { Self::NAME }
    }

    fn run(&self, env: &Env) -> Result<Visibility> {
        let (mesh, facets, settings) = (&self.tile.mesh, &**self.facets, self.settings);
        let grid = || PeriodicGrid::for_slices(mesh).cancelled_by(&env.cancel);
        let width = settings.penumbra;
        let azimuths = match self.tile.across {
            Some(across) => Azimuths::Across(across),
            None => Azimuths::Even(settings.horizon_azimuths),
        };
        Ok(match (self.algorithm, &mesh.height_grid) {
            (VisibilityAlgorithm::None, _) => Visibility::Unblocked { facets: facets.len() },
            (VisibilityAlgorithm::HeightMarch, Some(heights)) => {
                let map = HorizonMap::cancellable_march(heights, mesh.size, facets, azimuths, width, &env.cancel);
                Visibility::HorizonMap(map)
            }
            (VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan, _) => {
                Visibility::HorizonMap(HorizonMap::scan_along(&grid(), facets, azimuths, width))
            }
            (VisibilityAlgorithm::OcclusionIntervals, _) => {
                let coarser = match self.coarser {
                    Some(Visibility::OcclusionIntervals(coarser)) => Some(coarser),
                    _ => None,
                };
                let azimuths = settings.slice_azimuths;
                let intervals = OcclusionIntervals::scan_between(coarser, &grid(), facets, azimuths, width);
                Visibility::OcclusionIntervals(intervals)
            }
            (VisibilityAlgorithm::GpuMaps | VisibilityAlgorithm::CpuMaps, _) => {
                let (grid, resolution) = (settings.map_grid, settings.map_resolution);
                let directions = grid.directions();
                let gpu = if self.algorithm == VisibilityAlgorithm::GpuMaps { env.gpu() } else { None };
                // If the GPU fails, the CPU computes the same maps.
                let packed = gpu
                    .and_then(|gpu| gpu.visibility_maps(mesh, facets, &directions, resolution, &env.cancel).ok())
                    .unwrap_or_else(|| cancellable_maps_cpu(mesh, facets, &directions, resolution, &env.cancel));
                Visibility::Maps(SoftMaps { grid, packed })
            }
        })
    }

    /// Maps from a GPU belong to that GPU, and take little time.
    fn may_be_stored(&self) -> bool {
        self.algorithm != VisibilityAlgorithm::GpuMaps
    }

    fn accepts(&self, visibility: &Visibility) -> bool {
        visibility.facets() == self.facets.len()
    }
}

/// Estimates the work of one slice of the mesh: cells and triangles that it visits.
pub struct EstimateScanWork<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
}

impl Stage for EstimateScanWork<'_> {
    type Output = f64;
    const NAME: &'static str = "scan_work";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key).key("facets", &self.facets.key);
    }

    fn run(&self, _: &Env) -> Result<f64> {
        Ok(OcclusionIntervals::mean_steps(&PeriodicGrid::for_slices(&self.tile.mesh), self.facets))
    }
}

/// Builds the grid of cells in which rays find the triangles of the tile, and with which the GPU cuts the mesh.
pub struct BuildCells<'a> {
    pub tile: &'a Keyed<TileShape>,
}

impl Stage for BuildCells<'_> {
    type Output = PeriodicGrid;
    const NAME: &'static str = "cells";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("surface", &self.tile.surface);
    }

    fn run(&self, _: &Env) -> Result<PeriodicGrid> {
        Ok(PeriodicGrid::new(&self.tile.mesh))
    }
}

/// Builds the hierarchy of triangles that rays through the cells' grid read, so that its time is stated apart. What casts rays
/// builds it where it is missing.
pub struct BuildHierarchy<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub grid: &'a PeriodicGrid,
}

impl Stage for BuildHierarchy<'_> {
    type Output = ();
    const NAME: &'static str = "hierarchy";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("surface", &self.tile.surface);
    }

    fn run(&self, _: &Env) -> Result<()> {
        self.grid.prepare_rays();
        Ok(())
    }
}
