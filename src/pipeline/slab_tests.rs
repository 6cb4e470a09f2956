//! Slabs from scenes: which stages run, and what the shipped scenes transmit.

use glam::DVec3;

use super::Pipeline;
use crate::scene::{self, LoadedScene};
use crate::slab::{DiscLobe, Method};

const SCENE: &str = "[tile]\ngeometry = { kind = \"pyramids\", height = 0.04 }\n[slab.top]\nkind = \"tile\"\n[slab.bottom]\nkind = \"ggx\"\nroughness = 0.2\n[quality]\npreset = \"draft\"\n";

fn loaded(source: &str) -> LoadedScene {
    let scene = scene::parse(source).unwrap();
    LoadedScene { scene, base_dir: std::path::PathBuf::new(), name: "test".to_owned(), painted: Default::default() }
}

#[test]
fn an_edit_of_a_face_makes_its_normals_and_their_correlation_again_and_eta_and_thickness_neither() {
    let pipeline = Pipeline::new();
    let after = |source: &str| -> Vec<&'static str> {
        let before = pipeline.runs();
        pipeline.slab(&loaded(source)).unwrap();
        let has_run = |(now, before): &((&str, u64), (&str, u64))| now.1 > before.1;
        pipeline.runs().into_iter().zip(before).filter(has_run).map(|((name, _), _)| name).collect()
    };
    assert_eq!(after(SCENE), ["slab_top", "slab_bottom", "slab_correlation", "slab_inner"]);
    assert_eq!(after(SCENE), [""; 0]);
    let rougher = SCENE.replace("0.2", "0.3");
    assert_eq!(after(&rougher), ["slab_bottom", "slab_correlation", "slab_inner"]);
    let thicker = rougher.replace("[slab.top]", "[slab]\neta = 1.4\nthickness = 0.5\nabsorption = 0.1\n[slab.top]");
    assert_eq!(after(&thicker), ["slab_inner"]);
    let diffuse = thicker.replace("eta = 1.4", "eta = 1.4\ndiffuse = 0.1");
    assert_eq!(after(&diffuse), [""; 0]);
    let steeper = diffuse.replace("0.04", "0.05");
    assert_eq!(after(&steeper), ["slab_top", "slab_correlation", "slab_inner"]);
    let off = steeper.replace("eta = 1.4", "bounces = \"off\"\neta = 1.3");
    assert_eq!(after(&off), [""; 0]);
}

#[test]
fn a_scene_without_a_slab_runs_no_stage_of_slabs_and_a_slab_no_other() {
    let pipeline = Pipeline::new();
    let plain =
        SCENE.split("[slab.top]").next().unwrap().to_owned() + "[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n";
    let outcome = pipeline.effective(&loaded(&plain)).unwrap();
    assert!(!outcome.plan.is_on("slab"));
    let runs = |pipeline: &Pipeline, is_slab: bool| -> u64 {
        pipeline.runs().iter().filter(|(name, _)| name.starts_with("slab") == is_slab).map(|(_, runs)| runs).sum()
    };
    assert_eq!(runs(&pipeline, true), 0);
    let pipeline = Pipeline::new();
    pipeline.slab(&loaded(SCENE)).unwrap();
    assert_eq!((runs(&pipeline, true), runs(&pipeline, false)), (4, 0));
    for error in [pipeline.effective(&loaded(SCENE)).unwrap_err(), pipeline.slab(&loaded(&plain)).unwrap_err()] {
        assert_eq!(error.exit_code(), 2);
    }
}

#[test]
fn shipped_slabs_are_computed_and_keep_all_light() {
    let mut count = 0;
    for name in scene::shipped::names().filter(|name| name.starts_with("slab_")) {
        let outcome = Pipeline::new().slab(&scene::open(name, &["quality.preset=draft".to_owned()]).unwrap()).unwrap();
        let slab = &outcome.slab;
        let i = DVec3::new(0.5, 0.0, 0.75_f64.sqrt());
        let [straight, mirrored] = slab.straight(i);
        let transmitted = DiscLobe::transmitted(slab, i, 96).total() + straight;
        let all = transmitted + DiscLobe::reflected(slab, i, 96).total() + mirrored;
        println!("{name}: T {:.3}, all {:.3}", transmitted.x, all.x);
        // Paper absorbs.
        let least = if slab.captured.is_some() { 0.3 } else { 0.5 };
        assert!(transmitted.min_element() > least && all.max_element() < 1.03, "{name}: {transmitted} {all}");
        if let Some(parts) = slab.parts(i) {
            let absorbed = DVec3::from_array(parts.map(|parts| parts.absorbed));
            // Eq. 11 loses light.
            let bound = if slab.method == Method::Faces || slab.top.is_smooth() { 0.03 } else { 0.1 };
            assert!((all + absorbed - 1.0).abs().max_element() < bound, "{name}: {all} + {absorbed}");
        }
        count += 1;
    }
    assert_eq!(count, 13);
}

#[test]
fn equal_rough_faces_are_summed_at_standard_quality_and_one_rough_face_is_closed() {
    let method = |name: &str| {
        let loaded = scene::open(name, &["slab.method=auto".to_owned()]).unwrap();
        let outcome = Pipeline::new().slab(&loaded).unwrap();
        assert_eq!(outcome.effects[0].name, "slab");
        (outcome.slab.method, outcome.dual_error)
    };
    assert_eq!(method("slab_fig3_top"), (Method::Dual, 0.0));
    assert_eq!(method("slab_window"), (Method::Dual, 0.0));
    let (both, error) = method("slab_fig3_both");
    println!("Eq. 11 of 0.2/0.2 is {:.1} % from Eq. 1", 100.0 * error);
    assert!(both == Method::Faces && error > 0.05 && error < 0.4, "{error}");
}

#[test]
fn all_light_on_a_rough_slab_with_bounces_is_reflected_transmitted_or_absorbed_up_to_75_degrees() {
    for source in
        [SCENE.to_owned(), SCENE.replace("[slab.top]", "[slab]\nthickness = 1\nabsorption = [0.5, 0.1, 0]\n[slab.top]")]
    {
        let outcome = Pipeline::new().slab(&loaded(&source.replace("draft", "standard"))).unwrap();
        let slab = &outcome.slab;
        for degrees in [2.0, 60.0, 75.0_f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let mut all = DVec3::ZERO;
            for azimuth in [0.0, 22.5_f64] {
                let (y, x) = azimuth.to_radians().sin_cos();
                let i = DVec3::new(sin * x, sin * y, cos);
                let [straight, mirrored] = slab.straight(i);
                let through = DiscLobe::transmitted(slab, i, 96).total() + straight;
                let back = DiscLobe::reflected(slab, i, 96).total() + mirrored;
                let absorbed = DVec3::from_array(slab.parts(i).unwrap().map(|parts| parts.absorbed));
                all += (through + back + absorbed) / 2.0;
                println!("{degrees}, {azimuth}: T {:.4} R {:.4} A {:.4}", through.x, back.x, absorbed.x);
            }
            println!("{degrees}: sum {all:.4}");
            assert!((all - 1.0).abs().max_element() < 0.02, "{degrees}: {all}");
        }
    }
}

#[test]
fn all_light_on_a_pane_is_reflected_transmitted_or_absorbed_at_every_angle() {
    let slab = Pipeline::new().slab(&scene::open("slab_window", &[]).unwrap()).unwrap().slab;
    for degrees in [0.0, 60.0, 85.0, 88.0, 89.0, 89.9, 90.0_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let i = DVec3::new(sin, 0.0, cos);
        let [through, mirrored] = slab.straight(i);
        let parts = slab.parts(i).unwrap();
        let absorbed = DVec3::from_array(parts.map(|parts| parts.absorbed));
        let after_bounces = DVec3::from_array(parts.map(|parts| parts.after_bounces));
        assert!((through + mirrored + absorbed - 1.0).abs().max_element() < 1e-12, "{degrees}: {absorbed}");
        assert!(absorbed.min_element() > -1e-12 && after_bounces.cmple(through).all(), "{degrees}: {after_bounces}");
    }
}

#[test]
fn light_on_a_smooth_top_over_a_rough_bottom_is_reflected_transmitted_or_absorbed_at_grazing_angles() {
    let source = SCENE
        .replace("[slab.top]\nkind = \"tile\"", "[slab.top]\nkind = \"smooth\"")
        .replace("kind = \"ggx\"\nroughness = 0.2", "kind = \"beckmann\"\nroughness = 0.1");
    let slab = Pipeline::new().slab(&loaded(&source.replace("draft", "standard"))).unwrap().slab;
    for degrees in [60.0, 86.0, 88.0, 89.0, 89.5, 89.9_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let i = DVec3::new(sin, 0.0, cos);
        let [straight, mirrored] = slab.straight(i);
        let through = DiscLobe::transmitted(&slab, i, 96).total() + straight;
        let back = DiscLobe::reflected(&slab, i, 96).total() + mirrored;
        let absorbed = slab.parts(i).unwrap()[0].absorbed;
        println!("{degrees}: T {:.4} R {:.4} A {absorbed:.4}", through.x, back.x);
        assert!((through.x + back.x + absorbed - 1.0).abs() < 0.02, "{degrees}: {} {} {absorbed}", through.x, back.x);
    }
}
