//! Errors and times of the presets on tiles to which no default is tuned.

use std::path::PathBuf;
use std::time::Instant;

use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::plan::{Preset, Settings};
use biscale::reference::ReferenceSettings;

use crate::reference::reference;
use crate::tiles::{BRDFS, evaluate, merl_spec, open, untuned};

/// Presets with the least PSNR [dB] and the largest relative L2 that they must reach.
const BOUNDS: [(&str, f64, f64); 5] = [
    ("draft", 0.0, 1.0),
    ("standard", 35.0, 0.10),
    ("fine", 43.0, 0.04),
    ("reference", 50.0, 0.01),
    ("wu2011", 0.0, 10.0),
];

/// Prints the errors and times of the presets in a list, or of all. `BISCALE_MERL` names a folder with
/// `silver-paint.binary`.
///
/// # Errors
/// The bench fails if a preset misses its bounds.
pub fn accuracy(presets: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    let pairs = mirror_biased_pairs(500, 77);
    let mut brdfs: Vec<(String, String)> =
        BRDFS.iter().map(|&(name, spec)| (name.to_owned(), spec.to_owned())).collect();
    if let Some(folder) = std::env::var_os("BISCALE_MERL") {
        brdfs.push(("silver-paint".to_owned(), merl_spec(&PathBuf::from(folder).join("silver-paint.binary"))));
    }
    let settings = ReferenceSettings { facets: 16_384, max_passes: 12, target: 4e-3, seed: 99 };
    print(format!("{:<16} {:<18} {:>9} {:>8} {:>8} {:>9}  form", "tile", "brdf", "preset", "dB", "%", "ms"));
    let mut missed = Vec::new();
    for (tile, geometry) in untuned() {
        for (name, brdf) in &brdfs {
            let scene = open(&geometry, brdf, "standard");
            let (exact, std_error) = reference(&Pipeline::new(), &scene, &pairs, &settings);
            for (preset, psnr_db, rel_l2) in BOUNDS {
                if presets.is_some_and(|list| !list.split(',').any(|name| name == preset)) {
                    continue;
                }
                let scene = open(&geometry, brdf, preset);
                let pipeline = Pipeline::new();
                let start = Instant::now();
                let (values, representation) = if preset == "reference" {
                    // The settings of `biscale eval`, with another seed than that of the reference above.
                    let preset = Settings::of_preset(Preset::Reference);
                    let as_eval = ReferenceSettings {
                        facets: preset.reference_facets,
                        max_passes: preset.reference_passes,
                        target: preset.reference_target,
                        seed: preset.seed,
                    };
                    (reference(&pipeline, &scene, &pairs, &as_eval).0, "reference".to_owned())
                } else {
                    let outcome = pipeline.effective(&scene).unwrap();
                    (evaluate(&outcome.brdf, &pairs), outcome.brdf.representation.describe())
                };
                let ms = start.elapsed().as_secs_f64() * 1e3;
                let errors = compare(&values, &exact);
                print(format!(
                    "{tile:<16} {name:<18} {preset:>9} {:>8.1} {:>8.2} {ms:>9.0}  {representation}",
                    errors.psnr_db,
                    errors.rel_l2 * 100.0
                ));
                // The standard error of the reference is subtracted in squares.
                let without = (errors.rel_l2.powi(2) - std_error.powi(2)).max(0.0).sqrt();
                let without_db = errors.psnr_db + 20.0 * (errors.rel_l2 / without.max(1e-12)).log10();
                if without_db < psnr_db || without > rel_l2 {
                    missed.push(format!("{tile}, {name}, {preset}: {errors:?}"));
                }
            }
            print(format!("{tile:<16} {name:<18} standard error of the reference: {:.2} %", std_error * 100.0));
        }
    }
    if missed.is_empty() { Ok(()) } else { Err(format!("bounds are missed:\n{}", missed.join("\n"))) }
}
