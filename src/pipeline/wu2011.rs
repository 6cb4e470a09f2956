//! The paper's own method as one path through the pipeline.

use std::sync::Arc;
use std::time::Instant;

use super::inputs::TileInputs;
use super::shading::{Shading, ShadingKeys};
use super::stage::elapsed_ms;
use super::stages::PaperTables;
use super::{Outcome, Pipeline, StageTimes, material_names, notes};
use crate::base::Result;
use crate::brdf::MaterialAssignment;
use crate::diagnostics::{HealthInputs, VisibilityInput};
use crate::effective::{EffectiveBrdf, Representation, VisibleFacets, Wu2011, Wu2011Settings};
use crate::math::directions::ParaboloidMap;
use crate::scene::Scene;
use crate::visibility::cancellable_maps_cpu;

impl Pipeline {
    /// The paper's own method (Wu et al. 2011, Sec. 3.2 to 3.7): its directions, its facets, its truncations.
    pub(super) fn wu2011(&self, scene: &Scene, inputs: TileInputs, mut times: StageTimes) -> Result<Outcome> {
        let TileInputs { tile, settings, materials, facets, material_of_slot, mut plan, .. } = inputs;
        let paper_settings =
            Wu2011Settings { seed: settings.seed, colors: settings.colors.unwrap_or(1), ..Wu2011Settings::default() };
        let start = Instant::now();
        let directions = ParaboloidMap::nearest_to(Wu2011Settings::VISIBILITY_DIRECTIONS);
        let (cancel, texels) = (&self.env.cancel, settings.map_resolution);
        cancel.begin("visibility");
        let visibility = cancellable_maps_cpu(&tile.mesh, &facets, directions.directions(), texels, cancel);
        cancel.end();
        cancel.check()?;
        times.push(("visibility", elapsed_ms(start)));
        let factors = PaperTables { materials: &materials.materials, settings: &paper_settings };
        let factors = self.get(factors, &mut times)?;
        let start = Instant::now();
        let base_area = f64::from(tile.mesh.base_area());
        let visible = VisibleFacets { facets: &facets, visibility: &visibility, directions: &directions, base_area };
        let tables =
            Wu2011::from_factors(&visible, &material_of_slot, &materials.materials, &factors, &paper_settings)?;
        times.push(("product", elapsed_ms(start)));
        plan.note_times(&times);
        let brdf = Arc::new(EffectiveBrdf { representation: Representation::Wu2011(tables), base_area });
        let names = material_names(scene, &tile.mesh, &materials)?;
        let keys =
            ShadingKeys { surface: facets.key, lobes: materials.key, facets: facets.key, visibility: facets.key };
        let stored = (&self.recent_tables, &self.disk);
        let shading = Shading::new(brdf.clone(), &tile, &settings, false, keys, stored);
        let health_inputs = HealthInputs {
            facets: facets.value.clone(),
            visibility: VisibilityInput::Packed(Arc::new(visibility)),
            materials: Arc::new(MaterialAssignment { material_of_slot, materials: materials.materials.clone() }),
            names,
            closes_plane: tile.mesh.closes_plane,
            size: tile.mesh.size,
            color: tile.mesh.color.clone(),
        };
        Ok(Outcome {
            brdf,
            plan,
            settings,
            times,
            factored: None,
            notes: notes(scene, &tile.mesh, &facets),
            health_inputs,
            examined: Arc::default(),
            shading: Arc::new(shading),
            direct: None,
            estimator: Arc::default(),
            close_to_bound: false,
        })
    }
}
