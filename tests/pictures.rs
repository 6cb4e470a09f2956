//! What pictures read instead of the effective BRDF: close to it, kept under colour edits, never below zero.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

use biscale::base::Cancel;
use biscale::effective::{EffectiveBrdf, GpuVisibilityInput, Nodes, Representation, ShadingTable};
use biscale::math::directions::HemispherePairGrid;
use biscale::metrics::{compare, image_pairs, upper_errors};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::scene;
use biscale::scene::LoadedScene;
use glam::Vec3;

fn open(name: &str, set: &[&str]) -> LoadedScene {
    let set: Vec<String> = set.iter().map(|&word| word.to_owned()).collect();
    scene::open(name, &set).unwrap()
}

fn draft(name: &str) -> LoadedScene {
    open(name, &["quality.preset=draft"])
}

fn shading_brdf(outcome: &Outcome) -> std::sync::Arc<EffectiveBrdf> {
    outcome.shading_brdf(&Cancel::default()).unwrap().brdf
}

fn values(brdf: &EffectiveBrdf, seed: u64) -> Vec<Vec3> {
    image_pairs(400, seed).iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
}

#[test]
fn images_of_the_papers_five_scenes_read_a_form_within_28_decibels_on_pairs_it_was_not_checked_on() {
    for (scene, table) in [("plate", true), ("teapot", false), ("pillow", true), ("cup", false), ("skirt", true)] {
        let outcome = Pipeline::new().effective(&draft(&format!("table4_{scene}"))).unwrap();
        let read = shading_brdf(&outcome);
        assert_eq!(
            matches!(read.representation, Representation::Table(_)),
            table,
            "{scene}: {}",
            read.representation.describe()
        );
        let errors = compare(&values(&read, 4711), &values(&outcome.brdf, 4711));
        assert!(errors.psnr_db > 28.0, "{scene}: {:.1} dB {:.1} %", errors.psnr_db, errors.rel_l2 * 100.0);
    }
}

#[test]
fn a_table_is_the_sum_itself_on_its_nodes() {
    let outcome = Pipeline::new().effective(&draft("table4_plate")).unwrap();
    let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
    let grid = HemispherePairGrid { rings: 6, azimuths: 8, phi_d: 4, theta_d: 5 };
    let table = ShadingTable::build(direct, Nodes::all(grid), &Cancel::default()).unwrap().unwrap();
    let read = EffectiveBrdf { representation: Representation::Table(table), base_area: outcome.brdf.base_area };
    let peak = (0..grid.nodes()).map(|node| grid.pair(node)).map(|(i, o)| outcome.brdf.g(i, o).max_element());
    let peak = peak.fold(0.0, f32::max);
    for node in 0..grid.nodes() {
        // The last ring and the last step were lifted above the horizon.
        if node / (grid.azimuths * grid.phi_d * grid.theta_d) + 1 == grid.rings
            || node % grid.theta_d + 1 == grid.theta_d
        {
            continue;
        }
        let (i, o) = grid.pair(node);
        let (want, found) = (outcome.brdf.g(i, o), read.g(i, o));
        assert!((want - found).abs().max_element() < 2e-3 * peak, "{node}: {want} {found}");
    }
}

#[test]
fn a_table_made_for_some_pairs_answers_these_as_the_whole_table_does() {
    let outcome = Pipeline::new().effective(&draft("table4_skirt")).unwrap();
    let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
    let grid = HemispherePairGrid { rings: 7, azimuths: 12, phi_d: 6, theta_d: 5 };
    let pairs = image_pairs(20, 99);
    for mirrors in [[false; 2], [true, false], [true; 2]] {
        let read = |read_by| {
            let nodes = Nodes { mirrors, read_by, ..Nodes::all(grid) };
            let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
            let black = table.values().iter().filter(|value| **value == glam::Vec4::ZERO).count();
            (EffectiveBrdf { representation: Representation::Table(table), base_area: outcome.brdf.base_area }, black)
        };
        let ((whole, none), (some, black)) = (read(None), read(Some(&pairs[..])));
        assert!(black > none, "{mirrors:?}: nothing was left out");
        for pair in &pairs {
            assert_eq!(whole.eval(pair.i, pair.o), some.eval(pair.i, pair.o), "{mirrors:?} {pair:?}");
        }
    }
}

#[test]
fn a_table_from_few_facets_that_shine_at_each_half_vector_is_close_to_the_one_from_all() {
    for scene in ["table4_pillow", "fig6a_velvet_spread"] {
        let outcome = Pipeline::new().effective(&draft(scene)).unwrap();
        let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
        let grid = HemispherePairGrid { rings: 12, azimuths: 16, phi_d: 6, theta_d: 6 };
        let read = |facets| {
            let nodes = Nodes { facets, ..Nodes::all(grid) };
            let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
            EffectiveBrdf { representation: Representation::Table(table), base_area: outcome.brdf.base_area }
        };
        let (all, few) = (read(None), read(Some(direct.sum.facet_count() / 4)));
        let (all, few) = (values(&all, 12), values(&few, 12));
        let errors = compare(&few, &all);
        assert!(errors.rel_l2 > 0.0 && errors.rel_l2 < 0.15, "{scene}: {:.1} %", errors.rel_l2 * 100.0);
        // Weights keep the expectation: what is too much here is too little there.
        let total = |values: &[Vec3]| values.iter().map(|value| value.element_sum()).sum::<f32>();
        let drift = (total(&few) / total(&all) - 1.0).abs();
        assert!(drift < 0.03, "{scene}: {:.1} % more or less in all", drift * 100.0);
        // As many as there are: the sum itself.
        assert_eq!(values(&read(Some(direct.sum.facet_count())), 12), all, "{scene}");
    }
}

/// Figures of docs/speed.md.
#[test]
#[ignore = "a table to be printed: cargo test --release --test pictures fewer_facets -- --ignored --nocapture"]
fn fewer_facets_and_trials_against_whole_tables_at_standard() {
    let pairs = image_pairs(512, 12345);
    let values = |of: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| of.eval(pair.i, pair.o)).collect() };
    let grid = HemispherePairGrid { rings: 24, azimuths: 48, phi_d: 8, theta_d: 12 };
    println!("scene                facets      trial     whole   rel. L2   PSNR");
    for scene in ["table4_pillow", "table4_skirt", "fig7a_shot_silk", "fig6a_velvet_spread"] {
        let outcome = Pipeline::new().effective(&open(scene, &["quality.backend=cpu"])).unwrap();
        let Representation::Direct(direct) = outcome.brdf.direct_representation() else { panic!("{scene}: not a sum") };
        let exact = values(&outcome.brdf);
        for facets in [None, Some(direct.sum.facet_count() / 5)] {
            let made = |read_by| {
                let start = std::time::Instant::now();
                let nodes = Nodes { facets, read_by, ..Nodes::all(grid) };
                let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
                let ms = start.elapsed().as_secs_f64() * 1e3;
                (values(&outcome.brdf.with_direct_representation(Representation::Table(table))), ms)
            };
            let ((tried, trial_ms), (whole, whole_ms)) = (made(Some(&pairs[..])), made(None));
            assert_eq!(tried, whole, "{scene}: a trial tells another error than the table");
            let errors = upper_errors(&whole, &exact);
            let (percent, db, count) = (100.0 * errors.rel_l2, errors.psnr_db, facets.map_or("all", |_| "a fifth"));
            println!("{scene:<20} {count:<8} {trial_ms:>6.0} ms {whole_ms:>6.0} ms {percent:>6.2} % {db:>6.1} dB");
        }
    }
}

/// Figures of docs/speed.md.
#[test]
#[ignore = "a table to be printed: cargo test --release --test pictures part_of_the_facets -- --ignored --nocapture"]
fn trials_from_part_of_the_facets() {
    let pairs = image_pairs(512, 12345);
    let values = |of: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| of.eval(pair.i, pair.o)).collect() };
    println!("scene                preset    facets picked  azimuths  nodes  rel. L2   PSNR");
    let fields = ["table4_plate", "fig8b_ripples", "fig8d_leather"];
    let overhangs = ["table4_pillow", "table4_skirt", "fig6a_velvet_spread"];
    for (preset, [rings, azimuths, phi_d, theta_d]) in [("standard", [24, 48, 8, 12]), ("fine", [32, 64, 12, 16])] {
        for scene in fields.into_iter().chain(overhangs) {
            let set = ["quality.backend=cpu".to_owned(), format!("quality.preset={preset}")];
            let made = |set: &[String]| Pipeline::new().effective(&scene::open(scene, set).unwrap()).unwrap();
            let outcome = made(&set);
            let unseen = Pipeline::new().gpu_tile(&scene::open(scene, &set).unwrap()).unwrap().unwrap();
            let few = match &unseen.sum.visibility_input {
                GpuVisibilityInput::Heights(heights) => heights.azimuths,
                GpuVisibilityInput::OcclusionIntervals(slices) => slices.azimuths,
                _ => panic!("{scene}: another route"),
            };
            let as_device = made(&[&set[..], &[format!("quality.azimuths={few}")]].concat());
            let few = (few, unseen.sum.nodes.unwrap().grid);
            let settings = &outcome.settings;
            let field = matches!(unseen.sum.visibility_input, GpuVisibilityInput::Heights(_));
            let many = if field { settings.horizon_azimuths } else { settings.slice_azimuths };
            let (exact, many) = (values(&outcome.brdf), (many, HemispherePairGrid { rings, azimuths, phi_d, theta_d }));
            let all = settings.facets;
            let mut cases = vec![(all, many), (3200, many), (1600, many), (1600, few), (800, few)];
            cases.dedup();
            for (count, (azimuths, grid)) in cases {
                let of = if azimuths == few.0 { &as_device } else { &outcome };
                let Representation::Direct(direct) = of.brdf.direct_representation() else {
                    panic!("{scene}: not a sum")
                };
                let facets = (count < all).then_some(count);
                let nodes = Nodes { facets, read_by: Some(&pairs[..]), ..Nodes::all(grid) };
                let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
                let errors = upper_errors(
                    &values(&outcome.brdf.with_direct_representation(Representation::Table(table))),
                    &exact,
                );
                let (percent, db) = (100.0 * errors.rel_l2, errors.psnr_db);
                let nodes = grid.nodes();
                println!(
                    "{scene:<20} {preset:<9} {count:>5} of {all:>5} {azimuths:>7} {nodes:>7} {percent:>7.2} % {db:>6.1} dB"
                );
            }
        }
    }
}

/// Figures of docs/speed.md.
#[test]
#[ignore = "a table to be printed: cargo test --release --test pictures few_facets -- --ignored --nocapture"]
fn few_facets_of_few_normals_as_devices_sum_them() {
    let pairs = image_pairs(512, 12345);
    let values = |of: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| of.eval(pair.i, pair.o)).collect() };
    println!("scene                  preset    facets        rel. L2   PSNR");
    let (mut scenes, mut worst) = (0, 0.0_f64);
    let mut names: Vec<_> = std::fs::read_dir("materials").unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    for scene in names.iter().filter_map(|path| path.file_stem()?.to_str()) {
        for preset in ["draft", "standard", "fine"] {
            let set = ["quality.backend=cpu".to_owned(), format!("quality.preset={preset}")];
            let open = |facets: Option<usize>| {
                let facets = facets.map(|facets| format!("quality.facets={facets}"));
                scene::open(scene, &set.iter().cloned().chain(facets).collect::<Vec<_>>()).unwrap()
            };
            let Some(unseen) = Pipeline::new().gpu_tile(&open(None)).unwrap() else { break };
            if unseen.sum.nodes.is_some() {
                break;
            }
            let whole = Pipeline::new().effective(&open(None)).unwrap();
            let few = Pipeline::new().effective(&open(Some(unseen.settings.facets))).unwrap();
            let errors = upper_errors(&values(&few.brdf), &values(&whole.brdf));
            let (percent, db) = (100.0 * errors.rel_l2, errors.psnr_db);
            let [few, all] = [unseen.sum.sum.facet_count(), whole.settings.facets];
            if few == all {
                break;
            }
            println!("{scene:<22} {preset:<9} {few:>4} of {all:>5} {percent:>6.2} % {db:>6.1} dB");
            (scenes, worst) = (scenes + 1, worst.max(errors.rel_l2));
        }
    }
    assert!(scenes >= 24 && worst < 0.06, "{scenes} tables, one {worst} off: facets that fall in step are far off");
}

#[test]
fn a_table_of_a_mirrored_tile_is_its_own_mirror_image_and_close_to_the_whole_one() {
    let outcome = Pipeline::new().effective(&draft("table4_skirt")).unwrap();
    let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
    let grid = HemispherePairGrid { rings: 6, azimuths: 12, phi_d: 4, theta_d: 5 };
    let read = |mirrors: [bool; 2]| {
        let table =
            ShadingTable::build(direct, Nodes { mirrors, ..Nodes::all(grid) }, &Cancel::default()).unwrap().unwrap();
        EffectiveBrdf { representation: Representation::Table(table), base_area: outcome.brdf.base_area }
    };
    let (whole, spared) = (read([false; 2]), read([true; 2]));
    let (mut error, mut power) = (0.0, 0.0);
    for node in 0..grid.nodes() {
        let (i, o) = grid.pair(node);
        let (want, found) = (whole.g(i, o), spared.g(i, o));
        error += (want - found).length_squared();
        power += want.length_squared();
        // Half vectors on a plane are their own images: both sides of it are summed, each over its own facets.
        let h = (i + o).normalize_or_zero();
        if h.x.abs().min(h.y.abs()) < 1e-3 {
            continue;
        }
        for mirror in [Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(-1.0, -1.0, 1.0)] {
            let image = spared.g(i * mirror, o * mirror);
            assert!(
                (image - found).abs().max_element() <= 1e-3 * found.max_element() + 1e-3,
                "{node}: {image} {found}"
            );
        }
    }
    // The facets are drawn at random: their sum is as symmetric as it is exact (draft leaves some 7 % on this tile).
    assert!((error / power).sqrt() < 0.14, "{}", (error / power).sqrt());
}

#[test]
fn a_table_is_never_below_zero_and_dark_under_the_horizon() {
    let outcome = Pipeline::new().effective(&draft("table4_plate")).unwrap();
    let read = shading_brdf(&outcome);
    assert!(values(&read, 5).iter().all(|f| f.min_element() >= 0.0 && f.is_finite()));
    let under = Vec3::new(0.6, 0.0, -0.8);
    assert_eq!(read.eval(under, Vec3::Z), Vec3::ZERO);
    assert_eq!(read.eval(Vec3::Z, under), Vec3::ZERO);
}

#[test]
fn a_colour_edit_keeps_the_table_and_leaves_what_a_fresh_start_makes() {
    let mut pipeline = Pipeline::new();
    let before = pipeline.effective(&draft("table4_plate")).unwrap();
    let first = before.shading_brdf(&Cancel::default()).unwrap();
    let mut edited = draft("table4_plate");
    edited.scene.nudge_color().unwrap();
    let after = pipeline.effective(&edited).unwrap();
    let kept = after.shading_brdf(&Cancel::default()).unwrap();
    let fresh = shading_brdf(&Pipeline::new().effective(&edited).unwrap());
    assert_eq!(values(&kept.brdf, 9), values(&fresh, 9));
    assert_ne!(values(&kept.brdf, 9), values(&first.brdf, 9));
    let (Representation::Table(a), Representation::Table(b)) = (&first.brdf.representation, &kept.brdf.representation)
    else {
        panic!("no tables")
    };
    assert!(a.shares_values_with(b));
}

#[test]
fn a_brdf_edit_where_normals_are_many_makes_the_table_anew() {
    let mut pipeline = Pipeline::new();
    let scene = draft("table4_plate");
    let first = shading_brdf(&pipeline.effective(&scene).unwrap());
    let mut edited = scene;
    edited.scene.nudge_brdf().unwrap();
    let second = shading_brdf(&pipeline.effective(&edited).unwrap());
    let fresh = shading_brdf(&Pipeline::new().effective(&edited).unwrap());
    assert_eq!(values(&second, 3), values(&fresh, 3));
    assert_ne!(values(&second, 3), values(&first, 3));
}

#[test]
fn a_thinned_sum_keeps_the_area_of_every_normal() {
    let outcome = Pipeline::new().effective(&draft("table4_teapot")).unwrap();
    let Representation::Direct(direct) = &outcome.brdf.representation else { panic!("not a sum") };
    let strided_subset = direct.strided_subset(10).unwrap();
    assert!(strided_subset.sum.facet_count() * 8 < direct.sum.facet_count());
    // From straight above all is seen: the projected area is that of the base.
    let area = |of: &biscale::effective::Direct| of.sums(&[], Vec3::Z, |_, _| {});
    assert!((area(&strided_subset) / area(direct) - 1.0).abs() < 1e-4);
}

#[test]
fn exact_images_can_be_asked_for() {
    let scene = open("table4_plate", &["quality.preset=draft", "effects.picture_table=off"]);
    let outcome = Pipeline::new().effective(&scene).unwrap();
    assert!(std::sync::Arc::ptr_eq(&shading_brdf(&outcome), &outcome.brdf));
}
