//! Convergence with more facets, and equal bits with any number of threads.

use biscale::metrics::{Pair, compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};
use glam::Vec3;

fn open(geometry: &str, brdf: &str, quality: &str) -> LoadedScene {
    let text = format!(
        "[tile]\ngeometry = {geometry}\n[[material]]\nname = \"default\"\nbrdf = {brdf}\n[quality]\nbackend = \
         \"cpu\"\n{quality}\n[effects]\ninterreflection = \"off\"\n"
    );
    LoadedScene {
        scene: scene::parse(&text).unwrap(),
        base_dir: "".into(),
        name: String::new(),
        painted: Painted::default(),
    }
}

const GLOSSY: &str = r#"{ kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }"#;
const BUMPS: &str = r#"{ kind = "heightfield", values = [[0, 0.3, 0.1, 0.2], [0.5, 0.9, 0.4, 0.1], [0.2, 0.6, 1.0, 0.3], [0, 0.1, 0.5, 0.2]], height_scale = 0.2 }"#;

fn values(loaded: &LoadedScene, pairs: &[Pair]) -> Vec<Vec3> {
    let brdf = Pipeline::new().effective(loaded).unwrap().brdf;
    pairs.iter().map(|p| brdf.eval(p.i, p.o)).collect()
}

#[test]
fn more_facets_converge_to_the_reference_at_least_as_fast_as_random_sampling() {
    let pairs = mirror_biased_pairs(100, 31);
    let settings = ReferenceSettings { facets: 8192, max_passes: 6, target: 0.0, seed: 9 };
    let rods = r#"{ kind = "rods", count = 9, radius = 0.08, length = 0.2 }"#;
    for (name, geometry) in [("bumps", BUMPS), ("rods", rods)] {
        let exact = Pipeline::new()
            .with_reference(&open(geometry, GLOSSY, ""), |reference| reference.estimate(&pairs, &settings, |_, _| true))
            .unwrap();
        let exact: Vec<Vec3> = exact.iter().map(|estimate| estimate.f_bar).collect();
        // Many azimuths and a narrow penumbra keep the error of the maps below that of the facets.
        let error = |facets: usize| {
            let quality = format!("facets = {facets}\nazimuths = 96\npenumbra_deg = 0.3\nmethod = \"direct\"");
            compare(&values(&open(geometry, GLOSSY, &quality), &pairs), &exact).rel_l2
        };
        let errors = [128, 512, 2048, 8192].map(error);
        eprintln!("{name}: {errors:?}");
        // Random samples halve the error at each step. A systematic sample does better until the error of the horizons
        // dominates.
        let order = (errors[0] / errors[2]).ln() / 16.0_f64.ln();
        assert!(order > 0.45, "{name}: order {order:.2} of {errors:?}");
        assert!(errors[3] < 0.03 && errors[3] < errors[1], "{name}: {errors:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let pairs = mirror_biased_pairs(40, 3);
    let rods = r#"{ kind = "rods", count = 9, radius = 0.08, length = 0.2 }"#;
    let lambertian = r#"{ kind = "lambertian", albedo = 0.5 }"#;
    for (geometry, brdf, quality) in [
        (BUMPS, GLOSSY, "preset = \"draft\"\nmethod = \"direct\""),
        (rods, GLOSSY, "preset = \"draft\"\nmethod = \"direct\""),
        (BUMPS, GLOSSY, "preset = \"draft\"\nmethod = \"low_rank\""),
        (rods, GLOSSY, "preset = \"draft\"\nmethod = \"low_rank\""),
        (rods, lambertian, "preset = \"wu2011\"\nfacets = 500"),
    ] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| values(&open(geometry, brdf, quality), &pairs))
        };
        let one = on(1);
        assert!(one.iter().any(|value| value.max_element() > 0.0));
        for threads in [2, 5] {
            assert_eq!(one, on(threads), "{geometry} {quality}: {threads} threads");
        }
    }
    let reference = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = ReferenceSettings { facets: 256, max_passes: 4, target: 0.0, seed: 2 };
        pool.install(|| {
            Pipeline::new()
                .with_reference(&open(rods, GLOSSY, ""), |r| r.estimate(&pairs, &settings, |_, _| true))
                .unwrap()
        })
    };
    assert_eq!(reference(1), reference(3));
}
