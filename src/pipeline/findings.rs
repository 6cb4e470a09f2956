//! What a scene is like: all that the plan's decisions rest on.

use std::sync::Arc;

use super::stage::Version;
use super::{Pipeline, TileShape};
use crate::brdf::Term;
use crate::effective::{FacetSum, Material};
use crate::geometry::Facets;
use crate::geometry::PeriodicGrid;
use crate::gpu::Gpu;
use crate::interreflection::mean_albedo;
use crate::plan::{Backend, SceneFeatures, Settings, VisibilityMethod};
use crate::scene::Scene;
use crate::visibility::OcclusionIntervals;

impl Pipeline {
    #[expect(clippy::too_many_arguments, reason = "one place that gathers all there is to know")]
    pub(super) fn findings(
        &mut self,
        scene: &Scene,
        shape: &TileShape,
        facets: &Facets,
        sum: &FacetSum,
        material_of_slot: &[usize],
        materials: &[Material],
        settings: &Settings,
        costs_of: Option<Version>,
    ) -> SceneFeatures {
        let needs_maps = !shape.flat && (!shape.height_field || settings.sighting != VisibilityMethod::Auto);
        let allowed = settings.backend != Backend::Cpu && !self.without_device;
        if needs_maps && allowed && !self.gpu_asked {
            self.gpu_asked = true;
            self.gpu = Gpu::open().ok().map(Arc::new);
        }
        // The processor in disguise draws shadow maps far slower than the processor slices (the draft of the pillow: 78 s, not 0.1):
        // only where both are asked for.
        let asked = settings.backend == Backend::Gpu && settings.sighting == VisibilityMethod::Maps;
        let hardware_gpu =
            allowed && self.gpu.as_ref().is_some_and(|gpu| asked || gpu.tier == crate::gpu::Tier::Hardware);
        let scan_work = match (self.scan_work, costs_of) {
            (Some((known, work)), Some(version)) if known == version => work,
            (_, Some(version)) if needs_maps && !hardware_gpu => {
                let work = OcclusionIntervals::work(&PeriodicGrid::for_slices(&shape.mesh), facets);
                self.scan_work = Some((version, work));
                work
            }
            _ => 0.0,
        };
        let mut used: Vec<usize> = facets.slots.iter().map(|slot| material_of_slot[usize::from(*slot)]).collect();
        used.sort_unstable();
        used.dedup();
        let is_black = |index: &&usize| materials[**index].is_black();
        let black_materials = used.iter().filter(is_black).count();
        let is_lambertian =
            |index: &usize| materials[*index].brdf.terms.iter().all(|term| matches!(term, Term::Lambertian { .. }));
        SceneFeatures {
            flat: shape.flat,
            mirrors: None,
            steepest: shape.steepest,
            albedo: used.iter().map(|&k| albedo(&materials[k])).fold(0.0, f64::max),
            grey: used.iter().all(|&k| crate::interreflection::is_grey(&materials[k])) && !sum.colors_vary(),
            height_samples: shape.mesh.height_grid.is_some(),
            height_field: shape.height_field,
            closes_plane: shape.mesh.closes_plane,
            hardware_gpu,
            triangles: shape.mesh.triangles.len(),
            scan_work,
            area_ratio: facets.areas.iter().map(|area| f64::from(*area)).sum::<f64>()
                / f64::from(shape.mesh.base_area()),
            materials: used.len() - black_materials,
            black_materials,
            colors_vary: sum.colors_vary(),
            lobes: sum.lobe_count(),
            lookups: sum.measured_count(),
            only_lambertian: used.iter().all(is_lambertian),
            distinct_normals: sum.patch_count(),
            object_self_shadows: !matches!(scene.object.kind.as_str(), "sphere" | "cylinder"),
            lights: scene.light.count + scene.light.directional.len(),
            lights_below: scene.light.directional.iter().filter(|light| light.direction.y < 0.0).count(),
        }
    }
}

/// The largest part of uniform light that a material reflects in any channel.
fn albedo(material: &Material) -> f64 {
    f64::from((mean_albedo(&material.brdf, 3, 12) * material.color).max_element()).min(1.0)
}
