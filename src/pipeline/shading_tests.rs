use glam::Vec3;

use crate::base::Cancel;
use crate::effective::{Reflectance, Representation};
use crate::metrics::image_pairs;
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
fn drafts_of_a_weave_and_of_rods_read_tables_within_their_tolerance() {
    for geometry in ["{ kind = \"weave\" }", "{ kind = \"rods\" }"] {
        let source = format!(
            "[tile]\ngeometry = {geometry}\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\nmethod = \"direct\"\n\
             [effects]\npicture_table = \"on\"\n"
        );
        let scene = scene::parse(&source).unwrap();
        let loaded =
            LoadedScene { scene, base_dir: "".into(), name: "test".to_owned(), painted: scene::Painted::default() };
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let shading = outcome.shading_brdf(&Cancel::default()).unwrap();
        let is_table = matches!(shading.brdf.direct_representation(), Representation::Table(_));
        let errors = shading.errors.unwrap();
        eprintln!("{geometry}: table {is_table}, {errors:?}");
        assert!(is_table && errors.rel_l2 <= 0.35 && errors.psnr_db >= 26.0, "{geometry}: {is_table} {errors:?}");
    }
}
