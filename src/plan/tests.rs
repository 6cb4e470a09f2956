use std::path::PathBuf;

use glam::Vec3;

use super::{Costs, EffectKind, LargeScaleFeatures, Plan, Preset, SceneFeatures, Settings, VisibilityAlgorithm};
use crate::interreflection::BouncedShare;
use crate::metrics::{compare, mirror_biased_pairs};
use crate::pipeline::{Outcome, Pipeline};
use crate::scene::{self, LoadedScene, Painted, Switch};

const GEOMETRIES: [&str; 8] = [
    r#"{ kind = "flat" }"#,
    r#"{ kind = "flat", pattern = "stripes" }"#,
    r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.01, side_angle_deg = 5, rotation_deg = 0 }"#,
    r#"{ kind = "heightfield", values = [[0.0, 0.01, 0.0, 0.005], [0.01, 0.02, 0.005, 0.0], [0.0, 0.01, 0.015, 0.0], [0.0, 0.0, 0.01, 0.0]] }"#,
    r#"{ kind = "heightfield", values = [[0.0, 0.2, 0.0, 0.1], [0.2, 0.4, 0.1, 0.0], [0.0, 0.2, 0.3, 0.0], [0.0, 0.0, 0.2, 0.0]] }"#,
    r#"{ kind = "pyramids", height = 0.3 }"#,
    r#"{ kind = "grooves", profile = "trapezoid", count = 4, depth = 0.2 }"#,
    r#"{ kind = "rods", count = 6, radius = 0.06, length = 0.2 }"#,
];

const BRDFS: [&str; 5] = [
    r#"{ kind = "lambertian", albedo = [0.7, 0.5, 0.3] }"#,
    r#"{ kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }"#,
    r#"{ kind = "ward", roughness = 0.3, specular = 0.5 }"#,
    r#"{ kind = "blinn_phong", exponent = 40, specular = 0.5 }"#,
    r#"[{ kind = "lambertian", albedo = 0.0 }, { kind = "ggx", roughness = 0.4, f0 = [0.9, 0.5, 0.2] }]"#,
];

fn open(geometry: &str, brdf: &str, effects: &str) -> LoadedScene {
    let source = format!(
        "[tile]\ngeometry = {geometry}\n[[material]]\nname = \"default\"\nbrdf = {brdf}\n[quality]\npreset = \"draft\"\nfacets = 1024\nmethod = \"direct\"\nbackend = \"cpu\"\n[effects]\n{effects}\n"
    );
    LoadedScene {
        scene: scene::parse(&source).unwrap(),
        base_dir: PathBuf::new(),
        name: "test".to_owned(),
        painted: Painted::default(),
    }
}

fn values(outcome: &Outcome) -> Vec<Vec3> {
    mirror_biased_pairs(64, 11).iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect()
}

#[test]
fn forcing_a_dropped_effect_on_changes_forty_scenes_by_less_than_the_bound() {
    let (mut forced, mut dropped_visibility) = (0, 0);
    for geometry in GEOMETRIES {
        for brdf in BRDFS {
            let outcome = Pipeline::new().effective(&open(geometry, brdf, "")).unwrap();
            let plain = values(&outcome);
            for effect in &outcome.plan.effects {
                let Some(bound) = effect.bound else { continue };
                assert!(!effect.on && !effect.forced, "{effect:?}");
                let on =
                    Pipeline::new().effective(&open(geometry, brdf, &format!("{} = \"on\"", effect.name))).unwrap();
                let now = on.plan.effects.iter().find(|other| other.name == effect.name).unwrap();
                assert!(now.forced, "{now:?}");
                let errors = compare(&values(&on), &plain);
                assert!(errors.rel_l2 <= bound, "{geometry} {brdf} {}: {errors:?} of {bound}", effect.name);
                forced += 1;
                dropped_visibility += usize::from(effect.name == "visibility");
            }
        }
    }
    eprintln!("{forced} effects forced, {dropped_visibility} of them visibility");
    assert!(forced >= 40 && dropped_visibility >= 15);
}

#[test]
fn a_dropped_visibility_runs_no_stage_and_takes_no_memory() {
    let visibility = |geometry: &str, effects: &str| {
        let pipeline = Pipeline::new();
        let outcome = pipeline.effective(&open(geometry, BRDFS[0], effects)).unwrap();
        let runs = pipeline.runs().iter().find(|(name, _)| *name == "visibility").unwrap().1;
        let crate::effective::Representation::Direct(direct) = &outcome.brdf.representation else {
            panic!("summed directly")
        };
        assert!(outcome.times.iter().any(|(name, _)| *name == "visibility") == (runs > 0));
        (runs, direct.visibility.bytes() > 0)
    };
    for geometry in &GEOMETRIES[..3] {
        assert_eq!(visibility(geometry, ""), (0, false), "{geometry}");
        assert_eq!(visibility(geometry, "visibility = \"on\"").0, 1, "{geometry}");
    }
    assert_eq!(visibility(GEOMETRIES[5], ""), (1, true));
    assert_eq!(visibility(GEOMETRIES[5], "visibility = \"off\""), (0, false));
}

#[test]
fn forcing_effects_off_acts() {
    let value = |geometry: &str, brdf: &str, effects: &str| {
        values(&Pipeline::new().effective(&open(geometry, brdf, effects)).unwrap())
    };
    let deep = GEOMETRIES[6];
    let hidden = compare(&value(deep, BRDFS[0], "visibility = \"off\""), &value(deep, BRDFS[0], ""));
    assert!(hidden.rel_l2 > 0.05, "{hidden:?}");
    // The same sums, taken otherwise.
    let lobes = compare(&value(deep, BRDFS[1], "exact_lobes = \"off\""), &value(deep, BRDFS[1], ""));
    assert!(lobes.rel_l2 < 1e-4, "{lobes:?}");
    let two = "[[material]]\nname = \"default\"\nbrdf = { kind = \"lambertian\", albedo = 0.8 }\n[[material]]\nname = \"bottom\"\ncolor = [1.0, 0.0, 0.0]\n";
    let source = format!("[tile]\ngeometry = {deep}\n{two}");
    let loaded = |effects: &str| LoadedScene {
        scene: scene::parse(&format!("{source}[effects]\n{effects}\n")).unwrap(),
        base_dir: PathBuf::new(),
        name: "test".to_owned(),
        painted: Painted::default(),
    };
    let (i, o) = (Vec3::Z, Vec3::Z);
    let both = Pipeline::new().effective(&loaded("")).unwrap().brdf.eval(i, o);
    let one = Pipeline::new().effective(&loaded("material_groups = \"off\"")).unwrap().brdf.eval(i, o);
    assert!(both.x > 1.2 * both.y && (one.x - one.y).abs() < 1e-6 || one.y == 0.0, "{both} {one}");
}

fn features() -> SceneFeatures {
    SceneFeatures {
        flat: false,
        steepest: 0.05,
        albedo: 0.8,
        bounced: None,
        grey: true,
        mirrors: None,
        height_samples: false,
        height_field: true,
        extruded: false,
        closes_plane: true,
        maps_on_gpu: false,
        triangles: 64,
        scan_work: 10.0,
        area_ratio: 1.2,
        materials: 1,
        black_materials: 0,
        colors_vary: false,
        lobes: 1000,
        lookups: 0,
        narrowest_lobe: 0.3,
        distinct_normals: None,
        large_scale: LargeScaleFeatures { object_self_shadows: true, lights: 4, lights_below: 0 },
        color_map: None,
    }
}

#[test]
fn the_plan_is_monotone_in_the_tolerance() {
    for degrees in [0.5_f32, 2.0, 4.0, 8.0, 15.0, 40.0] {
        let features = SceneFeatures { steepest: degrees.to_radians(), ..features() };
        let mut last: Option<Vec<&str>> = None;
        for tolerance in [1e-4, 1e-3, 0.01, 0.04, 0.12, 0.5] {
            let settings = Settings { tolerance, ..Settings::of_preset(Preset::Standard) };
            let plan = Plan::new(&features, &settings, &Costs::default());
            let on: Vec<&str> = plan.effects.iter().filter(|effect| effect.on).map(|effect| effect.name).collect();
            if let Some(last) = &last {
                assert!(on.iter().all(|name| last.contains(name)), "{degrees}°, {tolerance}: {on:?} after {last:?}");
            }
            last = Some(on);
        }
    }
}

#[test]
fn a_loose_tolerance_drops_the_visibility_of_a_shallow_tile_and_says_why() {
    let plan = |tolerance| {
        let settings = Settings { tolerance, ..Settings::of_preset(Preset::Standard) };
        Plan::new(&features(), &settings, &Costs::default())
    };
    assert_eq!(plan(0.04).algorithm, VisibilityAlgorithm::None);
    let effect = plan(0.04).effects[0].clone();
    assert!(!effect.on && effect.reason.contains("shallow") && effect.bound.is_some(), "{effect:?}");
    assert_eq!(plan(0.001).algorithm, VisibilityAlgorithm::HorizonScan);
}

/// A deep tile whose facets send each other a part of the light, at a preset with a switch.
fn bouncing(share: f64, preset: Preset, interreflection: Switch) -> (SceneFeatures, Settings) {
    let bounced = Some(BouncedShare { share, std_error: 0.01 });
    let effects = scene::Effects { interreflection, ..scene::Effects::default() };
    (SceneFeatures { area_ratio: 3.0, bounced, ..features() }, Settings { effects, ..Settings::of_preset(preset) })
}

#[test]
fn interreflection_is_on_where_it_adds_more_than_the_preset_tolerates() {
    let is_on = |share, preset, switch| {
        let (features, settings) = bouncing(share, preset, switch);
        let plan = Plan::new(&features, &settings, &Costs::default());
        assert_eq!(plan.interreflection.is_some(), plan.is_on("interreflection"));
        plan.interreflection.is_some()
    };
    let tolerances = [(Preset::Draft, 0.35), (Preset::Standard, 0.04), (Preset::Fine, 0.015)];
    for (preset, tolerance) in tolerances {
        assert!(is_on(1.01 * tolerance, preset, Switch::Auto), "{preset:?}");
        assert!(!is_on(0.99 * tolerance, preset, Switch::Auto), "{preset:?}");
        assert!(is_on(0.0, preset, Switch::On) && !is_on(0.9, preset, Switch::Off), "{preset:?}");
    }
    assert!(is_on(0.0, Preset::Reference, Switch::Auto), "the reference follows all light");
    for switch in [Switch::Auto, Switch::On] {
        assert!(!is_on(0.9, Preset::Wu2011, switch), "the paper leaves interreflection out");
    }
}

#[test]
fn a_result_that_is_used_again_describes_the_object_and_the_lights_of_the_present_scene() {
    let pipeline = Pipeline::new();
    let mut loaded = scene::open("default", &["quality.preset=draft".to_owned()]).unwrap();
    let reasons = |outcome: &Outcome| -> Vec<String> {
        outcome.plan.effects.iter().map(|effect| format!("{} {} {}", effect.name, effect.on, effect.reason)).collect()
    };
    let before = reasons(&pipeline.effective(&loaded).unwrap());
    "sphere".clone_into(&mut loaded.scene.object.kind);
    loaded.scene.light.count = 3;
    let runs = pipeline.runs();
    let after = reasons(&pipeline.effective(&loaded).unwrap());
    assert_eq!(pipeline.runs(), runs, "nothing is computed again");
    assert_ne!(before, after);
    assert_eq!(after, reasons(&Pipeline::new().effective(&loaded).unwrap()));
}

#[test]
fn the_plan_of_the_papers_method_describes_what_runs() {
    let source = r#"
        tile.geometry = { kind = "grooves" }
        material = [{ name = "default", brdf = { kind = "lambertian" } }, { name = "botom", color = 0.5 }]
        quality.preset = "wu2011"
    "#;
    let scene = scene::parse(source).unwrap();
    let loaded = LoadedScene { scene, base_dir: PathBuf::new(), name: "test".to_owned(), painted: Painted::default() };
    let outcome = Pipeline::new().effective(&loaded).unwrap();
    let effect = |name: &str| outcome.plan.effects.iter().find(|effect| effect.name == name).unwrap();
    for name in ["exact_lobes", "picture_table", "mirror_symmetry", "interreflection"] {
        assert!(!effect(name).on, "{name}");
    }
    assert!(effect("visibility").reason.contains("132 shadow maps") && effect("visibility").measured_ms.is_some());
    assert!(effect("low_rank").on && effect("overhangs").on);
    assert!(outcome.notes.iter().any(|note| note.contains("botom")), "{:?}", outcome.notes);
}

#[test]
fn light_is_left_out_only_if_asked_and_then_the_plan_tells_how_much() {
    let effect = |switch| {
        let (features, settings) = bouncing(0.2, Preset::Standard, switch);
        let plan = Plan::new(&features, &settings, &Costs::default());
        plan.effects.into_iter().find(|effect| effect.name == "interreflection").unwrap()
    };
    let off = effect(Switch::Off);
    let left_out = off.left_out.unwrap();
    assert_eq!((left_out.share, left_out.std_error, left_out.tolerance), (0.2, 0.01, 0.04));
    assert!(left_out.predicted_ms > 0.0 && off.reason.contains("20.0 ± 1.0 %"), "{off:?}");
    assert!(effect(Switch::Auto).left_out.is_none());
}

#[test]
fn a_small_share_is_computed_with_fewer_rays_and_a_coarser_table_unless_a_lobe_is_narrow() {
    let standard = Settings::of_preset(Preset::Standard);
    let resolution = |share: f64, narrowest_lobe, lookups| {
        let bounced = Some(BouncedShare { share, std_error: 0.0 });
        let settings = standard.interreflection(&SceneFeatures { bounced, narrowest_lobe, lookups, ..features() });
        (settings.useful_rays, settings.grid.rings)
    };
    for (narrowest_lobe, lookups) in [(0.1, 0), (0.3, 0), (f32::INFINITY, 100)] {
        assert_eq!(resolution(0.36, narrowest_lobe, lookups), (7200, 12));
    }
    assert_eq!([0.1, 0.3].map(|lobe| resolution(0.2, lobe, 0)), [(1800, 12), (1800, 10)]);
    let matte = [0.19, 0.2, 0.36].map(|share| resolution(share, f32::INFINITY, 0));
    assert_eq!(matte, [(3600, 8), (3600, 10), (14_400, 12)]);
    assert_eq!(resolution(0.2, f32::INFINITY, 100), (1800, 12), "a measured lobe may be narrow");
    let unknown = standard.interreflection(&features());
    assert_eq!((unknown.useful_rays, unknown.grid.rings), (7200, 12));
}

#[test]
fn the_share_is_measured_only_where_it_decides_or_tells() {
    let needs = |area_ratio, preset, switch| {
        let (features, settings) = bouncing(0.0, preset, switch);
        SceneFeatures { area_ratio, ..features }.needs_bounced_share(&settings)
    };
    assert!(needs(3.0, Preset::Standard, Switch::Auto) && needs(3.0, Preset::Standard, Switch::Off));
    assert!(needs(3.0, Preset::Standard, Switch::On) && !needs(3.0, Preset::Draft, Switch::Off));
    assert!(!needs(3.0, Preset::Reference, Switch::Auto) && !needs(3.0, Preset::Wu2011, Switch::Auto));
    // Facets of a shallow tile hardly see each other.
    assert!(!needs(1.01, Preset::Standard, Switch::Auto) && needs(1.01, Preset::Fine, Switch::Auto));
}

#[test]
fn the_choice_between_direct_sum_and_factors_does_not_depend_on_the_number_of_cores() {
    let settings = Settings::of_preset(Preset::Draft);
    for lookups in [100, 400, 1000, 4000, 20_000] {
        let measured = SceneFeatures { lookups, ..features() };
        let choice =
            |threads: f64| Plan::new(&measured, &settings, &Costs { threads, ..Costs::default() }).try_low_rank;
        assert!([1.0, 2.0, 13.0, 59.0, 256.0].into_iter().all(|threads| choice(threads) == choice(4.0)), "{lookups}");
    }
}

#[test]
fn every_switch_of_the_scene_forces_one_row_of_the_table_and_physics_stands_first() {
    let plan = Plan::new(&features(), &Settings::of_preset(Preset::Standard), &Costs::default());
    assert!(plan.effects.is_sorted_by_key(|effect| effect.kind));
    assert_eq!(plan.effects[0].kind, EffectKind::Physics);
    let mut fields: Vec<&str> = scene::Effects::fields().iter().map(|field| field.key).collect();
    fields.retain(|key| *key != "bounces");
    fields.sort_unstable();
    let mut names: Vec<&str> = super::effect_names().collect();
    names.sort_unstable();
    assert_eq!(names, fields);
    for name in names {
        let mut effects = scene::Effects::default();
        *super::switch_mut(&mut effects, name).unwrap() = scene::Switch::Off;
        let settings = Settings { effects, ..Settings::of_preset(Preset::Standard) };
        let plan = Plan::new(&features(), &settings, &Costs::default());
        let forced: Vec<&str> = plan.effects.iter().filter(|effect| effect.forced).map(|effect| effect.name).collect();
        assert_eq!(forced, [name]);
    }
}
