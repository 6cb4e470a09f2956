//! Facets as in the paper: random points, with areas from nearest centres (Wu et al. 2011, Sec. 3.2).

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::fold;
use super::kd_tree::KdTree;
use crate::geometry::{FacetSampler, Facets, SampleShift, TileMesh};

/// Number of voting points per facet.
const VOTES_PER_FACET: usize = 64;

impl Facets {
    /// Takes `count` facets at random points, with triangles chosen by area. Each facet represents the part of the
    /// surface nearest to its centre, estimated with [`VOTES_PER_FACET`] points and a kd-tree. Areas sum to the tile's
    /// surface area.
    pub fn sample_wu2011(mesh: &TileMesh, count: usize, seed: u64) -> Self {
        let sampler = FacetSampler::new(mesh);
        let mut facets = sampler.sample(mesh, 0, SampleShift::default());
        if sampler.area() <= 0.0 || count == 0 {
            return facets;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for _ in 0..count {
            let (along, at) = (random.random(), fold(Vec2::new(random.random(), random.random())));
            let (triangle, barycentric) = sampler.point_at(along, at);
            facets.push(mesh, triangle, barycentric, 0.0);
        }
        let voters = sampler.sample(mesh, count * VOTES_PER_FACET, SampleShift::from_seed(seed.wrapping_add(1)));
        let tree = KdTree::new(&facets.positions, mesh.size);
        let nearest: Vec<Option<u32>> = voters.positions.par_iter().map(|position| tree.nearest(*position)).collect();
        let mut votes = vec![0u32; count];
        nearest.into_iter().flatten().for_each(|facet| votes[facet as usize] += 1);
        let area = sampler.area() / (count * VOTES_PER_FACET) as f64;
        facets.areas = votes.into_iter().map(|votes| (f64::from(votes) * area) as f32).collect();
        facets
    }
}
