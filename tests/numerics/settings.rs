//! Settings of `[quality]`: each changes the result, and within its stated error.

use biscale::base::Cancel;
use biscale::effective::{EffectiveBrdf, Interpolation, Nodes, Representation, ShadingTable};
use biscale::math::directions::HemispherePairGrid;
use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::plan::VisibilityAlgorithm;
use biscale::scene;
use glam::Vec3;

fn outcome(scene: &str, overrides: &[&str]) -> Outcome {
    let overrides: Vec<String> =
        overrides.iter().map(|text| (*text).to_owned()).chain(["quality.backend=cpu".to_owned()]).collect();
    Pipeline::new().effective(&scene::open(scene, &overrides).unwrap()).unwrap()
}

/// Returns the relative L2 and the PSNR of `a` against `b` on 200 pairs.
fn errors_between(a: &Outcome, b: &Outcome) -> (f64, f64) {
    let pairs = mirror_biased_pairs(200, 8);
    let values =
        |outcome: &Outcome| -> Vec<Vec3> { pairs.iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect() };
    let errors = compare(&values(a), &values(b));
    (errors.rel_l2, errors.psnr_db)
}

#[test]
fn occlusion_intervals_and_shadow_maps_agree_with_horizon_maps() {
    let overrides = ["quality.facets=2048", "quality.method=direct"];
    let with = |visibility: &str, grid: &[&str]| {
        let method = format!("quality.visibility={visibility}");
        outcome("fig8a_hammered", &[&overrides[..], &[&method], grid].concat())
    };
    // Shadow maps along few directions: their time is in proportion.
    let (horizons, slices) = (with("auto", &[]), with("slices", &[]));
    let maps = with("maps", &["quality.rings=16", "quality.azimuths=32"]);
    assert_eq!(horizons.plan.algorithm, VisibilityAlgorithm::HeightMarch);
    assert_eq!(
        (slices.plan.algorithm, maps.plan.algorithm),
        (VisibilityAlgorithm::OcclusionIntervals, VisibilityAlgorithm::CpuMaps)
    );
    let (sliced, mapped) = (errors_between(&slices, &horizons), errors_between(&maps, &horizons));
    assert!(sliced.1 > 40.0 && mapped.1 > 35.0, "{sliced:?} {mapped:?}");
    // The three algorithms differ.
    assert!(sliced.0 > 1e-6 && mapped.0 > 1e-6, "{sliced:?} {mapped:?}");
}

#[test]
fn more_bins_of_normals_have_less_error_and_fewer_bins_have_fewer_lobes() {
    let overrides = ["quality.facets=8192", "quality.method=direct"];
    let exact = outcome("fig8a_hammered", &overrides);
    let mut last = f64::INFINITY;
    for bins in [64, 512, 4096] {
        let setting = format!("quality.normal_bins={bins}");
        let binned = outcome("fig8a_hammered", &[&overrides[..], &[&setting]].concat());
        let Representation::Direct(direct) = &binned.brdf.representation else { panic!("not a sum") };
        assert!(direct.sum.normal_count().is_some_and(|count| count < bins), "{bins}");
        let error = errors_between(&binned, &exact).0;
        assert!(error < 0.6 * last, "{bins}: {error} after {last}");
        last = error;
    }
    assert!(last < 0.05, "{last}");
}

#[test]
fn linear_interpolation_of_a_shading_table_has_more_error_than_cubic() {
    let sum = outcome("fig8a_hammered", &["quality.facets=1024", "quality.method=direct"]);
    let Representation::Direct(direct) = &sum.brdf.representation else { panic!("not a sum") };
    let grid = HemispherePairGrid { rings: 16, azimuths: 24, phi_d: 6, theta_d: 8 };
    let table = ShadingTable::build(direct, Nodes::all(grid), &Cancel::default()).unwrap().unwrap();
    let pairs = mirror_biased_pairs(200, 8);
    let values = |brdf: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).collect() };
    let error = |interpolation: Interpolation| {
        let table = sum.brdf.with_direct_representation(Representation::Table(table.clone().read(interpolation)));
        compare(&values(&table), &values(&sum.brdf)).rel_l2
    };
    let (cubic, linear) = (error(Interpolation::Cubic), error(Interpolation::Linear));
    assert!(cubic < 0.95 * linear, "{cubic} {linear}");
}
