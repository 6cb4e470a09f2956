use glam::Vec3;

use super::*;
use crate::metrics::mirror_biased_pairs;
use crate::pipeline::Outcome;

/// Pyramids so high that their horizons jump between azimuths.
const DIFFICULT: &str = "fig5d_pentagonal";
const HIGH: &str = "tile.geometry.height=2";

fn open(scene: &str, preset: &str, settings: &[&str]) -> LoadedScene {
    let mut all = vec![format!("quality.preset={preset}"), "quality.backend=cpu".to_owned()];
    all.extend(settings.iter().map(|&setting| setting.to_owned()));
    crate::scene::open(scene, &all).unwrap()
}

fn effective(loaded: &LoadedScene) -> Outcome {
    Pipeline::new().effective(loaded).unwrap()
}

fn values(outcome: &Outcome) -> Vec<Vec3> {
    mirror_biased_pairs(20, 3).iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect()
}

fn refines(outcome: &Outcome) -> bool {
    outcome.notes.iter().any(|note| note.starts_with("refined to "))
}

#[test]
fn a_result_within_its_bound_has_the_same_bits_without_refinement() {
    for scene in ["table4_plate", "fig4b_bicolor_cup", "fig6d_velvet_left", "fig9b_cylinder_stripes"] {
        let (with, without) =
            (effective(&open(scene, "draft", &[])), effective(&open(scene, "draft", &["quality.adaptive=false"])));
        assert_eq!(values(&with), values(&without), "{scene}");
        assert!(!refines(&with) && with.times.iter().any(|(name, _)| *name == "error_estimate"), "{scene}");
        assert!(without.times.iter().all(|(name, _)| *name != "error_estimate"), "{scene}");
    }
}

#[test]
fn a_difficult_tile_is_refined_until_it_states_an_error_within_the_bound() {
    let plain = effective(&open(DIFFICULT, "standard", &["quality.adaptive=false"]));
    let bound = plain.settings.error_bound().unwrap();
    let loaded = open(DIFFICULT, "standard", &[HIGH]);
    let outcome = effective(&loaded);
    assert!(refines(&outcome), "{:?}", outcome.errors().unwrap().estimate());
    assert!(
        outcome.settings.facets > plain.settings.facets
            && outcome.settings.horizon_azimuths > plain.settings.horizon_azimuths
    );
    let estimate = outcome.errors().unwrap().estimate();
    let warns = outcome.health().warnings.iter().any(|warning| warning.contains("the stated error is"));
    assert_eq!(warns, estimate.exceeds(bound), "{estimate:?}");
}

#[test]
fn a_stage_that_refinement_repeats_is_listed_once_with_the_time_of_all_its_runs() {
    let start = std::time::Instant::now();
    let outcome = effective(&open(DIFFICULT, "draft", &[HIGH]));
    let elapsed = crate::pipeline::stage::elapsed_ms(start);
    assert!(refines(&outcome), "{:?}", outcome.notes);
    let of =
        |stage: &str| outcome.times.iter().filter(|(name, _)| *name == stage).map(|(_, ms)| *ms).collect::<Vec<_>>();
    assert!(outcome.times.iter().all(|(name, _)| of(name).len() == 1), "{:?}", outcome.times);
    let sum: f64 = outcome.times.iter().map(|(_, ms)| ms).sum();
    assert!(sum > 0.0 && sum < elapsed, "{sum} {elapsed}");
    let long = start - std::time::Duration::from_secs(1);
    let mut times = vec![("facets", 500.0)];
    crate::pipeline::stage::add_time(&mut times, "facets", long);
    assert!(times.len() == 1 && times[0].1 >= 1500.0, "{times:?}");
}

#[test]
fn limits_end_refinement_and_a_warning_states_the_error() {
    let mirror = "material.default.brdf={kind=\"cook_torrance\",roughness=0.02,f0=[1,1,1]}";
    let loaded = open("fig8d_leather", "standard", &["quality.max_facets=16", mirror]);
    let outcome = effective(&loaded);
    let estimate = outcome.errors().unwrap().estimate();
    assert!(estimate.exceeds(outcome.settings.error_bound().unwrap()), "{estimate:?}");
    let warning = outcome.health().warnings.iter().find(|warning| warning.contains("the stated error is")).unwrap();
    assert!(warning.contains("`standard` allows 10 %"), "{warning}");
}

#[test]
fn a_refined_result_does_not_depend_on_earlier_edits() {
    let pipeline = Pipeline::new();
    let refined = open(DIFFICULT, "standard", &["tile.geometry.height=1"]);
    let plain = open(DIFFICULT, "standard", &["tile.geometry.height=0.02"]);
    let first = pipeline.effective(&refined).unwrap();
    assert!(refines(&first) && first.notes.iter().any(|note| note.starts_with("interreflection refined to ")));
    let first = values(&first);
    assert!(!refines(&pipeline.effective(&plain).unwrap()));
    assert_eq!(values(&pipeline.effective(&refined).unwrap()), first);
    assert_eq!(values(&effective(&refined)), first);
}

#[test]
fn a_scene_that_sets_the_resolution_is_not_refined() {
    for setting in ["quality.facets=64", "quality.azimuths=4", "quality.penumbra_deg=2.0"] {
        let outcome = effective(&open(DIFFICULT, "draft", &[setting, HIGH]));
        assert!(!refines(&outcome) && outcome.times.iter().all(|(name, _)| *name != "error_estimate"), "{setting}");
    }
}

#[test]
fn light_between_facets_is_refined_until_its_error_is_within_the_bound() {
    const MIRRORS: [&str; 3] = [
        "tile.geometry={ kind = \"pyramids\", height = 0.5 }",
        "material.default.brdf={ kind = \"ggx\", roughness = 0.06, f0 = 1 }",
        "effects.interreflection=on",
    ];
    let refined = effective(&open("default", "draft", &MIRRORS));
    let plain = effective(&open("default", "draft", &[&MIRRORS[..], &["quality.adaptive=false"]].concat()));
    let bound = refined.settings.error_bound().unwrap();
    let stated = |outcome: &Outcome| outcome.errors().unwrap().estimate();
    assert!(stated(&plain).exceeds(bound), "{:?}", stated(&plain));
    assert!(!stated(&refined).exceeds(bound), "{:?}", stated(&refined));
    let note = "interreflection refined to ";
    assert!(refined.notes.iter().any(|text| text.starts_with(note)), "{:?}", refined.notes);
    assert!(plain.notes.is_empty(), "{:?}", plain.notes);
    let reason = |outcome: &Outcome| {
        let effect = outcome.plan.effects.iter().find(|effect| effect.name == "interreflection");
        effect.unwrap().reason.clone()
    };
    assert!(reason(&refined).contains("; refined to ") && !reason(&plain).contains("refined"), "{}", reason(&refined));
}

#[test]
fn glossy_light_between_facets_has_at_most_four_percent_of_error_at_standard() {
    // Most of the light that these grooves reflect has bounced.
    const GROOVES: [&str; 3] = [
        "tile.geometry={ kind = \"grooves\", profile = \"v\", count = 2, depth = 0.25, side_angle_deg = 45 }",
        "material.default.brdf={ kind = \"ggx\", roughness = 0.1, f0 = 1 }",
        "effects.interreflection=on",
    ];
    let part = |settings: &[&str]| {
        let outcome = effective(&open("default", "standard", &[&GROOVES[..], settings].concat()));
        outcome.errors().unwrap().estimate().interreflection
    };
    let (refined, plain) = (part(&[]), part(&["quality.adaptive=false"]));
    assert!(refined <= 0.04 && plain > 0.04, "{refined} {plain}");
}
