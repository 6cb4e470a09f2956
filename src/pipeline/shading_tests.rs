use glam::Vec3;

use super::{FEW_FACETS, enough_facets};
use crate::base::Cancel;
use crate::effective::{Reflectance, Representation};
use crate::metrics::{Errors, image_pairs};
use crate::pipeline::Pipeline;
use crate::scene::{self, LoadedScene};

#[test]
fn images_read_one_table_of_direct_and_of_bounced_light() {
    let source = "[tile]\ngeometry = { kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.3 }\n\
        [[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.4, f0 = 0.9 }\n\
        [quality]\npreset = \"draft\"\nbackend = \"cpu\"\nmethod = \"direct\"\n\
        [effects]\ninterreflection = \"on\"\npicture_table = \"on\"\n";
    let loaded = LoadedScene {
        scene: scene::parse(source).unwrap(),
        base_dir: "".into(),
        name: "test".to_owned(),
        painted: scene::Painted::default(),
    };
    let outcome = Pipeline::new().effective(&loaded).unwrap();
    let shading = outcome.shading_brdf(&Cancel::default()).unwrap();
    assert!(matches!(shading.brdf.representation, Representation::Table(_)), "{:?}", shading.errors);
    let (mut error, mut norm) = (0.0, 0.0);
    for pair in image_pairs(300, 4) {
        let bounced = [&shading.brdf, &outcome.brdf].map(|brdf| {
            let mut bounced = [Vec3::ZERO];
            brdf.eval_bounced(&[pair.i], pair.o, &mut bounced);
            bounced[0].as_dvec3()
        });
        error += (bounced[0] - bounced[1]).length_squared();
        norm += bounced[1].length_squared();
    }
    let error = (error / norm).sqrt();
    eprintln!("bounced light of the table: {error:.4}, all light {:?}", shading.errors);
    assert!(norm > 0.0 && error < 0.1, "{error}");
    assert!(shading.errors.unwrap().rel_l2 < 0.1, "{:?}", shading.errors);
}

#[test]
fn images_of_a_weave_and_of_rods_read_tables_within_their_tolerance() {
    for (geometry, preset, [rel_l2, psnr_db]) in [
        ("{ kind = \"weave\" }", "draft", [0.35, 26.0]),
        ("{ kind = \"rods\" }", "draft", [0.35, 26.0]),
        ("{ kind = \"weave\" }", "standard", [0.08, 38.0]),
    ] {
        let source = format!(
            "[tile]\ngeometry = {geometry}\n[quality]\npreset = \"{preset}\"\nbackend = \"cpu\"\nmethod = \"direct\"\n\
             [effects]\npicture_table = \"on\"\n"
        );
        let scene = scene::parse(&source).unwrap();
        let loaded =
            LoadedScene { scene, base_dir: "".into(), name: "test".to_owned(), painted: scene::Painted::default() };
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let shading = outcome.shading_brdf(&Cancel::default()).unwrap();
        let is_table = matches!(shading.brdf.direct_representation(), Representation::Table(_));
        let errors = shading.errors.unwrap();
        eprintln!("{geometry}, {preset}: table {is_table}, {errors:?}");
        assert!(is_table && errors.rel_l2 <= rel_l2 && errors.psnr_db >= psnr_db, "{geometry}: {is_table} {errors:?}");
    }
}

#[test]
fn the_predicted_number_of_facets_keeps_both_tolerances() {
    let (tolerance, all) = ((0.08, 38.0), 8192.0);
    // Squares of the errors of the grid, and variances of one facet: relative, and over the squared peak.
    for (grid, variance) in [
        ([1e-3, 5e-5], [0.5, 0.02]),
        ([2e-3, 1e-4], [4.0, 0.01]),
        ([0.0, 0.0], [3.0, 0.1]),
        ([3e-4, 1e-5], [1e-3, 1e-4]),
    ] {
        let errors = |facets: f64| {
            let [relative, absolute] = [0, 1].map(|k| grid[k] + variance[k] * (1.0 / facets - 1.0 / all));
            Errors { rel_l2: relative.sqrt(), psnr_db: -10.0 * absolute.log10() }
        };
        let enough = enough_facets(errors(all), errors(FEW_FACETS as f64), tolerance, all as usize);
        let found = errors(enough as f64);
        assert!(found.rel_l2 <= tolerance.0 && found.psnr_db >= tolerance.1, "{enough}: {found:?}");
        let fewer = errors(enough as f64 / 1.2);
        let is_least = enough == FEW_FACETS || fewer.rel_l2 > tolerance.0 || fewer.psnr_db < tolerance.1;
        assert!(is_least, "{enough}: {fewer:?}");
    }
    let exact = Errors { rel_l2: tolerance.0, psnr_db: tolerance.1 };
    let few = Errors { rel_l2: 0.1, psnr_db: 36.0 };
    assert!(enough_facets(exact, few, tolerance, 8192) >= 8192, "only all facets are enough");
}
