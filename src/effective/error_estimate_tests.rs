//! Stated errors against errors that finer results show.

use super::*;
use crate::metrics::compare;
use crate::pipeline::{Outcome, Pipeline};

fn outcome(scene: &str, settings: &[&str]) -> Outcome {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    Pipeline::new().effective(&crate::scene::open(scene, &settings).unwrap()).unwrap()
}

#[test]
fn the_stated_error_of_a_draft_is_near_its_difference_from_a_fine_result() {
    // Few pairs hold most of the error of pyramids, so that 200 pairs show it badly. Of 2000 pairs on grooves, one along them,
    // at 83°, may hold most of the error, which no estimate finds.
    for (scene, azimuths, count) in
        [("fig1d_yellow_sides", 24, 200), ("fig5d_pentagonal", 24, 2000), ("fig5d_pentagonal", 16, 2000)]
    {
        let pairs = mirror_biased_pairs(count, 5);
        let values = |outcome: &Outcome| -> Vec<Vec3> {
            pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect()
        };
        // The estimate is that of direct reflection.
        let off = "effects.interreflection=off";
        let draft = outcome(scene, &["quality.preset=draft", &format!("quality.azimuths={azimuths}"), off]);
        let error = compare(&values(&draft), &values(&outcome(scene, &["quality.preset=fine", off]))).rel_l2;
        let stated = draft.errors().unwrap().estimate().rel_l2;
        assert!((error / 3.0..error * 3.0).contains(&stated), "{scene}, {azimuths} azimuths: {error} {stated}");
        let errors = draft.errors().unwrap().standard_errors(&pairs, &Cancel::default()).unwrap();
        let of_pairs = compare(&errors, &vec![Vec3::ZERO; pairs.len()]);
        assert!(errors.iter().all(|error| error.is_finite() && error.min_element() >= 0.0), "{of_pairs:?}");
    }
}

#[test]
fn fewer_facets_and_fewer_azimuths_state_larger_errors_of_their_kind() {
    let stated =
        |setting: &str| outcome("fig5d_pentagonal", &["quality.preset=draft", setting]).errors().unwrap().estimate();
    let (few, many) = (stated("quality.facets=256"), stated("quality.facets=16384"));
    assert!(few.facets > 4.0 * many.facets, "{few:?} {many:?}");
    let (few, many) = (stated("quality.azimuths=8"), stated("quality.azimuths=96"));
    assert!(few.visibility > 4.0 * many.visibility, "{few:?} {many:?}");
}

#[test]
fn errors_that_few_grazing_pairs_hold_are_found() {
    // Gaps between rows of pyramids are open only in narrow ranges of the azimuth.
    let pyramids = r#"{ kind = "pyramids", height = 0.36684, base_size = 0.47016, truncation = 0.18758, face_ratio = 0.34018, spacing = 0.40953, sides = 5, arrangement = "square", rotation_deg = 9.56597 }"#;
    let with = |azimuths: usize| {
        let settings = [
            format!("tile.geometry={pyramids}"),
            "material.default.brdf={kind=\"blinn_phong\", exponent=12, specular=0.3}".to_owned(),
            "effects.interreflection=off".to_owned(),
            "quality.adaptive=false".to_owned(),
            format!("quality.azimuths={azimuths}"),
        ];
        outcome("fig5d_pentagonal", &settings.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let (coarse, fine) = (with(48), with(384));
    let pairs = mirror_biased_pairs(2000, 77);
    let values = |outcome: &Outcome| outcome.brdf.eval_pairs(&pairs, &Cancel::default()).unwrap();
    let error = compare(&values(&coarse), &values(&fine)).rel_l2;
    let stated = coarse.errors().unwrap().estimate().rel_l2;
    println!("true {error:.4}, stated {stated:.4}");
    assert!(error > 0.03 && (0.6..2.0).contains(&(stated / error)), "{error} {stated}");
}

#[test]
fn a_level_tile_states_no_error() {
    let estimate = outcome("fig9b_cylinder_stripes", &[]).errors().unwrap().estimate();
    assert_eq!((estimate.rel_l2, estimate.psnr_db), (0.0, None));
}
