//! What single stages make, as plain functions of their input.

use super::MaterialAssignment;
use crate::base::{Cancel, Result};
use crate::effective::mean_colors;
use crate::geometry::PeriodicGrid;
use crate::geometry::{FacetSampler, Facets, SampleShift, TileMesh};
use crate::gpu::Gpu;
use crate::gpu::visibility_maps_gpu;
use crate::plan::{Preset, Settings, VisibilityAlgorithm};
use crate::scene::{Scene, Switch};
use crate::visibility::{HorizonMap, OcclusionIntervals, SoftMaps, Visibility, visibility_maps_cpu};

/// Facets of a tile, in the order that sums want.
pub(super) fn sample(mesh: &TileMesh, settings: &Settings) -> Facets {
    let mut facets = if settings.preset == Preset::Wu2011 {
        Facets::sample_wu2011(mesh, settings.facets, settings.seed)
    } else {
        FacetSampler::new(mesh).sample(mesh, settings.facets, SampleShift::from_seed(settings.seed))
    };
    if let Some(bins) = settings.normal_bins {
        facets.bin_normals(bins);
    }
    facets.sort_for_sums();
    if settings.effects.color_weights == Switch::Off {
        mean_colors(&mut facets);
    }
    facets
}

/// The material of each slot; where materials are forced into one, that of the largest area.
pub(super) fn grouped(material_of_slot: &[usize], facets: &Facets, settings: &Settings) -> Vec<usize> {
    if settings.effects.material_groups != Switch::Off {
        return material_of_slot.to_vec();
    }
    let mut areas = vec![0.0_f64; material_of_slot.len()];
    for (slot, area) in facets.slots.iter().zip(&facets.areas) {
        areas[usize::from(*slot)] += f64::from(*area);
    }
    let largest = (0..areas.len()).max_by(|a, b| areas[*a].total_cmp(&areas[*b])).unwrap_or(0);
    material_of_slot.iter().map(|_| material_of_slot[largest]).collect()
}

pub(super) fn see(
    route: VisibilityAlgorithm,
    mesh: &TileMesh,
    facets: &Facets,
    settings: &Settings,
    gpu: Option<&Gpu>,
    cancel: &Cancel,
) -> Result<Visibility> {
    let periodic = || PeriodicGrid::for_slices(mesh).cancelled_by(cancel);
    let (azimuths, ramp) = (settings.horizon_azimuths, settings.penumbra);
    Ok(match (route, &mesh.height_grid, gpu) {
        (VisibilityAlgorithm::None, ..) => Visibility::Unblocked { facets: facets.len() },
        (VisibilityAlgorithm::HeightMarch, Some(heights), _) => {
            Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, facets, azimuths, ramp))
        }
        (VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan, ..) => {
            Visibility::HorizonMap(HorizonMap::scan(&periodic(), facets, azimuths, ramp))
        }
        (VisibilityAlgorithm::OcclusionIntervals, ..) => {
            Visibility::OcclusionIntervals(OcclusionIntervals::scan(&periodic(), facets, settings.slice_azimuths, ramp))
        }
        (VisibilityAlgorithm::GpuMaps | VisibilityAlgorithm::CpuMaps, ..) => {
            let (grid, resolution) = (settings.map_grid, settings.map_resolution);
            // A GPU that fails is no reason to stop: the CPU's maps are the same.
            let packed = match (route, gpu) {
                (VisibilityAlgorithm::GpuMaps, Some(gpu)) => {
                    visibility_maps_gpu(gpu, mesh, facets, &grid.directions(), resolution, cancel).ok()
                }
                _ => None,
            };
            let packed = packed.unwrap_or_else(|| visibility_maps_cpu(mesh, facets, &grid.directions(), resolution));
            Visibility::Maps(SoftMaps { grid, packed })
        }
    })
}

pub(super) fn same_lobes((slots, materials): &MaterialAssignment, (other_slots, others): &MaterialAssignment) -> bool {
    slots == other_slots
        && materials.len() == others.len()
        && materials.iter().zip(others).all(|(a, b)| a.same_lobes(b))
}

/// What each assigned material is called.
pub(super) fn names(
    scene: &Scene,
    mesh: &TileMesh,
    (material_of_slot, materials): &MaterialAssignment,
) -> Result<Vec<String>> {
    let mut names = vec![String::new(); materials.len()];
    for (slot, &material) in mesh.slots.iter().zip(material_of_slot) {
        scene.material_for_slot(slot)?.name.clone_into(&mut names[material]);
    }
    Ok(names)
}
