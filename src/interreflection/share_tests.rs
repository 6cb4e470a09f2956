use super::*;
use crate::effective::EffectiveBrdf;
use crate::interreflection::tests::open;
use crate::math::directions::PolarGrid;
use crate::pipeline::Pipeline;

const GROOVES: &str =
    r#"{ kind = "grooves", profile = "trapezoid", count = 2, depth = 0.3, side_angle_deg = 70, rotation_deg = 0 }"#;
const PYRAMIDS: &str = r#"{ kind = "pyramids", height = 0.5 }"#;
const RODS: &str = r#"{ kind = "rods", count = 5, radius = 0.06, length = 0.2 }"#;
const WHITE: &str = r#"{ kind = "lambertian", albedo = 0.9 }"#;
const METAL: &str = r#"{ kind = "ggx", roughness = 0.4, f0 = [0.9, 0.7, 0.4] }"#;

/// The part of uniform light that a tile reflects, in the mean of the channels.
fn albedo(brdf: &EffectiveBrdf) -> f64 {
    let grid = PolarGrid::new(8, 16);
    let nodes = 0..grid.len();
    let reflected = |o: usize| {
        let to = grid.direction(o);
        let lights = nodes.clone().map(|i| brdf.eval(grid.direction(i), to).element_sum() / 3.0 * grid.solid_angle(i));
        f64::from(lights.sum::<f32>() * to.z * grid.solid_angle(o)) / std::f64::consts::PI
    };
    nodes.clone().map(reflected).sum()
}

#[test]
fn the_measured_share_is_that_of_the_whole_result_within_its_error() {
    for geometry in [GROOVES, PYRAMIDS, RODS] {
        for brdf in [WHITE, METAL] {
            let at = |switch: &str| {
                let scene = open(geometry, brdf, &format!("interreflection = \"{switch}\"\nbounces = 64"));
                Pipeline::new().effective(&scene).unwrap()
            };
            let (off, on) = (at("off"), at("on"));
            let full = 1.0 - albedo(&off.brdf) / albedo(&on.brdf);
            let effect = off.plan.effects.iter().find(|effect| effect.name == "interreflection").unwrap();
            let told = effect.left_out.unwrap();
            eprintln!("{geometry} {brdf}: {:.4} ± {:.4}, {full:.4} of the result", told.share, told.std_error);
            assert!(full > 0.05, "a case without interreflection tests nothing");
            // The table of the result has an error of its own.
            let allowed = 3.0 * told.std_error + 0.05 * full;
            assert!((told.share - full).abs() < allowed, "{geometry} {brdf}: {told:?} instead of {full}");
            assert!(told.std_error < 0.25 * full, "{geometry} {brdf}: {told:?}");
        }
    }
}

#[test]
fn the_plans_own_choice_gives_the_bits_of_the_forced_one() {
    let deep = |effects: &str| Pipeline::new().effective(&open(GROOVES, WHITE, effects)).unwrap();
    let (auto, on) = (deep(""), deep("interreflection = \"on\""));
    assert!(auto.plan.interreflection.is_some());
    let black = r#"{ kind = "lambertian", albedo = 0.02 }"#;
    let dark = |effects: &str| Pipeline::new().effective(&open(GROOVES, black, effects)).unwrap();
    let (dark_auto, off) = (dark(""), dark("interreflection = \"off\""));
    assert!(dark_auto.plan.interreflection.is_none());
    for (a, b) in [(auto, on), (dark_auto, off)] {
        for pair in crate::metrics::mirror_biased_pairs(64, 3) {
            assert_eq!(a.brdf.eval(pair.i, pair.o), b.brdf.eval(pair.i, pair.o));
        }
    }
}

#[test]
fn a_tile_whose_facets_see_nothing_of_each_other_runs_no_stage_of_interreflection() {
    let shallow =
        r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.01, side_angle_deg = 5, rotation_deg = 0 }"#;
    for geometry in [r#"{ kind = "flat" }"#, shallow] {
        let pipeline = Pipeline::new();
        let outcome = pipeline.effective(&open(geometry, WHITE, "")).unwrap();
        assert!(outcome.plan.interreflection.is_none());
        let stages =
            ["lobe_samplers", "bounced_share", "cells", "hierarchy", "mirrors", "transport", "interreflection"];
        let ran: Vec<_> =
            pipeline.runs().into_iter().filter(|(name, runs)| stages.contains(name) && *runs > 0).collect();
        assert!(ran.is_empty(), "{geometry}: {ran:?}");
    }
}

#[test]
fn the_share_of_no_light_is_zero_and_a_share_of_few_walks_has_an_error() {
    assert_eq!(BouncedShare::of(&[[0.0; 2]; 4]), BouncedShare { share: 0.0, std_error: 0.0 });
    let share = BouncedShare::of(&[[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    assert!((share.share - 1.0 / 3.0).abs() < 1e-12 && share.std_error > 0.0, "{share:?}");
}
