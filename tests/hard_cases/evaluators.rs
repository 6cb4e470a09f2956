//! The evaluators: everything that turns a scene into an effective BRDF, on the CPU at draft.

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
use crate::lab::open;

pub struct Evaluator {
    pub name: &'static str,
    pub brdf: Arc<EffectiveBrdf>,
    pub health: Health,
}

/// Direct first. `m_directions` of the paper's basis (`None`: as many as the paper, half a minute for a narrow lobe).
pub fn all(case: &Case, folder: &Path, m_directions: Option<usize>) -> Vec<Evaluator> {
    let mut pipeline = Pipeline::new();
    let mut made = Vec::new();
    for (name, method) in [("direct", "direct"), ("low rank", "low_rank")] {
        let outcome = pipeline
            .effective(&open(case, method, folder))
            .unwrap_or_else(|error| panic!("{}, {name}: {error}", case.name));
        let health = outcome.health().clone();
        made.push(Evaluator { name, brdf: outcome.brdf.clone(), health: health.clone() });
        if method == "direct" {
            // What pictures read; the direct sum itself where a table would not do.
            let shading_brdf = outcome.shading_brdf(&Cancel::default()).unwrap();
            made.push(Evaluator { name: "table", brdf: shading_brdf.brdf, health });
        }
    }
    let loaded = open(case, "direct", folder);
    let mesh = pipeline.mesh(&loaded).unwrap();
    let assigned = pipeline.materials(&loaded).unwrap();
    let mut facets = Facets::sample_wu2011(&mesh, 1500, 1);
    facets.sort_for_sums();
    let directions = ParaboloidMap::nearest_to(Wu2011Settings::VISIBILITY_DIRECTIONS);
    let visibility = visibility_maps_cpu(&mesh, &facets, directions.directions(), 128);
    let settings = Wu2011Settings { m_directions, ..Wu2011Settings::default() };
    let base_area = f64::from(mesh.base_area());
    let tile = VisibleFacets { facets: &facets, visibility: &visibility, directions: &directions, base_area };
    let factors: Vec<_> = assigned.1.iter().map(|material| factors(case, material, &settings)).collect();
    let tables = Wu2011::from_factors(&tile, &assigned.0, &assigned.1, &factors, &settings)
        .unwrap_or_else(|error| panic!("{}, wu2011: {error}", case.name));
    let brdf = Arc::new(EffectiveBrdf { representation: Representation::Wu2011(tables), base_area });
    let evidence = HealthInputs {
        facets: Arc::new(facets),
        sight: VisibilityInput::Packed(Arc::new(visibility)),
        names: vec!["default".to_owned(); assigned.1.len()],
        materials: Arc::new(assigned),
        closes_plane: mesh.closes_plane,
    };
    let mut health = Health::of(&brdf, &evidence, None, Limits { max_rank: 64, tolerance: 0.12 });
    // The paper's maps are yes or no on 137 directions: their area is 10 to 30 % off towards the horizon, as it says itself.
    health.result.projected_area_error = None;
    made.push(Evaluator { name: "wu2011", brdf, health });
    made
}

/// M of a BRDF, for all the cases that have it.
fn factors(case: &Case, material: &Material, settings: &Wu2011Settings) -> Option<Arc<MaterialFactors>> {
    type Known = Mutex<HashMap<(String, Option<usize>), Arc<MaterialFactors>>>;
    static KNOWN: LazyLock<Known> = LazyLock::new(Mutex::default);
    let key = (case.brdf.clone(), settings.m_directions);
    if let Some(known) = KNOWN.lock().unwrap().get(&key) {
        return Some(known.clone());
    }
    let made = MaterialFactors::new(material, settings).unwrap_or_else(|error| panic!("{}, M: {error}", case.name));
    let made = Arc::new(made);
    KNOWN.lock().unwrap().insert(key, made.clone());
    Some(made)
}
