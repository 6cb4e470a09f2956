//! Evaluators: every way to compute an effective BRDF, at `draft` on the CPU.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex};

use biscale::base::Cancel;
use biscale::brdf::Material;
use biscale::diagnostics::{Health, HealthInputs, Limits, VisibilityInput};
use biscale::effective::{EffectiveBrdf, MaterialFactors, Representation, VisibleFacets, Wu2011, Wu2011Settings};
use biscale::geometry::Facets;
use biscale::math::directions::ParaboloidMap;
use biscale::pipeline::Pipeline;
use biscale::visibility::visibility_maps_cpu;

use crate::cases::Case;
use crate::examination::open;

pub struct Evaluator {
    pub name: &'static str,
    pub brdf: Arc<EffectiveBrdf>,
    pub health: Health,
}

/// Returns all evaluators of a case, the direct sum first. The paper's basis has `m_directions`; with `None` it has its
/// full number, which takes half a minute for a narrow lobe.
pub fn all(case: &Case, folder: &Path, m_directions: Option<usize>) -> Vec<Evaluator> {
    let pipeline = Pipeline::new();
    let mut evaluators = Vec::new();
    for (name, method) in [("direct", "direct"), ("low rank", "low_rank")] {
        let outcome = pipeline
            .effective(&open(case, method, folder))
            .unwrap_or_else(|error| panic!("{}, {name}: {error}", case.name));
        let health = outcome.health().clone();
        evaluators.push(Evaluator { name, brdf: outcome.brdf.clone(), health: health.clone() });
        if method == "direct" {
            // A table, or the direct sum itself if the table misses its bound.
            let shading_brdf = outcome.shading_brdf(&Cancel::default()).unwrap();
            evaluators.push(Evaluator { name: "table", brdf: shading_brdf.brdf, health });
        }
    }
    let loaded = open(case, "direct", folder);
    let mesh = pipeline.mesh(&loaded).unwrap();
    let materials = pipeline.materials(&loaded).unwrap();
    let mut facets = Facets::sample_wu2011(&mesh, 1500, 1);
    facets.sort_for_sums();
    let directions = ParaboloidMap::nearest_to(Wu2011Settings::VISIBILITY_DIRECTIONS);
    let visibility = visibility_maps_cpu(&mesh, &facets, directions.directions(), 128);
    let settings = Wu2011Settings { m_directions, ..Wu2011Settings::default() };
    let base_area = f64::from(mesh.base_area());
    let tile = VisibleFacets { facets: &facets, visibility: &visibility, directions: &directions, base_area };
    let factors: Vec<_> = materials.materials.iter().map(|material| factors(case, material, &settings)).collect();
    let tables = Wu2011::from_factors(&tile, &materials.material_of_slot, &materials.materials, &factors, &settings)
        .unwrap_or_else(|error| panic!("{}, wu2011: {error}", case.name));
    let brdf = Arc::new(EffectiveBrdf { representation: Representation::Wu2011(tables), base_area });
    let inputs = HealthInputs {
        facets: Arc::new(facets),
        visibility: VisibilityInput::Packed(Arc::new(visibility)),
        names: vec!["default".to_owned(); materials.materials.len()],
        materials: Arc::new(materials),
        closes_plane: mesh.closes_plane,
        size: mesh.size,
        color: mesh.color.clone(),
    };
    let limits = Limits { max_rank: 64, tolerance: 0.12, preset: "wu2011", error: None };
    let mut health = Health::of(&brdf, &inputs, None, None, limits);
    // The paper's maps have one bit per facet at 137 directions, so their projected area has a large error near the
    // horizon.
    health.result.projected_area_error = None;
    evaluators.push(Evaluator { name: "wu2011", brdf, health });
    evaluators
}

/// Returns the factor M of a BRDF, which cases with the same BRDF share.
fn factors(case: &Case, material: &Material, settings: &Wu2011Settings) -> Option<Arc<MaterialFactors>> {
    type Known = Mutex<HashMap<(String, Option<usize>), Arc<MaterialFactors>>>;
    static KNOWN: LazyLock<Known> = LazyLock::new(Mutex::default);
    let key = (case.brdf.clone(), settings.m_directions);
    if let Some(known) = KNOWN.lock().unwrap().get(&key) {
        return Some(known.clone());
    }
    let computed = MaterialFactors::new(material, settings).unwrap_or_else(|error| panic!("{}, M: {error}", case.name));
    let computed = Arc::new(computed);
    KNOWN.lock().unwrap().insert(key, computed.clone());
    Some(computed)
}
