use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::brdf::{Brdf, Material, Term};
use crate::effective::{Direct, FacetSum, Representation};
use crate::geometry::{self, Facets};
use crate::scene::{Flat, Geometry, Scene};
use crate::visibility::Visibility;

fn never_cancel(_: f32) -> bool {
    true
}

/// Returns the effective BRDF of a flat tile with these terms.
fn flat(terms: Vec<Term>) -> EffectiveBrdf {
    let tile = Scene::of(Geometry::Flat(Flat::default())).tile;
    let mesh = geometry::build(&tile, Path::new("")).unwrap();
    let mut facets = Facets::sample(&mesh, 16, 1);
    facets.sort_for_sums();
    let visibility = Visibility::Unblocked { facets: facets.len() };
    let sum = FacetSum::new(&facets, &[0], &[Material { brdf: Brdf { terms }, color: Vec3::ONE }]);
    EffectiveBrdf {
        representation: Representation::Direct(Direct::new(Arc::new(sum), Arc::new(visibility))),
        base_area: 1.0,
    }
}

#[test]
fn a_material_that_is_not_finite_is_refused() {
    let error = fit(&flat(vec![Term::Lambertian { albedo: Vec3::INFINITY }]), Model::Ggx, &never_cancel).unwrap_err();
    assert!(error.exit_code() == 1 && error.to_string().contains("not finite"), "{error}");
}

#[test]
fn a_flat_material_of_the_model_comes_back() {
    let (albedo, f0) = (Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.5, 0.6, 0.2));
    let brdf = flat(vec![Term::Lambertian { albedo }, Term::CookTorrance { roughness: 0.35, f0 }]);
    let fitted = fit(&brdf, Model::CookTorrance, &never_cancel).unwrap();
    assert!((fitted.shape.roughness[0] - 0.35).abs() < 2e-3, "{fitted:?}");
    assert!((fitted.weights[0] - albedo).abs().max_element() < 5e-3, "{fitted:?}");
    assert!((fitted.weights[1] - f0).abs().max_element() < 5e-3 && fitted.errors.rel_l2 < 1e-2, "{fitted:?}");
    let brdf = flat(vec![Term::Lambertian { albedo }, Term::Ggx { roughness: 0.25, f0 }]);
    let fitted = fit(&brdf, Model::Ggx, &never_cancel).unwrap();
    assert!(fitted.shape.roughness.iter().all(|alpha| (alpha - 0.25).abs() < 5e-3), "{fitted:?}");
    assert!((fitted.weights[1] - f0).abs().max_element() < 1e-2 && fitted.errors.rel_l2 < 1e-2, "{fitted:?}");
}

#[test]
fn a_diffuse_tile_fits_without_a_lobe_and_files_stay_in_the_ranges_of_their_formats() {
    let brdf = flat(vec![Term::Lambertian { albedo: Vec3::splat(0.7) }]);
    for model in Model::ALL {
        let fitted = fit(&brdf, model, &never_cancel).unwrap();
        assert!(fitted.errors.rel_l2 < 1e-2 && (fitted.weights[0] - 0.7).abs().max_element() < 0.02, "{fitted:?}");
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
    assert!(file.get("extensionsUsed").is_none(), "the schema forbids an empty list");
}

#[test]
fn material_files_are_well_formed_and_contain_the_fit() {
    let brdf = flat(vec![
        Term::Lambertian { albedo: Vec3::new(0.6, 0.3, 0.1) },
        Term::Ggx { roughness: 0.3, f0: Vec3::splat(0.04) },
    ]);
    let fitted = fit(&brdf, Model::Ggx, &never_cancel).unwrap();
    let file: serde_json::Value = serde_json::from_str(&gltf(&fitted, "a \"name\"")).unwrap();
    let material = &file["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 0.0);
    let red = material["pbrMetallicRoughness"]["baseColorFactor"][0].as_f64().unwrap();
    let roughness = material["pbrMetallicRoughness"]["roughnessFactor"].as_f64().unwrap();
    assert!((red - 0.6).abs() < 0.02 && (roughness - 0.3_f64.sqrt()).abs() < 0.03, "{file}");
    let document = materialx(&fitted, "a \"name\"");
    assert!(document.contains("open_pbr_surface name=\"a__name__surface\"") && document.contains("specular_roughness"));
    assert_eq!(document.matches('<').count(), document.matches('>').count());
}

#[test]
fn a_fit_reports_its_progress_and_is_cancelled_in_every_phase() {
    let brdf = flat(vec![Term::Ggx { roughness: 0.3, f0: Vec3::splat(0.04) }]);
    for model in Model::ALL {
        let reports = RefCell::new(Vec::new());
        let record = |done| {
            reports.borrow_mut().push(done);
            true
        };
        fit(&brdf, model, &record).unwrap();
        let reports = reports.into_inner();
        assert!(reports.first() == Some(&0.0) && reports.last() == Some(&1.0) && reports.is_sorted(), "{reports:?}");
        // While targets are evaluated, in the middle of the search, and while the fit is checked.
        for limit in [0.0, 0.2, 0.6, 0.95] {
            let until = |done| done < limit;
            assert!(matches!(fit(&brdf, model, &until), Err(Error::Cancelled)), "{limit}");
        }
    }
}
