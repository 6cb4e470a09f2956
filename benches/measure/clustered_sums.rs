//! Errors of sums over few facets, on tiles with few distinct normals. A test includes this file.

use biscale::effective::EffectiveBrdf;
use biscale::metrics::{image_pairs, upper_errors};
use biscale::pipeline::Pipeline;
use biscale::scene;
use glam::Vec3;

/// Prints the error of the facets that a GPU sums over, for every shipped tile whose facets it reduces.
///
/// # Errors
/// The bench fails if an error reaches 6 %, as when the facets of neighbouring grooves coincide, or if fewer than 24 rows are printed.
pub fn few_facets(print: &mut dyn FnMut(String)) -> Result<(), String> {
    let pairs = image_pairs(512, 12345);
    let values = |brdf: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).collect() };
    print("scene                  preset    facets        rel. L2   PSNR".to_owned());
    let (mut rows, mut worst) = (0, 0.0_f64);
    for scene in scene::shipped::opaque_names() {
        for preset in ["draft", "standard", "fine"] {
            let overrides = ["quality.backend=cpu".to_owned(), format!("quality.preset={preset}")];
            let open = |facets: Option<usize>| {
                let facets = facets.map(|facets| format!("quality.facets={facets}"));
                scene::open(scene, &overrides.iter().cloned().chain(facets).collect::<Vec<_>>()).unwrap()
            };
            let Some(tile) = Pipeline::new().gpu_tile(&open(None)).unwrap() else { break };
            if tile.input.nodes.is_some() {
                break;
            }
            let exact = Pipeline::new().effective(&open(None)).unwrap();
            let reduced = Pipeline::new().effective(&open(Some(tile.settings.facets))).unwrap();
            let errors = upper_errors(&values(&reduced.brdf), &values(&exact.brdf));
            let (percent, db) = (100.0 * errors.rel_l2, errors.psnr_db);
            let (count, all) = (tile.input.sum.facet_count(), exact.settings.facets);
            if count == all {
                break;
            }
            print(format!("{scene:<22} {preset:<9} {count:>4} of {all:>5} {percent:>6.2} % {db:>6.1} dB"));
            (rows, worst) = (rows + 1, worst.max(errors.rel_l2));
        }
    }
    if rows >= 24 && worst < 0.06 {
        Ok(())
    } else {
        Err(format!("found {rows} rows and an error of {worst}, expected at least 24 rows and errors below 0.06"))
    }
}
