//! Properties of a scene on which the plan's decisions rest.

use super::stage::Keyed;
use super::stages::{EstimateScanWork, TileShape};
use super::{Pipeline, StageTimes};
use crate::base::Result;
use crate::brdf::{Material, Term};
use crate::color_map::filter::is_naive_enough;
use crate::effective::FacetSum;
use crate::geometry::{ColorField, Facets};
use crate::interreflection::mean_albedo;
use crate::plan::{Backend, ColorMapFeatures, LargeScaleFeatures, SceneFeatures, Settings, VisibilityMethod};
use crate::scene::Scene;

/// Everything that comes before the plan.
pub(super) struct Surface<'a> {
    pub scene: &'a Scene,
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub sum: &'a FacetSum,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    pub settings: &'a Settings,
    /// True if the plan needs the cost of slicing under overhangs.
    pub wants_scan_work: bool,
}

impl Pipeline {
    /// The properties that take no rays: mirror planes and bounced light are not looked for.
    pub(super) fn features(&self, surface: &Surface<'_>) -> Result<SceneFeatures> {
        let Surface { scene, tile, facets, sum, materials, settings, .. } = *surface;
        let may_be_sliced = !tile.flat && (!tile.height_field || settings.visibility_method != VisibilityMethod::Auto);
        let draws_maps = !tile.flat && settings.visibility_method == VisibilityMethod::Maps;
        let gpu = if draws_maps && settings.backend != Backend::Cpu { self.env.gpu() } else { None };
        // Software Vulkan draws shadow maps far slower than the CPU, so that it is used only if a GPU is asked for.
        let maps_on_gpu = gpu.is_some_and(|gpu| settings.backend == Backend::Gpu || gpu.is_hardware());
        let scan_work = if surface.wants_scan_work && may_be_sliced && !maps_on_gpu {
            *self.get(EstimateScanWork { tile, facets }, &mut StageTimes::new())?
        } else {
            0.0
        };
        let mut is_used = vec![false; materials.len()];
        facets.slots.iter().for_each(|slot| is_used[surface.material_of_slot[usize::from(*slot)]] = true);
        let used: Vec<usize> = (0..materials.len()).filter(|material| is_used[*material]).collect();
        let black_materials = used.iter().filter(|index| materials[**index].is_black()).count();
        let terms = used.iter().flat_map(|index| &materials[*index].brdf.terms);
        Ok(SceneFeatures {
            flat: tile.flat,
            mirrors: None,
            bounced: None,
            steepest: tile.steepest,
            albedo: used.iter().map(|&k| albedo(&materials[k])).fold(0.0, f64::max),
            grey: used.iter().all(|&k| crate::interreflection::is_grey(&materials[k])) && !sum.colors_vary(),
            height_samples: tile.mesh.height_grid.is_some(),
            height_field: tile.height_field,
            extruded: tile.across.is_some(),
            closes_plane: tile.mesh.closes_plane,
            maps_on_gpu,
            triangles: tile.mesh.triangles.len(),
            scan_work,
            area_ratio: facets.areas.iter().map(|area| f64::from(*area)).sum::<f64>()
                / f64::from(tile.mesh.base_area()),
            materials: used.len() - black_materials,
            black_materials,
            colors_vary: sum.colors_vary(),
            lobes: sum.lobe_count(),
            lookups: sum.measured_count(),
            narrowest_lobe: terms.filter_map(Term::roughness).fold(f32::INFINITY, f32::min),
            distinct_normals: sum.normal_count(),
            large_scale: LargeScaleFeatures::of(scene),
            color_map: color_map_features(&tile.mesh.color),
        })
    }
}

/// Properties of the colour map on a tile.
fn color_map_features(color: &ColorField) -> Option<ColorMapFeatures> {
    let ColorField::Mapped { map, .. } = color else { return None };
    let places = map.places();
    Some(ColorMapFeatures {
        layers: map.layers.len(),
        samples: places.iter().map(|place| place.grid.values.len()).sum(),
        naive_is_enough: is_naive_enough(map),
    })
}

/// The largest part of uniform light that a material reflects in any channel.
fn albedo(material: &Material) -> f64 {
    f64::from((mean_albedo(&material.brdf, 3, 12) * material.color).max_element()).min(1.0)
}
