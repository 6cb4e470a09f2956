//! Knobs of `[quality]` act, and what they trade is as said.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

use biscale::base::Cancel;
use biscale::effective::{EffectiveBrdf, Interpolation, Nodes, Representation, ShadingTable};
use biscale::math::directions::HemispherePairGrid;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::plan::VisibilityAlgorithm;
use biscale::scene;
use glam::Vec3;

fn made(scene: &str, set: &[&str]) -> Outcome {
    let set: Vec<String> =
        set.iter().map(|word| (*word).to_owned()).chain(["quality.backend=cpu".to_owned()]).collect();
    Pipeline::new().effective(&scene::open(scene, &set).unwrap()).unwrap()
}

/// Relative L2 and PSNR of one against another, on 200 pairs.
fn apart(a: &Outcome, b: &Outcome) -> (f64, f64) {
    let pairs = mirror_biased_pairs(200, 8);
    let values = |of: &Outcome| -> Vec<Vec3> { pairs.iter().map(|pair| of.brdf.eval(pair.i, pair.o)).collect() };
    let errors = compare(&values(a), &values(b));
    (errors.rel_l2, errors.psnr_db)
}

#[test]
fn slices_and_maps_see_what_horizons_see() {
    let set = ["quality.facets=2048", "quality.method=direct"];
    let with = |visibility: &str| {
        let word = format!("quality.visibility={visibility}");
        made("fig8a_hammered", &[&set[..], &[&word]].concat())
    };
    let (horizons, slices, maps) = (with("auto"), with("slices"), with("maps"));
    assert_eq!(horizons.plan.algorithm, VisibilityAlgorithm::HeightMarch);
    assert_eq!(
        (slices.plan.algorithm, maps.plan.algorithm),
        (VisibilityAlgorithm::OcclusionIntervals, VisibilityAlgorithm::CpuMaps)
    );
    let (sliced, mapped) = (apart(&slices, &horizons), apart(&maps, &horizons));
    assert!(sliced.1 > 40.0 && mapped.1 > 35.0, "{sliced:?} {mapped:?}");
    // Three ways of computing, not one under three names.
    assert!(sliced.0 > 1e-6 && mapped.0 > 1e-6, "{sliced:?} {mapped:?}");
}

#[test]
fn more_bins_of_normals_are_nearer_to_the_normals_themselves_and_fewer_are_fewer_lobes() {
    let set = ["quality.facets=8192", "quality.method=direct"];
    let exact = made("fig8a_hammered", &set);
    let mut last = f64::INFINITY;
    for bins in [64, 512, 4096] {
        let word = format!("quality.normal_bins={bins}");
        let binned = made("fig8a_hammered", &[&set[..], &[&word]].concat());
        let Representation::Direct(direct) = &binned.brdf.representation else { panic!("not a sum") };
        assert!(direct.sum.normal_count().is_some_and(|count| count < bins), "{bins}");
        let error = apart(&binned, &exact).0;
        assert!(error < 0.6 * last, "{bins}: {error} after {last}");
        last = error;
    }
    assert!(last < 0.05, "{last}");
}

#[test]
fn linear_interpolation_of_a_shading_table_is_farther_from_the_sum_than_cubic() {
    let sum = made("fig8a_hammered", &["quality.facets=1024", "quality.method=direct"]);
    let Representation::Direct(direct) = &sum.brdf.representation else { panic!("not a sum") };
    let grid = HemispherePairGrid { rings: 16, azimuths: 24, phi_d: 6, theta_d: 8 };
    let table = ShadingTable::build(direct, Nodes::all(grid), &Cancel::default()).unwrap().unwrap();
    let pairs = mirror_biased_pairs(200, 8);
    let values = |of: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| of.eval(pair.i, pair.o)).collect() };
    let off = |interpolation: Interpolation| {
        let table = sum.brdf.with_direct_representation(Representation::Table(table.clone().read(interpolation)));
        compare(&values(&table), &values(&sum.brdf)).rel_l2
    };
    let (cubic, linear) = (off(Interpolation::Cubic), off(Interpolation::Linear));
    assert!(cubic < 0.95 * linear, "{cubic} {linear}");
}
