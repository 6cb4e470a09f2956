//! Errors of low-rank factors that interpolation alone causes, for each of the two factors.

use biscale::brdf::{LobeAngles, Term};
use biscale::effective::VisibilityRows;
use biscale::geometry::Facets;
use biscale::math::directions::{HalfDifferenceGrid, PolarGrid, half_vector};
use biscale::metrics::{Pair, compare, mirror_biased_pairs};
use biscale::visibility::Visibility;
use glam::Vec3;
use rayon::prelude::*;

use crate::tiles::{mesh, sample};

const PYRAMIDS: &str = r#"{ kind = "pyramids" }"#;
const V_GROOVES: &str = r#"{ kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 35 }"#;
const RODS: &str = r#"{ kind = "rods" }"#;

/// Returns f̄ for given visibilities and lobes: `Σ w v_i v_o f / Σ w v (n·o)+`.
fn sum(facets: &Facets, v_i: &[f32], v_o: &[f32], area_o: &[f32], o: Vec3, lobe: impl Fn(Vec3) -> f32) -> Vec3 {
    let (mut total, mut area) = (0.0_f64, 0.0_f64);
    for s in 0..facets.len() {
        let (n, w) = (facets.normals[s], facets.areas[s]);
        area += f64::from(w * area_o[s] * n.dot(o).max(0.0));
        if v_i[s] * v_o[s] > 0.0 {
            total += f64::from(w * v_i[s] * v_o[s] * lobe(n));
        }
    }
    Vec3::splat((total / area) as f32)
}

fn lobe(term: &Term, n: Vec3, i: Vec3, o: Vec3) -> f32 {
    let angles = LobeAngles::new(n, i, o, half_vector(i, o));
    if angles.above() { term.lobe_cos(&angles) } else { 0.0 }
}

fn row(visibility: &Visibility, direction: Vec3) -> Vec<f32> {
    let mut row = vec![0.0; visibility.facets()];
    visibility.fill(direction, 0..visibility.facets(), &mut row);
    row
}

/// Returns f̄ with the visibility of each facet interpolated at `i` and at `o`, which is U without truncation.
fn with_interpolated_u(
    facets: &Facets,
    visibility: &Visibility,
    term: &Term,
    pairs: &[Pair],
    grid: PolarGrid,
) -> Vec<Vec3> {
    let table = VisibilityRows::new(visibility, 0..facets.len(), grid);
    let at = |direction: Vec3| -> Vec<f32> {
        let taps = grid.taps(direction);
        (0..facets.len()).map(|s| taps.iter().map(|&(node, w)| w * table.rows[node * facets.len() + s]).sum()).collect()
    };
    let one = |p: &Pair| sum(facets, &at(p.i), &at(p.o), &row(visibility, p.o), p.o, |n| lobe(term, n, p.i, p.o));
    pairs.par_iter().map(one).collect()
}

/// Returns f̄ with the lobe of each normal interpolated on the (h, d) grid, which is P without truncation.
fn with_interpolated_p(
    facets: &Facets,
    visibility: &Visibility,
    term: &Term,
    pairs: &[Pair],
    grid: HalfDifferenceGrid,
) -> Vec<Vec3> {
    let node_pair = |node: usize| {
        let (phi_d, rest) = (node % grid.phi_d, node / grid.phi_d);
        let (theta_d, rest) = (rest % grid.theta_d, rest / grid.theta_d);
        let (azimuth, ring) = (rest % grid.azimuths, rest / grid.azimuths);
        HalfDifferenceGrid::pair(grid.theta_h(ring), grid.phi_h(azimuth), grid.theta_d(theta_d), grid.phi_d(phi_d))
    };
    let one = |p: &Pair| {
        let nodes: Vec<(f32, (Vec3, Vec3))> =
            grid.taps(p.i, p.o).iter().map(|&(node, w)| (w, node_pair(node))).collect();
        let visible = row(visibility, p.o);
        sum(facets, &row(visibility, p.i), &visible, &visible, p.o, |n| {
            nodes.iter().map(|&(w, (i, o))| w * lobe(term, n, i, o)).sum()
        })
    };
    pairs.par_iter().map(one).collect()
}

/// Prints the error of each interpolation while the other factor is exact.
pub fn interpolation(print: &mut dyn FnMut(String)) {
    let pairs = mirror_biased_pairs(200, 7);
    for (name, geometry) in [("v-grooves", V_GROOVES), ("pyramids", PYRAMIDS), ("rods", RODS)] {
        let mesh = mesh(geometry);
        let (facets, visibility) = sample(&mesh, 1024);
        for roughness in [0.2, 0.5] {
            let term = Term::CookTorrance { roughness, f0: Vec3::ONE };
            let exact: Vec<Vec3> = pairs
                .par_iter()
                .map(|p| {
                    let visible = row(&visibility, p.o);
                    sum(&facets, &row(&visibility, p.i), &visible, &visible, p.o, |n| lobe(&term, n, p.i, p.o))
                })
                .collect();
            let percent = |values: Vec<Vec3>| compare(&values, &exact).rel_l2 * 100.0;
            for (rings, azimuths) in [(12, 24), (16, 36), (24, 48), (32, 64)] {
                let error =
                    percent(with_interpolated_u(&facets, &visibility, &term, &pairs, PolarGrid::new(rings, azimuths)));
                print(format!("{name:<10} cook-torrance {roughness}  U {rings}x{azimuths}: {error:.2} %"));
            }
            for [rings, azimuths, theta_d, phi_d] in
                [[32, 64, 16, 8], [48, 96, 20, 10], [32, 64, 16, 16], [48, 96, 16, 16], [32, 64, 32, 20]]
            {
                let grid = HalfDifferenceGrid { rings, azimuths, theta_d, phi_d };
                let error = percent(with_interpolated_p(&facets, &visibility, &term, &pairs, grid));
                print(format!(
                    "{name:<10} cook-torrance {roughness}  P {rings}x{azimuths}x{theta_d}x{phi_d}: {error:.2} %"
                ));
            }
        }
    }
}
