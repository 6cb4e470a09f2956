//! Ray-cast values of `f̄`, for tests and measurements.

use biscale::metrics::Pair;
use biscale::pipeline::Pipeline;
use biscale::reference::ReferenceSettings;
use biscale::scene::LoadedScene;
use glam::Vec3;

/// Returns the reference at the pairs, and the relative L2 of its standard errors.
pub fn reference(
    pipeline: &Pipeline,
    scene: &LoadedScene,
    pairs: &[Pair],
    settings: &ReferenceSettings,
) -> (Vec<Vec3>, f64) {
    let mut std_error = 0.0;
    let estimates = pipeline
        .with_reference(scene, |reference| {
            reference.estimate(pairs, settings, |_, error| {
                std_error = error;
                true
            })
        })
        .unwrap();
    (estimates.iter().map(|estimate| estimate.f_bar).collect(), std_error)
}
