//! True and stated errors at `standard` of low-rank factors that a scene asks for, beside those of the direct sum.

use biscale::metrics::{Errors, Pair, compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene::LoadedScene;
use glam::Vec3;

use crate::tiles;

const BRDFS: [&str; 3] = ["cook-torrance 0.2", "ward 0.3", "blinn-phong 50"];
const PAIRS: usize = 400;
/// Largest factor between the true and the stated error.
const MAX_FACTOR: f64 = 3.0;

fn geometries() -> [(&'static str, String); 4] {
    let heights = |height: &dyn Fn(f32, f32) -> f32| {
        let at = |k: usize| (k as f32 + 0.5) / 32.0;
        let row = |y: usize| {
            let row: Vec<String> = (0..32).map(|x| format!("{:.5}", height(at(x), at(y)))).collect();
            format!("[{}]", row.join(","))
        };
        let rows: Vec<String> = (0..32).map(row).collect();
        format!("{{ kind = \"heightfield\", values = [{}] }}", rows.join(","))
    };
    let wave = |x: f32| (std::f32::consts::TAU * x).sin();
    [
        ("egg-crate", heights(&|x, y| 0.08 * (wave(2.0 * x) + wave(2.0 * y)))),
        ("V-grooves", r#"{ kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 35 }"#.to_owned()),
        ("terraces", heights(&|x, _| 0.25 * (4.0 * x).floor() / 4.0)),
        (
            "leaning posts",
            r#"{ kind = "rods", count = 23, radius = 0.05, length = 0.24, lean_deg = 37, lean_azimuth_deg = 70, seed = 5 }"#
                .to_owned(),
        ),
    ]
}

/// Prints the errors.
///
/// # Errors
/// A result whose error exceeds what `standard` allows is not warned of, or states an error that is off by more than
/// [`MAX_FACTOR`].
pub fn factored(print: &mut dyn FnMut(String)) -> Result<(), String> {
    print("| tile | BRDF | direct sum: true | factors: true | stated | warned | true values |".to_owned());
    print("|---|---|---|---|---|---|---|".to_owned());
    let pairs = mirror_biased_pairs(PAIRS, 20_110_801);
    let mut misses = Vec::new();
    for (tile, geometry) in geometries() {
        for (name, brdf) in tiles::BRDFS.iter().filter(|(name, _)| BRDFS.contains(name)) {
            let loaded = tiles::open(&geometry, brdf, "standard");
            let (truth, std_error) = true_values(&loaded, &pairs);
            let of = |method: &str| {
                let mut loaded = loaded.clone();
                loaded.scene.quality.method = Some(method.to_owned());
                let outcome = Pipeline::new().effective(&loaded).unwrap();
                let found = compare(&tiles::evaluate(&outcome.brdf, &pairs), &truth);
                (without_noise(found, std_error), outcome)
            };
            let ((direct, _), (factors, outcome)) = (of("direct"), of("low_rank"));
            let stated = outcome.errors().unwrap().estimate();
            let warned = outcome.health().warnings.iter().any(|warning| warning.contains("the stated error is"));
            let factor = (factors.rel_l2 / stated.rel_l2).max(stated.rel_l2 / factors.rel_l2);
            let exceeds = factors.rel_l2 > 0.1 || factors.psnr_db < 35.0;
            if exceeds && (!warned || factor > MAX_FACTOR) {
                misses.push(format!("{tile}, {name}"));
            }
            print(format!(
                "| {tile} | {name} | {} | {} | {} | {} | ± {:.2} % |",
                percent_db(direct.rel_l2, Some(direct.psnr_db)),
                percent_db(factors.rel_l2, Some(factors.psnr_db)),
                percent_db(stated.rel_l2, stated.psnr_db),
                if warned { "yes" } else { "no" },
                100.0 * std_error
            ));
        }
    }
    if misses.is_empty() { Ok(()) } else { Err(format!("silent or wrongly stated: {}", misses.join("; "))) }
}

fn true_values(loaded: &LoadedScene, pairs: &[Pair]) -> (Vec<Vec3>, f64) {
    let settings = ReferenceSettings { facets: 16_384, max_passes: 16, target: 2e-3, seed: 4711 };
    let mut std_error = 0.0;
    let estimates = Pipeline::new().with_reference(loaded, |reference| {
        reference.estimate_few_pairs(pairs, &settings, |_, error| {
            std_error = error;
            true
        })
    });
    (estimates.unwrap().iter().map(|estimate| estimate.f_bar).collect(), std_error)
}

/// The errors without the standard error of the true values, which is subtracted in squares.
fn without_noise(found: Errors, std_error: f64) -> Errors {
    let least = (std_error / 3.0).powi(2);
    let rel_l2 = (found.rel_l2.powi(2) - std_error.powi(2)).max(least).sqrt().min(found.rel_l2);
    Errors { rel_l2, psnr_db: found.psnr_db + 20.0 * (found.rel_l2 / rel_l2).log10() }
}

fn percent_db(rel_l2: f64, psnr_db: Option<f64>) -> String {
    format!("{:.2} %, {:.1} dB", 100.0 * rel_l2, psnr_db.unwrap_or(f64::INFINITY))
}
