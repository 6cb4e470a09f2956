//! What is kept between runs is what would be made, and every input counts.

use std::collections::HashSet;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::kept::identify_sight;
use super::{Outcome, Pipeline};
use crate::base::Cancel;
use crate::brdf::{Brdf, Measured, MeasuredReport, Term};
use crate::cache::{Cache, Key, KeyBuilder, Stored, Writer};
use crate::effective::{FacetSum, Material, Nodes, Representation};
use crate::geometry::{Facets, TileMesh};
use crate::math::directions::{HemispherePairGrid, PolarGrid};
use crate::metrics::image_pairs;
use crate::plan::{Settings, VisibilityAlgorithm};
use crate::scene;
use crate::visibility::{HorizonMap, Visibility};

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

/// All bits of visibility and table, and of some values.
fn bits((outcome, shading_brdf): &(Outcome, super::ShadingBrdf)) -> (Vec<u8>, Vec<u32>) {
    let Representation::Direct(direct) = outcome.brdf.direct_form() else { panic!("a sum") };
    let mut out = Writer::default();
    direct.visibility.write(&mut out);
    if let Representation::Table(table) = shading_brdf.brdf.direct_form() {
        table.content().write(&mut out);
    }
    let values = image_pairs(200, 3).into_iter().flat_map(|pair| {
        [&outcome.brdf, &shading_brdf.brdf].map(|brdf| brdf.eval(pair.i, pair.o).to_array().map(f32::to_bits))
    });
    (out.into_bytes(), values.flatten().collect())
}

#[test]
fn what_was_kept_is_the_same_bits_as_what_is_made() {
    let maps = "quality.visibility=\"maps\"";
    // OcclusionIntervals, horizons by walking, horizons by slicing, maps; few normals; no table close enough.
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
        assert!(stages(&empty.0).contains(&"visibility") && !empty.1.was_kept, "{scene} {set:?}");
        assert!(stages(&full.0).contains(&"cached_visibility"), "{scene} {set:?}: {:?}", stages(&full.0));
        let has_table = matches!(without.1.brdf.direct_form(), Representation::Table(_));
        assert!(full.1.was_kept || !has_table, "{scene} {set:?}");
        assert!(bits(&without) == bits(&empty) && bits(&without) == bits(&full), "{scene} {set:?}");
        assert_eq!(without.1.errors.is_some(), full.1.errors.is_some());
    }
}

#[test]
fn a_table_that_was_kept_serves_other_colours_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    run("table4_skirt", &[], &cache);
    let colored = ["material.default.color=[0.9, 0.2, 0.1]"];
    let read = run("table4_skirt", &colored, &cache);
    assert!(read.1.was_kept);
    assert!(bits(&read) == bits(&run("table4_skirt", &colored, &Cache::off())));
}

#[test]
fn another_material_surface_or_setting_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    run("table4_skirt", &[], &cache);
    let rough = run("table4_skirt", &["material.default.brdf={ kind = \"ggx\", roughness = 0.4, f0 = 0.9 }"], &cache);
    assert!(!rough.1.was_kept && stages(&rough.0).contains(&"cached_visibility"));
    for change in ["quality.facets=1000", "quality.azimuths=20", "quality.penumbra_deg=3", "quality.seed=2"] {
        let (outcome, shading_brdf) = run("table4_skirt", &[change], &cache);
        assert!(!shading_brdf.was_kept && !stages(&outcome).contains(&"cached_visibility"), "{change}");
    }
}

#[test]
fn what_was_given_up_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 1 << 28);
    let loaded = scene::open("table4_skirt", &["quality.backend=cpu".to_owned()]).unwrap();
    let cancel = Cancel::default();
    let mut pipeline = Pipeline::new();
    pipeline.set_cache(cache.clone());
    pipeline.cancel_with(cancel.clone());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(15));
            cancel.set();
        });
        // Whether it was given up in the slices or after them.
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
    let Representation::Direct(direct) = outcome.brdf.direct_form() else { panic!("a sum") };
    let mut out = Writer::default();
    direct.visibility.write(&mut out);
    out.into_bytes()
}

/// Keys of all inputs, each changed alone, and of none: all must differ.
fn all_differ(keys: Vec<(&str, Key)>) {
    let mut seen = HashSet::new();
    for (change, key) in keys {
        assert!(seen.insert(key), "{change} does not count");
    }
}

fn key_of(hash_into: impl FnOnce(&mut KeyBuilder)) -> Key {
    let mut key = KeyBuilder::for_tests();
    hash_into(&mut key);
    key.finish()
}

#[test]
fn each_input_of_visibility_counts() {
    type Input = (VisibilityAlgorithm, TileMesh, Facets, Settings);
    let loaded = scene::open("table4_plate", &["quality.preset=draft".to_owned()]).unwrap();
    let mesh = Pipeline::new().mesh(&loaded).unwrap();
    let facets = Facets::sample(&mesh, 64, 1);
    let input: Input = (VisibilityAlgorithm::HeightMarch, mesh, facets, Settings::of(&loaded.scene));
    type Change = (&'static str, fn(&mut Input));
    let changes: Vec<Change> = vec![
        ("nothing", |_| {}),
        ("route", |input| input.0 = VisibilityAlgorithm::HorizonScan),
        ("size of the tile", |input| input.1.size.x *= 2.0),
        ("a vertex", |input| input.1.positions[5].z += 1e-6),
        ("one vertex fewer", |input| _ = input.1.positions.pop()),
        ("a triangle", |input| input.1.triangles[3].reverse()),
        ("a height", |input| input.1.height_grid.as_mut().unwrap().heights[7] += 1e-6),
        ("the shape of the heights", |input| {
            let size = &mut input.1.height_grid.as_mut().unwrap().size;
            size.x *= 2;
            size.y /= 2;
        }),
        ("no heights", |input| input.1.height_grid = None),
        ("a facet's place", |input| input.2.positions[9].y += 1e-6),
        ("a facet's normal", |input| input.2.normals[9].y += 1e-6),
        ("a facet's geometric normal", |input| input.2.geometric_normals[9].y += 1e-6),
        ("a facet's triangle", |input| input.2.triangles[9] += 1),
        ("azimuths of horizons", |input| input.3.horizon_azimuths += 1),
        ("azimuths of slices", |input| input.3.slice_azimuths += 1),
        ("penumbra", |input| input.3.penumbra *= 1.000_001),
        ("rings of maps", |input| input.3.map_grid = PolarGrid::new(7, input.3.map_grid.azimuths)),
        ("azimuths of maps", |input| input.3.map_grid = PolarGrid::new(input.3.map_grid.rings, 7)),
        ("texels of maps", |input| input.3.map_resolution += 1),
    ];
    let key = |input: &Input| key_of(|key| identify_sight(key, input.0, &input.1, &input.2, &input.3));
    let keys = changes.into_iter().map(|(name, change)| {
        let mut changed = input.clone();
        change(&mut changed);
        (name, key(&changed))
    });
    all_differ(keys.collect());
}

/// A measured BRDF that is told apart by its content only.
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
fn each_input_of_a_sum_counts_but_for_its_colours() {
    let loaded = scene::open("fig4b_bicolor_cup", &[]).unwrap();
    let mesh = Pipeline::new().mesh(&loaded).unwrap();
    let mut facets = Facets::sample(&mesh, 512, 1);
    facets.sort_for_sums();
    type Input = (Facets, Vec<usize>, Vec<Material>);
    let material = |terms: Vec<Term>| Material { brdf: Brdf { terms }, color: Vec3::ONE };
    let rough = |roughness| Term::Ggx { roughness, f0: Vec3::splat(0.5) };
    let paint = |content| Term::Measured(Arc::new(Paint(content, MeasuredReport::default())));
    let input: Input = (facets, vec![0, 1], vec![material(vec![rough(0.2)]), material(vec![paint(1)])]);
    let with = |change: &dyn Fn(&mut Input)| {
        let mut changed = input.clone();
        change(&mut changed);
        key_of(|key| FacetSum::new(&changed.0, &changed.1, &changed.2).hash_into(key))
    };
    let same = with(&|_| {});
    assert_eq!(same, with(&|input| input.2[0].color = Vec3::new(0.5, 0.1, 0.2)), "a colour");
    assert_eq!(
        same,
        with(&|input| input.2[0].brdf.terms = vec![Term::Ggx { roughness: 0.2, f0: Vec3::ONE }]),
        "a tint"
    );
    all_differ(vec![
        ("nothing", same),
        ("a normal", with(&|input| input.0.normals[3].x += 1e-6)),
        ("an area", with(&|input| input.0.areas[3] *= 1.000_001)),
        ("a slot", with(&|input| input.0.slots.fill(0))),
        ("whose material", with(&|input| input.1.reverse())),
        ("a colour weight", with(&|input| input.0.colors[3].y = 0.5)),
        ("another colour weight", with(&|input| input.0.colors[4].y = 0.5)),
        ("roughness", with(&|input| input.2[0].brdf.terms = vec![rough(0.200_001)])),
        ("a model", with(&|input| input.2[0].brdf.terms = vec![Term::Ward { roughness: 0.2, specular: Vec3::ONE }])),
        ("one more term", with(&|input| input.2[0].brdf.terms.push(rough(0.2)))),
        ("black", with(&|input| input.2[0].color = Vec3::ZERO)),
        ("what was measured", with(&|input| input.2[1].brdf.terms = vec![paint(2)])),
    ]);
}

#[test]
fn each_node_and_each_visibility_of_a_table_counts() {
    let grid = HemispherePairGrid { rings: 8, azimuths: 12, turn: 4, difference: 6 };
    let nodes = Nodes::all(grid);
    let (pairs, others) = (image_pairs(20, 1), image_pairs(20, 2));
    let key = |nodes: Nodes| key_of(|key| nodes.hash_into(key));
    all_differ(vec![
        ("nothing", key(nodes)),
        ("rings", key(Nodes { grid: HemispherePairGrid { rings: 9, ..grid }, ..nodes })),
        ("azimuths", key(Nodes { grid: HemispherePairGrid { azimuths: 16, ..grid }, ..nodes })),
        ("turn", key(Nodes { grid: HemispherePairGrid { turn: 6, ..grid }, ..nodes })),
        ("difference", key(Nodes { grid: HemispherePairGrid { difference: 7, ..grid }, ..nodes })),
        ("mirror in x", key(Nodes { mirrors: [true, false], ..nodes })),
        ("mirror in y", key(Nodes { mirrors: [false, true], ..nodes })),
        ("part of the facets", key(Nodes { facets: Some(100), ..nodes })),
        ("another part", key(Nodes { facets: Some(101), ..nodes })),
        ("read by some pairs", key(Nodes { read_by: Some(&pairs), ..nodes })),
        ("read by others", key(Nodes { read_by: Some(&others), ..nodes })),
    ]);
    let tile = |depth: &str| {
        let loaded = scene::open("table4_plate", &["quality.preset=draft".to_owned(), depth.to_owned()]).unwrap();
        Pipeline::new().mesh(&loaded).unwrap()
    };
    let mesh = tile("quality.facets=64");
    let facets = Facets::sample(&mesh, 64, 1);
    let heights = mesh.height_grid.as_ref().unwrap();
    let seen =
        |size: Vec2, azimuths, ramp| Visibility::HorizonMap(HorizonMap::march(heights, size, &facets, azimuths, ramp));
    let key = |visibility: &Visibility| key_of(|key| visibility.hash_into(key));
    all_differ(vec![
        ("nothing", key(&seen(mesh.size, 8, 0.02))),
        ("azimuths", key(&seen(mesh.size, 9, 0.02))),
        ("penumbra", key(&seen(mesh.size, 8, 0.03))),
        ("horizons", key(&seen(mesh.size * 1.5, 8, 0.02))),
        ("unblocked", key(&Visibility::Unblocked { facets: 64 })),
        ("fewer", key(&Visibility::Unblocked { facets: 63 })),
    ]);
}
