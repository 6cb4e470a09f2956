//! Heights that are seen and lit, measured on facets: moments of their ranks, weighted with visibility, cosines and
//! the BRDF.

use std::sync::Arc;

use crate::color_map::{Normal, Quantiles, normal};

/// The heights of facets as normal values, by their rank over the projected area.
#[derive(Debug, Clone)]
pub struct RankedHeights {
    ranks: Vec<f32>,
    /// Heights [deviations] by their quantile.
    pub quantiles: Arc<Quantiles>,
}

impl RankedHeights {
    /// Ranks heights [deviations] with the projected areas of their facets.
    pub fn new(heights: &[f32], areas: &[f32]) -> Self {
        let mut order: Vec<u32> = (0..heights.len() as u32).collect();
        order.sort_unstable_by(|a, b| heights[*a as usize].total_cmp(&heights[*b as usize]));
        let total: f64 = areas.iter().map(|area| f64::from(*area)).sum();
        let mut ranks = vec![0.0; heights.len()];
        let (mut below, mut start) = (0.0, 0);
        while total > 0.0 && start < order.len() {
            let value = heights[order[start] as usize];
            let run = order[start..].iter().take_while(|k| heights[**k as usize] == value).count().max(1);
            let mass: f64 = order[start..start + run].iter().map(|k| f64::from(areas[*k as usize])).sum();
            let rank = normal::quantile(((below + 0.5 * mass) / total).clamp(1e-12, 1.0 - 1e-12)) as f32;
            order[start..start + run].iter().for_each(|k| ranks[*k as usize] = rank);
            below += mass;
            start += run;
        }
        let weighted = heights.iter().copied().zip(areas.iter().copied()).collect();
        Self { ranks, quantiles: Arc::new(Quantiles::new(weighted)) }
    }

    /// Mean and deviation of the ranks with these weights; `None` without weight.
    pub fn moments(&self, weights: impl Iterator<Item = f64>) -> Option<Normal> {
        let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
        for (rank, weight) in self.ranks.iter().zip(weights) {
            let rank = f64::from(*rank);
            mass += weight;
            first += weight * rank;
            second += weight * rank * rank;
        }
        let mean = first / mass;
        (mass > 0.0 && mass.is_finite())
            .then(|| Normal { mean, deviation: (second / mass - mean * mean).max(0.0).sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color_map::filter::HeightsSeen;
    use crate::color_map::stops::tests::{MAPS, map};

    #[test]
    fn ranked_heights_of_any_distribution_have_the_mean_colour_of_their_facets() {
        let heights: Vec<f32> = (0..4000).map(|k| (k as f32 / 900.0).exp() - 2.0).collect();
        let areas: Vec<f32> = (0..4000).map(|k| 1.0 + (k % 7) as f32).collect();
        let ranked = RankedHeights::new(&heights, &areas);
        let at = ranked.moments(areas.iter().map(|area| f64::from(*area))).unwrap();
        assert!(at.mean.abs() < 1e-3 && (at.deviation - 1.0).abs() < 0.01, "{at:?}");
        let seen = HeightsSeen::Ranked(at, ranked.quantiles.clone());
        for name in MAPS {
            let total: f64 = areas.iter().map(|area| f64::from(*area)).sum();
            let mean: glam::DVec3 = heights
                .iter()
                .zip(&areas)
                .map(|(h, a)| map(name).color(f64::from(*h)) * f64::from(*a))
                .sum::<glam::DVec3>()
                / total;
            assert!((seen.mean(&map(name)) - mean).abs().max_element() < 0.005, "{name}");
        }
        assert!(ranked.moments(std::iter::repeat_n(0.0, 4000)).is_none());
        assert!(RankedHeights::new(&[], &[]).moments(std::iter::empty()).is_none());
    }
}
