//! Low-rank factors against the direct sum. `cargo bench --bench measure -- interpolation` prints the error of each
//! interpolation alone.

use std::sync::Arc;

use biscale::brdf::{Brdf, Material, Term};
use biscale::effective::{BasisGrid, Direct, EffectiveBrdf, FacetSum, LowRank, LowRankSettings, Representation};
use biscale::math::directions::{HalfDifferenceGrid, PolarGrid};
use biscale::metrics::{compare, mirror_biased_pairs};
use glam::Vec3;
use rayon::prelude::*;

use crate::tiles::{mesh, sample};

fn settings(
    directions: PolarGrid,
    pairs: HalfDifferenceGrid,
    normal_rings: usize,
    keep: f64,
    max_rank: usize,
    whole_sphere: bool,
) -> LowRankSettings {
    let basis = BasisGrid { pairs, normal_rings, whole_sphere, interpolation: Default::default() };
    LowRankSettings {
        directions,
        basis,
        keep_m: keep,
        keep_n: keep,
        max_rank,
        colors: None,
        keep_color: 0.999,
        seed: 1,
    }
}

const PYRAMIDS: &str = r#"{ kind = "pyramids" }"#;

#[test]
fn low_rank_factors_approach_the_direct_sum_as_grids_and_ranks_grow() {
    let mesh = mesh(PYRAMIDS);
    let (facets, visibility) = sample(&mesh, 600);
    let slots = vec![0; mesh.slots.len()];
    let base_area = f64::from(mesh.base_area());
    let pairs = mirror_biased_pairs(200, 4);
    let visibility = Arc::new(visibility);
    for (term, bound) in
        [(Term::Lambertian { albedo: Vec3::ONE }, 0.03), (Term::CookTorrance { roughness: 0.4, f0: Vec3::ONE }, 0.06)]
    {
        let material = Material { brdf: Brdf { terms: vec![term.clone()] }, color: Vec3::new(1.0, 0.5, 0.2) };
        let sum = FacetSum::new(&facets, &slots, std::slice::from_ref(&material));
        let values = |representation| -> Vec<Vec3> {
            let brdf = EffectiveBrdf { representation, base_area };
            pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
        };
        let direct = values(Representation::Direct(Direct::new(Arc::new(sum), visibility.clone())));
        let error = |directions, pair_grid, keep, rank| {
            let settings = settings(directions, pair_grid, 48, keep, rank, !mesh.is_height_field());
            let factors =
                LowRank::build(&facets, &visibility, &slots, std::slice::from_ref(&material), &settings).unwrap();
            compare(&values(Representation::LowRank(factors)), &direct).rel_l2
        };
        let coarse =
            error(PolarGrid::new(6, 12), HalfDifferenceGrid { rings: 12, azimuths: 24, theta_d: 6, phi_d: 4 }, 0.99, 8);
        let middle = error(
            PolarGrid::new(12, 24),
            HalfDifferenceGrid { rings: 24, azimuths: 48, theta_d: 12, phi_d: 8 },
            0.999,
            24,
        );
        let fine = error(
            PolarGrid::new(20, 48),
            HalfDifferenceGrid { rings: 32, azimuths: 64, theta_d: 16, phi_d: 12 },
            0.9999,
            48,
        );
        eprintln!("{term:?}: {coarse:.4} {middle:.4} {fine:.4}");
        assert!(coarse > middle && middle > fine && fine < bound, "{term:?}: {coarse} {middle} {fine}");
    }
}
