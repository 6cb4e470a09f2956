//! The part of the reflected light that was reflected more than once, from few random walks.

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::WalkedTile;
use super::sampler::from_cosine;
use crate::base::{Cancel, Result};

/// Number of walks. The standard error is some tenths of a small share, and a tenth of a large one.
const WALKS: usize = 1024;
/// Walks per task.
const TASK: usize = 32;
/// Most facets of a walk.
const MAX_FACETS: usize = 64;
/// Weight below which a walk is continued at random.
const MIN_WEIGHT: f32 = 0.25;
/// Steps of the sequence R4 (Roberts 2018): where a walk enters the tile, and its direction.
const STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_030_403_4, 0.538_597_257_224_286_9];

/// The part of the reflected light, under uniform light and seen from all sides, that two facets or more reflected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BouncedShare {
    pub share: f64,
    /// Standard error of `share`. The walks begin at points of a low-discrepancy sequence, so it is an upper estimate.
    pub std_error: f64,
}

/// Traces walks that come from a uniform sky, and sums what leaves the tile after one reflection and after more.
///
/// # Errors
/// Returns [`crate::base::Error::Cancelled`] if `cancel` is set.
pub fn measure(tile: &WalkedTile<'_>, cancel: &Cancel) -> Result<BouncedShare> {
    tile.grid.prepare_rays();
    let bottom = tile.mesh.z_range().0;
    let walks = (0..WALKS).into_par_iter().with_min_len(TASK);
    let weights: Vec<[f64; 2]> = walks.map(|number| reflected(tile, bottom, number)).collect();
    cancel.check()?;
    Ok(BouncedShare::of(&weights))
}

impl BouncedShare {
    /// The share of the second of two weights, and its standard error by the delta method.
    fn of(weights: &[[f64; 2]]) -> Self {
        let count = weights.len() as f64;
        let [once, bounced] = [0, 1].map(|kind| weights.iter().map(|weight| weight[kind]).sum::<f64>() / count);
        let all = once + bounced;
        if all <= 0.0 {
            return Self { share: 0.0, std_error: 0.0 };
        }
        let share = bounced / all;
        let residuals = weights.iter().map(|[once, bounced]| (bounced - share * (once + bounced)).powi(2));
        Self { share, std_error: (residuals.sum::<f64>() / (count * (count - 1.0))).sqrt() / all }
    }
}

/// The weight with which a walk leaves the tile after one reflection, and after more.
fn reflected(tile: &WalkedTile<'_>, bottom: f32, number: usize) -> [f64; 2] {
    let [x, y, u, v] = STEPS.map(|step| (0.5 + number as f64 * step).fract() as f32);
    let mut random = ChaCha8Rng::seed_from_u64(number as u64);
    let start = (Vec2::new(x, y) * tile.mesh.size).extend(tile.grid.top());
    let mut direction = -from_cosine(Vec3::Z, u, v);
    let mut weight = Vec3::ONE;
    let mut hit = tile.grid.nearest(start, direction, bottom);
    for facet in 0..MAX_FACETS {
        let Some(at) = hit.and_then(|hit| tile.point(&hit, direction)) else { break };
        let Some((next, factor)) = tile.reflect(&at, -direction, &mut random) else { break };
        let leaving = weight * factor * at.color;
        weight = if facet == 0 { leaving } else { weight * factor * tile.color_between(&at) };
        let mean = weight.element_sum() / 3.0;
        let survival = (mean / MIN_WEIGHT).min(1.0);
        if random.random::<f32>() >= survival {
            break;
        }
        weight /= survival;
        direction = next;
        hit = tile.first_hit(&at, direction, bottom);
        if hit.is_none() && direction.z > 0.0 {
            let left = f64::from(leaving.element_sum() / 3.0 / survival);
            return if facet == 0 { [left, 0.0] } else { [0.0, left] };
        }
    }
    [0.0; 2]
}

#[cfg(test)]
#[path = "share_tests.rs"]
mod tests;
