//! The stages before visibility, and the plan.

use std::sync::Arc;

use super::features::Surface;
use super::stages::{
    BuildCells, BuildHierarchy, FacetsRole, FindMirrorPlanes, MeasureBouncedShare, PrepareSamplers, Reflection,
    TileShape,
};
use super::{Keyed, Pipeline, StageTimes};
use crate::base::Result;
use crate::brdf::MaterialAssignment;
use crate::cache::Key;
use crate::effective::FacetSum;
use crate::geometry::Facets;
use crate::plan::{Costs, Plan, Refinement, SceneFeatures, Settings};
use crate::scene::{LoadedScene, Switch};
use crate::visibility::HorizonMap;

/// The processor that computes visibility and product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Processor {
    /// The plan compares the costs of the CPU's algorithms.
    Cpu(Refinement),
    /// The GPU. `max_facets` limits the facets of a clustered sum; `None` keeps the setting.
    Gpu { max_facets: Option<usize> },
}

/// The inputs of visibility: the tile, its materials and facets, and the plan.
pub(super) struct TileInputs {
    pub tile: Keyed<TileShape>,
    pub settings: Settings,
    pub materials: Keyed<MaterialAssignment>,
    pub facets: Keyed<Facets>,
    /// The material of each slot as the sum uses them.
    pub material_of_slot: Vec<usize>,
    pub sum: Arc<FacetSum>,
    pub plan: Plan,
    /// True if `settings` are finer than those of the scene.
    pub refined: bool,
}

impl Pipeline {
    /// Runs the stages before visibility.
    pub(super) fn tile_inputs(
        &self,
        loaded: &LoadedScene,
        processor: Processor,
        times: &mut StageTimes,
    ) -> Result<TileInputs> {
        super::slab::refuse_slab(loaded, "this computation")?;
        let scene = &loaded.scene;
        let tile = self.tile(loaded, times)?;
        let mut settings = Settings::of(scene);
        let role = match processor {
            Processor::Cpu(Refinement::NONE) | Processor::Gpu { max_facets: None } => FacetsRole::Main,
            Processor::Cpu(refinement) => {
                settings = refinement.apply(&settings);
                FacetsRole::Refined
            }
            Processor::Gpu { max_facets: Some(most) } => {
                settings.facets = settings.facets.min(most);
                FacetsRole::Clusters
            }
        };
        if tile.across.is_some() {
            settings.horizon_azimuths = HorizonMap::AZIMUTHS_OF_GROOVES;
        }
        let materials = self.assignment(loaded, &tile, times)?;
        let facets = self.facets(&tile, &settings, role, times)?;
        let material_of_slot = grouped(&materials.material_of_slot, &facets, &settings);
        let mut sum = FacetSum::new(&facets, &material_of_slot, &materials.materials);
        sum.force(&facets, &settings.effects);
        let surface = Surface {
            scene,
            tile: &tile,
            facets: &facets,
            sum: &sum,
            material_of_slot: &material_of_slot,
            materials: &materials.materials,
            settings: &settings,
            wants_scan_work: matches!(processor, Processor::Cpu(_)),
        };
        let mut features = self.features(&surface)?;
        self.examine_bounces(&mut features, &surface, materials.key, times)?;
        let plan = Plan::new(&features, &settings, &Costs::default());
        let sum = Arc::new(sum);
        let refined = role == FacetsRole::Refined;
        Ok(TileInputs { tile, settings, materials, facets, material_of_slot, sum, plan, refined })
    }

    /// Measures the share of bounced light if the plan needs it, and looks for mirror planes if interreflection uses
    /// them.
    fn examine_bounces(
        &self,
        features: &mut SceneFeatures,
        surface: &Surface<'_>,
        assignment: Key,
        times: &mut StageTimes,
    ) -> Result<()> {
        let Surface { tile, material_of_slot, materials, settings, .. } = *surface;
        if features.needs_bounced_share(settings) {
            let samplers = &self.get(PrepareSamplers { materials }, times)?;
            let reflection = &Reflection { assignment, material_of_slot, materials, samplers };
            let grid = &self.get(BuildCells { tile }, times)?;
            self.get(BuildHierarchy { tile, grid }, times)?;
            features.bounced = Some(*self.get(MeasureBouncedShare { tile, grid, reflection }, times)?);
        }
        if features.interreflects(settings) && settings.effects.mirror_symmetry == Switch::Auto {
            let grid = &self.get(BuildCells { tile }, times)?;
            features.mirrors = Some(*self.get(FindMirrorPlanes { tile, cells: Some(grid) }, times)?);
        }
        Ok(())
    }
}

/// The material of each slot. If all materials are forced into one, it is that of the largest area.
fn grouped(material_of_slot: &[usize], facets: &Facets, settings: &Settings) -> Vec<usize> {
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
