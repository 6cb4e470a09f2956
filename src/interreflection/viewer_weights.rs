//! Weights of the nodes of a table in sums over its computed part.

use super::mirrored::{MOST_IMAGES, MirroredNodes};
use super::table::NodeWeights;
use crate::math::directions::ReducedGrid;

/// The weights of [`NodeWeights`], for all nodes and for the computed ones, which stand for their mirror images.
pub(super) struct ViewerWeights {
    /// For each reflection, `viewers` at the images of the computed nodes, and zero at all others. Computed nodes near the
    /// horizon, which have no weight, have the last one here: their light counts, too.
    pub of_images: [Vec<f32>; MOST_IMAGES],
    pub viewers: Vec<f32>,
    pub lights: Vec<f32>,
    pub all_viewers: Vec<f32>,
    pub all_lights: Vec<f32>,
}

impl ViewerWeights {
    pub fn new(grid: ReducedGrid, mirrored: &MirroredNodes) -> Self {
        let NodeWeights { lights, viewers } = NodeWeights::new(grid);
        let images = mirrored.image_counts();
        let of_computed = |weights: &[f64]| -> Vec<f32> {
            mirrored.computed.iter().zip(&images).map(|(node, images)| weights[*node] as f32 * images).collect()
        };
        let of_all = |weights: &[f64]| weights.iter().map(|weight| *weight as f32).collect();
        let of_computed_viewers = of_computed(&viewers);
        let last = of_computed_viewers.iter().copied().rfind(|weight| *weight > 0.0).unwrap_or(1.0);
        let of_image = |reflection: usize| {
            let mut all = vec![0.0; grid.len()];
            if let Some(image) = mirrored.images.get(reflection) {
                for (node, weight) in mirrored.computed.iter().zip(&of_computed_viewers) {
                    all[image[*node]] = if *weight > 0.0 { *weight } else { last };
                }
            }
            all
        };
        Self {
            of_images: std::array::from_fn(of_image),
            viewers: of_computed_viewers,
            lights: of_computed(&lights),
            all_viewers: of_all(&viewers),
            all_lights: of_all(&lights),
        }
    }
}
