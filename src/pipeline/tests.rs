//! Cached results are what would be computed, and every input of a stage changes its key.

use std::collections::HashSet;
use std::sync::Arc;

use glam::Vec3;

use super::low_rank::FactorInputs;
use super::stages::{BuildTile, ComputeVisibility, FacetsRole, LoadMaterials, SampleFacets, TileShape};
use super::{Env, Keyed, Outcome, Pipeline, Stage, StageTimes};
use crate::base::Cancel;
use crate::brdf::{Brdf, Material, Measured, MeasuredReport, Term};
use crate::cache::{Cache, Key, KeyBuilder, Stored, Writer};
use crate::effective::{Direct, FacetSum, Nodes, Representation};
use crate::geometry::Facets;
use crate::math::directions::{HemispherePairGrid, PolarGrid};
use crate::metrics::image_pairs;
use crate::plan::{Preset, Settings, VisibilityAlgorithm};
use crate::scene::{self, Geometry, LoadedScene, Switch};

fn run(scene: &str, set: &[&str], cache: &Cache) -> (Outcome, super::ShadingBrdf) {
    let set: Vec<String> =
        ["quality.backend=cpu", "quality.preset=draft"].iter().chain(set).map(|s| (*s).to_owned()).collect();
    let mut pipeline = Pipeline::new();
    pipeline.set_cache(cache.clone());
    let outcome = pipeline.effective(&scene::open(scene, &set).unwrap()).unwrap();
    let shading_brdf = outcome.shading_brdf(&Cancel::default()).unwrap();
    assert_eq!(cache.finish(), None);
    (outcome, shading_brdf)
}

fn stages(outcome: &Outcome) -> Vec<&'static str> {
    outcome.times.iter().map(|(name, _)| *name).collect()
}

/// All bits of visibility and table, and of some values of the BRDF.
fn bits((outcome, shading_brdf): &(Outcome, super::ShadingBrdf)) -> (Vec<u8>, Vec<u32>) {
    let Representation::Direct(direct) = outcome.brdf.direct_representation() else { panic!("a sum") };
    let mut out = Writer::default();
    direct.visibility.write(&mut out);
    if let Representation::Table(table) = shading_brdf.brdf.direct_representation() {
        table.content().write(&mut out);
    }
    let values = image_pairs(200, 3).into_iter().flat_map(|pair| {
        [&outcome.brdf, &shading_brdf.brdf].map(|brdf| brdf.eval(pair.i, pair.o).to_array().map(f32::to_bits))
    });
    (out.into_bytes(), values.flatten().collect())
}

#[test]
fn what_was_cached_is_the_same_bits_as_what_is_made() {
    let maps = "quality.visibility=\"maps\"";
    // Occlusion intervals, horizon maps by a walk and by slices, maps; few distinct normals; no table close enough.
    let cases: [(&str, &[&str]); 5] = [
        ("table4_skirt", &[]),
        ("table4_plate", &[]),
        ("table4_teapot", &[]),
        ("table4_skirt", &[maps, "quality.azimuths=16", "quality.rings=8"]),
        ("table4_skirt", &["material.default.brdf={ kind = \"ggx\", roughness = 0.02, f0 = 0.9 }"]),
    ];
    for (scene, set) in cases {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::of_everything(folder.path(), 1 << 28);
        let without = run(scene, set, &Cache::off());
        let empty = run(scene, set, &cache);
        let full = run(scene, set, &cache);
        assert!(stages(&empty.0).contains(&"visibility") && !empty.1.was_cached, "{scene} {set:?}");
        assert!(stages(&full.0).contains(&"cached_visibility"), "{scene} {set:?}: {:?}", stages(&full.0));
        let has_table = matches!(without.1.brdf.direct_representation(), Representation::Table(_));
        assert!(full.1.was_cached || !has_table, "{scene} {set:?}");
        assert!(bits(&without) == bits(&empty) && bits(&without) == bits(&full), "{scene} {set:?}");
        assert_eq!(without.1.errors.is_some(), full.1.errors.is_some());
    }
}

/// Rare bright texels decide where facets are, so visibility must not outlive an edit of such an image.
#[test]
fn an_edit_of_rare_bright_texels_gives_the_result_of_a_fresh_pipeline() {
    let painted = |white: usize| {
        let mut loaded = scene::open("fig5d_pentagonal", &["quality.preset=draft".to_owned()]).unwrap();
        let mut values = vec![Vec3::splat(0.01); 64 * 64];
        values[white] = Vec3::ONE;
        loaded.painted.colors = Some(Arc::new(scene::Pixels { size: glam::UVec2::splat(64), values }));
        loaded
    };
    let pipeline = Pipeline::new();
    let values = |pipeline: &Pipeline, white: usize| {
        let outcome = pipeline.effective(&painted(white)).unwrap();
        image_pairs(60, 3).into_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect::<Vec<_>>()
    };
    values(&pipeline, 500);
    assert_eq!(values(&pipeline, 2900), values(&Pipeline::new(), 2900));
}

#[test]
fn a_table_that_was_cached_serves_other_colours_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    run("table4_skirt", &[], &cache);
    let colored = ["material.default.color=[0.9, 0.2, 0.1]"];
    let read = run("table4_skirt", &colored, &cache);
    assert!(read.1.was_cached);
    assert!(bits(&read) == bits(&run("table4_skirt", &colored, &Cache::off())));
}

#[test]
fn another_material_surface_or_setting_is_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    run("table4_skirt", &[], &cache);
    let rough = run("table4_skirt", &["material.default.brdf={ kind = \"ggx\", roughness = 0.4, f0 = 0.9 }"], &cache);
    assert!(!rough.1.was_cached && stages(&rough.0).contains(&"cached_visibility"));
    for change in ["quality.facets=1000", "quality.azimuths=20", "quality.penumbra_deg=3", "quality.seed=2"] {
        let (outcome, shading_brdf) = run("table4_skirt", &[change], &cache);
        assert!(!shading_brdf.was_cached && !stages(&outcome).contains(&"cached_visibility"), "{change}");
    }
}

#[test]
fn a_cancelled_stage_is_not_cached() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    let loaded = scene::open("table4_skirt", &["quality.backend=cpu".to_owned()]).unwrap();
    let cancel = Cancel::default();
    let mut pipeline = Pipeline::new();
    pipeline.set_cache(cache.clone());
    pipeline.set_cancel(cancel.clone());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(15));
            cancel.set();
        });
        // The stage may be cancelled in the slices or after them.
        let _ = pipeline.effective(&loaded);
    });
    assert_eq!(cache.finish(), None);
    let again = run_standard(&loaded, &cache);
    assert!(again == run_standard(&loaded, &Cache::off()));
}

fn run_standard(loaded: &scene::LoadedScene, cache: &Cache) -> Vec<u8> {
    let mut pipeline = Pipeline::new();
    pipeline.set_cache(cache.clone());
    let outcome = pipeline.effective(loaded).unwrap();
    let Representation::Direct(direct) = outcome.brdf.direct_representation() else { panic!("a sum") };
    let mut out = Writer::default();
    direct.visibility.write(&mut out);
    out.into_bytes()
}

/// Asserts that all keys differ.
fn all_differ(keys: Vec<(&str, Key)>) {
    let mut known = HashSet::new();
    for (change, key) in keys {
        assert!(known.insert(key), "{change} does not change the key");
    }
}

fn key_of(stage: &impl Stage) -> Key {
    let mut key = KeyBuilder::for_tests();
    stage.hash_into(&mut key);
    key.finish()
}

fn keyed<T>(number: u32, value: T) -> Keyed<T> {
    Keyed { key: Key::of_numbers(&[number]), value: Arc::new(value) }
}

fn shape(scene: &str, number: u32) -> TileShape {
    let mesh = Pipeline::new().mesh(&scene::open(scene, &[]).unwrap()).unwrap();
    let surface = Key::of_numbers(&[number]);
    TileShape {
        mesh,
        below: None,
        surface,
        flat: false,
        height_field: true,
        across: None,
        steepest: 1.0,
        colors_place_facets: false,
    }
}

#[test]
fn each_input_of_the_tile_changes_its_key() {
    let env = Env::default();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colors.png");
    std::fs::write(&path, "one").unwrap();
    let mut loaded = scene::open("table4_plate", &[]).unwrap();
    loaded.scene.tile.color_path = Some(path.clone());
    let key = |loaded: &LoadedScene| key_of(&BuildTile::new(loaded, &env));
    let same = key(&loaded);
    assert_eq!(same, key(&loaded));
    let with = |change: &dyn Fn(&mut LoadedScene)| {
        let mut changed = loaded.clone();
        change(&mut changed);
        key(&changed)
    };
    let heights = |height: f32| Some(Arc::new(scene::Pixels { size: glam::UVec2::ONE, values: vec![height] }));
    let mut keys = vec![
        ("nothing", same),
        ("size", with(&|loaded| loaded.scene.tile.size.x *= 2.0)),
        ("geometry", with(&|loaded| loaded.scene.tile.geometry = Geometry::Flat(scene::Flat::default()))),
        ("no colours", with(&|loaded| loaded.scene.tile.color_path = None)),
        ("painted heights", with(&|loaded| loaded.painted.heights = heights(1.0))),
        ("other painted heights", with(&|loaded| loaded.painted.heights = heights(2.0))),
    ];
    std::fs::write(&path, "other").unwrap();
    keys.push(("content of a file", key(&loaded)));
    all_differ(keys);
}

#[test]
fn each_input_of_the_materials_but_the_large_scale_changes_their_key() {
    let env = Env::default();
    let loaded = scene::open("fig4b_bicolor_cup", &[]).unwrap();
    let slots = vec!["bottom".to_owned(), "sides".to_owned()];
    let with = |change: &dyn Fn(&mut LoadedScene), slots: &[String]| {
        let mut changed = loaded.clone();
        change(&mut changed);
        key_of(&LoadMaterials::new(&changed, slots, &env))
    };
    let same = with(&|_| {}, &slots);
    assert_eq!(same, with(&|loaded| loaded.scene.light.count = 3, &slots));
    all_differ(vec![
        ("nothing", same),
        ("colour", with(&|loaded| loaded.scene.materials[0].color.x = 0.123, &slots)),
        ("one material fewer", with(&|loaded| _ = loaded.scene.materials.pop(), &slots)),
        ("slots", with(&|_| {}, &slots[..1])),
    ]);
}

#[test]
fn each_input_of_the_facets_changes_their_key() {
    let settings = Settings::of_preset(Preset::Draft);
    let tiles = [1, 2].map(|number| keyed(number, shape("table4_plate", number)));
    let with = |tile: usize, change: &dyn Fn(&mut Settings)| {
        let mut changed = settings.clone();
        change(&mut changed);
        key_of(&SampleFacets { tile: &tiles[tile], settings: &changed, grid: None, role: FacetsRole::Main })
    };
    let same = with(0, &|_| {});
    assert_eq!(same, with(0, &|settings| settings.penumbra = 0.5));
    all_differ(vec![
        ("nothing", same),
        ("tile", with(1, &|_| {})),
        ("count", with(0, &|settings| settings.facets += 1)),
        ("bins", with(0, &|settings| settings.normal_bins = Some(64))),
        ("seed", with(0, &|settings| settings.seed += 1)),
        ("the paper's facets", with(0, &|settings| settings.preset = Preset::Wu2011)),
        ("mean colours", with(0, &|settings| settings.effects.color_weights = Switch::Off)),
    ]);
}

#[test]
fn facets_that_a_map_colours_afterwards_are_those_that_are_sampled_with_it() {
    let (pipeline, mut times) = (Pipeline::new(), StageTimes::new());
    for name in ["fig1c_slopes_color_map", "fig10_snake_color_map", "fig6_non_normal_color_map"] {
        let mut loaded = scene::open(name, &[]).unwrap();
        loaded.scene.quality.facets = Some(500);
        for bins in [None, Some(64)] {
            let settings = Settings { normal_bins: bins, ..Settings::of(&loaded.scene) };
            let tile = pipeline.tile(&loaded, &mut times).unwrap();
            let facets = pipeline.facets(&tile, &settings, FacetsRole::Main, &mut times).unwrap();
            let at_once = SampleFacets { tile: &tile, settings: &settings, grid: None, role: FacetsRole::Main };
            assert_eq!(*facets.value, at_once.run(&Env::default()).unwrap(), "{name} {bins:?}");
        }
    }
}

#[test]
fn each_input_of_visibility_changes_its_key() {
    let settings = Settings::of_preset(Preset::Draft);
    let tiles = [1, 2].map(|number| keyed(number, shape("table4_plate", number)));
    let facets = keyed(3, Facets::default());
    let with = |tile: usize, algorithm, change: &dyn Fn(&mut Settings)| {
        let mut changed = settings.clone();
        change(&mut changed);
        key_of(&ComputeVisibility {
            tile: &tiles[tile],
            facets: &facets,
            algorithm,
            settings: &changed,
            refined: false,
            coarser: None,
        })
    };
    let march = VisibilityAlgorithm::HeightMarch;
    let setting = |change: &dyn Fn(&mut Settings)| with(0, march, change);
    all_differ(vec![
        ("nothing", setting(&|_| {})),
        ("surface", with(1, march, &|_| {})),
        ("facets", setting(&|settings| settings.facets += 1)),
        ("bins", setting(&|settings| settings.normal_bins = Some(64))),
        ("seed", setting(&|settings| settings.seed += 1)),
        ("algorithm", with(0, VisibilityAlgorithm::HorizonScan, &|_| {})),
        ("azimuths of horizon maps", setting(&|settings| settings.horizon_azimuths += 1)),
        ("azimuths of occlusion intervals", setting(&|settings| settings.slice_azimuths += 1)),
        ("penumbra", setting(&|settings| settings.penumbra *= 1.000_001)),
        ("rings of maps", setting(&|settings| settings.map_grid = PolarGrid::new(7, settings.map_grid.azimuths))),
        ("azimuths of maps", setting(&|settings| settings.map_grid = PolarGrid::new(settings.map_grid.rings, 7))),
        ("texels of maps", setting(&|settings| settings.map_resolution += 1)),
    ]);
}

/// A measured BRDF that only its content tells apart.
#[derive(Debug)]
struct Paint(u8, MeasuredReport);

impl Measured for Paint {
    fn f_r(&self, _: &crate::brdf::LobeAngles) -> Vec3 {
        Vec3::ONE
    }
    fn name(&self) -> &'static str {
        "paint"
    }
    fn content(&self) -> Key {
        Key::of_numbers(&[self.0])
    }
    fn report(&self) -> &MeasuredReport {
        &self.1
    }
}

#[test]
fn lobes_change_the_key_of_a_material_but_its_colour_and_tints_do_not() {
    let material = |terms: Vec<Term>| Material { brdf: Brdf { terms }, color: Vec3::ONE };
    let rough = |roughness| Term::Ggx { roughness, f0: Vec3::splat(0.5) };
    let paint = |content| Term::Measured(Arc::new(Paint(content, MeasuredReport::default())));
    let lobes = |material: &Material| {
        let mut key = KeyBuilder::for_tests();
        material.hash_lobes_into(&mut key);
        key.finish()
    };
    let brdf = |material: &Material| {
        let mut key = KeyBuilder::for_tests();
        material.hash_brdf_into(&mut key);
        key.finish()
    };
    let plain = material(vec![rough(0.2)]);
    let colored = Material { color: Vec3::new(0.5, 0.1, 0.2), ..plain.clone() };
    let tinted = material(vec![Term::Ggx { roughness: 0.2, f0: Vec3::ONE }]);
    assert!(lobes(&plain) == lobes(&colored) && lobes(&plain) == lobes(&tinted));
    assert!(brdf(&plain) == brdf(&colored) && brdf(&plain) != brdf(&tinted));
    all_differ(vec![
        ("nothing", lobes(&plain)),
        ("roughness", lobes(&material(vec![rough(0.200_001)]))),
        ("a model", lobes(&material(vec![Term::Ward { roughness: 0.2, specular: Vec3::ONE }]))),
        ("one more term", lobes(&material(vec![rough(0.2), rough(0.2)]))),
        ("black", lobes(&Material { color: Vec3::ZERO, ..plain.clone() })),
        ("a measurement", lobes(&material(vec![paint(1)]))),
        ("another measurement", lobes(&material(vec![paint(2)]))),
    ]);
}

#[test]
fn each_node_of_a_table_changes_its_key() {
    let grid = HemispherePairGrid { rings: 8, azimuths: 12, phi_d: 4, theta_d: 6 };
    let nodes = Nodes::all(grid);
    let (pairs, others) = (image_pairs(20, 1), image_pairs(20, 2));
    let key = |nodes: Nodes| {
        let mut key = KeyBuilder::for_tests();
        nodes.hash_into(&mut key);
        key.finish()
    };
    all_differ(vec![
        ("nothing", key(nodes)),
        ("rings", key(Nodes { grid: HemispherePairGrid { rings: 9, ..grid }, ..nodes })),
        ("azimuths", key(Nodes { grid: HemispherePairGrid { azimuths: 16, ..grid }, ..nodes })),
        ("phi_d", key(Nodes { grid: HemispherePairGrid { phi_d: 6, ..grid }, ..nodes })),
        ("theta_d", key(Nodes { grid: HemispherePairGrid { theta_d: 7, ..grid }, ..nodes })),
        ("mirror in x", key(Nodes { mirrors: [true, false], ..nodes })),
        ("mirror in y", key(Nodes { mirrors: [false, true], ..nodes })),
        ("part of the facets", key(Nodes { facets: Some(100), ..nodes })),
        ("another part", key(Nodes { facets: Some(101), ..nodes })),
        ("read by some pairs", key(Nodes { read_by: Some(&pairs), ..nodes })),
        ("read by others", key(Nodes { read_by: Some(&others), ..nodes })),
    ]);
}

#[test]
fn the_low_rank_representation_stops_at_the_first_step_that_is_too_far_off() {
    let loaded = scene::open("fig8d_leather", &["quality.preset=draft".to_owned()]).unwrap();
    let outcome = Pipeline::new().effective(&loaded).unwrap();
    let (facets, assignment) = (&outcome.health_inputs.facets, &outcome.health_inputs.materials);
    let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
    let facets = Keyed { key: Key::of_numbers(&[1]), value: facets.clone() };
    let visibility = Keyed { key: Key::of_numbers(&[2]), value: direct.visibility.clone() };
    let inputs = FactorInputs {
        facets: &facets,
        visibility: &visibility,
        material_of_slot: &assignment.material_of_slot,
        materials: &assignment.materials,
        lobes: Key::of_numbers(&[3]),
        whole_sphere: false,
        base_area: outcome.brdf.base_area,
    };
    let runs = |pipeline: &Pipeline| ["factors", "factor_check", "factor_tables"].map(|name| pipeline.memo.runs(name));
    let with = |pipeline: &Pipeline, tolerance: f64| {
        let sum = FacetSum::new(&facets, &assignment.material_of_slot, &assignment.materials);
        let direct = Direct::new(Arc::new(sum), visibility.value.clone());
        let settings = Settings { tolerance, tolerance_db: 0.0, ..outcome.settings.clone() };
        let (brdf, errors) = pipeline.low_rank(direct, &inputs, &settings).unwrap();
        (matches!(brdf.representation, Representation::LowRank(_)), errors.rel_l2)
    };
    let (loose, strict) = (Pipeline::new(), Pipeline::new());
    let (is_low_rank, of_visibility) = with(&strict, 0.0);
    assert!(!is_low_rank && of_visibility > 0.0 && runs(&strict) == [0, 0, 0]);
    let (is_low_rank, of_all) = with(&loose, 1.0);
    assert!(is_low_rank && of_visibility < of_all && runs(&loose) == [1, 1, 1], "{of_visibility} {of_all}");
    // Between the two errors, the tables of the check are too far off.
    let between = 0.5 * (of_visibility + of_all);
    let (is_low_rank, of_check) = with(&strict, between);
    assert!(!is_low_rank && (of_check - of_all).abs() < 1e-4 * of_all, "{of_check} {of_all}");
    assert_eq!(runs(&strict), [1, 1, 0]);
    // The full tables of the same lobes are in the memo: nothing runs again.
    assert!(with(&loose, 1.0).0 && !with(&loose, between).0);
    assert_eq!(runs(&loose), [1, 1, 1]);
}

#[test]
fn an_edit_of_a_colour_finds_the_papers_factors_in_the_memo() {
    let open = |color: &str| {
        let set = ["quality.preset=wu2011", "quality.facets=200", color].map(str::to_owned);
        scene::open("fig1e_lambertian", &set).unwrap()
    };
    let pipeline = Pipeline::new();
    pipeline.effective(&open("material.default.color=[1, 1, 1]")).unwrap();
    let dark = open("material.default.color=[0.5, 0.2, 0.1]");
    let (i, o) = (Vec3::new(0.3, 0.1, 0.9).normalize(), Vec3::new(-0.5, 0.2, 0.6).normalize());
    let edited = pipeline.effective(&dark).unwrap().brdf.eval(i, o);
    assert_eq!(pipeline.memo.runs("basis"), 1);
    assert_eq!(edited, Pipeline::new().effective(&dark).unwrap().brdf.eval(i, o));
}
