use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::brdf::{Brdf, Term};
use crate::effective::{Direct, FacetSum, Material, Representation};
use crate::geometry::{self, Facets};
use crate::scene::{Flat, Geometry, Scene};
use crate::visibility::Visibility;

fn silent(_: f32) -> bool {
    true
}

/// A flat tile of some terms.
fn flat(terms: Vec<Term>) -> EffectiveBrdf {
    let tile = Scene::of(Geometry::Flat(Flat::default())).tile;
    let mesh = geometry::build(&tile, Path::new("")).unwrap();
    let mut facets = Facets::sample(&mesh, 16, 1);
    facets.sort_for_sums();
    let visibility = Visibility::Unblocked { facets: facets.len() };
    let sum = FacetSum::new(&facets, &[0], &[Material { brdf: Brdf { terms }, color: Vec3::ONE }]);
    EffectiveBrdf { form: Representation::Direct(Direct::new(Arc::new(sum), Arc::new(visibility))), base_area: 1.0 }
}

#[test]
fn a_flat_material_of_the_model_comes_back() {
    let (albedo, f0) = (Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.5, 0.6, 0.2));
    let brdf = flat(vec![Term::Lambertian { albedo }, Term::CookTorrance { roughness: 0.35, f0 }]);
    let found = fit(&brdf, Model::CookTorrance, &silent).unwrap();
    assert!((found.shape.roughness[0] - 0.35).abs() < 2e-3, "{found:?}");
    assert!((found.weights[0] - albedo).abs().max_element() < 5e-3, "{found:?}");
    assert!((found.weights[1] - f0).abs().max_element() < 5e-3 && found.errors.rel_l2 < 1e-2, "{found:?}");
    let brdf = flat(vec![Term::Lambertian { albedo }, Term::Ggx { roughness: 0.25, f0 }]);
    let found = fit(&brdf, Model::Ggx, &silent).unwrap();
    assert!(found.shape.roughness.iter().all(|alpha| (alpha - 0.25).abs() < 5e-3), "{found:?}");
    assert!((found.weights[1] - f0).abs().max_element() < 1e-2 && found.errors.rel_l2 < 1e-2, "{found:?}");
}

#[test]
fn a_matte_tile_has_no_edge_and_what_is_written_stays_in_the_ranges_of_the_formats() {
    let brdf = flat(vec![Term::Lambertian { albedo: Vec3::splat(0.7) }]);
    for model in Model::ALL {
        let found = fit(&brdf, model, &silent).unwrap();
        assert!(found.errors.rel_l2 < 1e-2 && (found.weights[0] - 0.7).abs().max_element() < 0.02, "{found:?}");
    }
    let rough = Fit {
        model: Model::Ggx,
        shape: LobeShape { roughness: [1.0, 0.5], rotation: 0.0, edge: 0.0 },
        weights: vec![Vec3::splat(0.5), Vec3::new(0.3, 0.2, 0.0), Vec3::splat(2.0)],
        errors: Errors { rel_l2: 0.1, psnr_db: 30.0 },
    };
    let file: serde_json::Value = serde_json::from_str(&gltf(&rough, "rough")).unwrap();
    let material = &file["materials"][0];
    assert!(material["pbrMetallicRoughness"]["roughnessFactor"].as_f64().unwrap() <= 1.0);
    let specular = &material["extensions"]["KHR_materials_specular"];
    // f0 is 0.04 times both factors.
    let strength = specular["specularFactor"].as_f64().unwrap();
    let f0 = 0.04 * strength * specular["specularColorFactor"][0].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&strength) && (f0 - 0.3).abs() < 1e-5, "{specular}");
    let document = materialx(&rough, "rough");
    assert!(document.contains("geometry_tangent") && document.contains("rotate3d"), "{document}");
    let metal =
        Fit { shape: LobeShape { roughness: [0.3; 2], ..rough.shape }, weights: vec![Vec3::ZERO, Vec3::ONE], ..rough };
    let file: serde_json::Value = serde_json::from_str(&gltf(&metal, "metal")).unwrap();
    assert!(file.get("extensionsUsed").is_none(), "an empty list is against the schema");
}

#[test]
fn materials_for_others_are_well_formed_and_hold_the_numbers() {
    let brdf = flat(vec![
        Term::Lambertian { albedo: Vec3::new(0.6, 0.3, 0.1) },
        Term::Ggx { roughness: 0.3, f0: Vec3::splat(0.04) },
    ]);
    let found = fit(&brdf, Model::Ggx, &silent).unwrap();
    let file: serde_json::Value = serde_json::from_str(&gltf(&found, "a \"name\"")).unwrap();
    let material = &file["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 0.0);
    let red = material["pbrMetallicRoughness"]["baseColorFactor"][0].as_f64().unwrap();
    let roughness = material["pbrMetallicRoughness"]["roughnessFactor"].as_f64().unwrap();
    assert!((red - 0.6).abs() < 0.02 && (roughness - 0.3_f64.sqrt()).abs() < 0.03, "{file}");
    let document = materialx(&found, "a \"name\"");
    assert!(document.contains("open_pbr_surface name=\"a__name__surface\"") && document.contains("specular_roughness"));
    assert_eq!(document.matches('<').count(), document.matches('>').count());
}

#[test]
fn a_fit_tells_its_progress_and_is_given_up_wherever_it_is_told_to() {
    let brdf = flat(vec![Term::Ggx { roughness: 0.3, f0: Vec3::splat(0.04) }]);
    for model in Model::ALL {
        let told = RefCell::new(Vec::new());
        let tell = |part| {
            told.borrow_mut().push(part);
            true
        };
        fit(&brdf, model, &tell).unwrap();
        let told = told.into_inner();
        assert!(told.first() == Some(&0.0) && told.last() == Some(&1.0) && told.is_sorted(), "{told:?}");
        // While targets are looked up, in the middle of the search, while the fit is checked.
        for part in [0.0, 0.2, 0.6, 0.95] {
            let until = |now| now < part;
            assert!(matches!(fit(&brdf, model, &until), Err(Error::Cancelled)), "{part}");
        }
    }
}
