use biscale::accuracy::{compare, mirror_biased_pairs};
use biscale::brdf::{LobeAngles, Term};
use biscale::directions::{HalfDifferenceGrid, PolarGrid, half_vector};
use biscale::geometry::{self, FacetSampler, SampleShift};
use biscale::scene;
use biscale::visibility::{Horizons, PeriodicGrid, SoftMaps, Visibility};
use glam::Vec3;
use rayon::prelude::*;

#[test]
#[ignore]
fn floors() {
    let tiles = [
        ("v-groove", r#"{ kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 35 }"#),
        ("pyramids", r#"{ kind = "pyramids" }"#),
        ("rods", r#"{ kind = "rods" }"#),
    ];
    for (name, g) in tiles {
        let scene = scene::parse(&format!("[tile]\ngeometry = {g}\n")).unwrap();
        let mesh = geometry::build(&scene.tile, std::path::Path::new(".")).unwrap();
        let mut facets = FacetSampler::new(&mesh).sample(&mesh, 1024, SampleShift::from_seed(1));
        facets.sort_for_sums();
        let n = facets.len();
        let pg = PeriodicGrid::new(&mesh);
        let hf = mesh.is_height_field();
        let vis = if hf { Visibility::Horizons(Horizons::scan(&pg, &facets, 96, 0.01)) } else { Visibility::Maps(SoftMaps::scan(&pg, &facets, PolarGrid::new(64, 128))) };
        let exact = |d: Vec3| -> Vec<f32> { (0..n).map(|s| f32::from(biscale::visibility::sees(&pg, &facets, s, d))).collect() };
        let soft = |d: Vec3| -> Vec<f32> { let mut v = vec![0.0; n]; vis.fill(d, 0..n, &mut v); v };
        // raised to the facet's own plane where it faces away
        let lifted = |d: Vec3| -> Vec<f32> {
            (0..n).map(|s| {
                let nn = facets.normals[s];
                let c = nn.dot(d);
                let to = if c < 0.02 { (d + nn * (0.02 - c)).normalize() } else { d };
                f32::from(biscale::visibility::sees(&pg, &facets, s, to))
            }).collect()
        };
        let pairs = mirror_biased_pairs(200, 7);
        for m in [0.2_f32, 0.5] {
            let term = Term::CookTorrance { roughness: m, f0: Vec3::ONE };
            let f = |nn: Vec3, i: Vec3, o: Vec3| { let a = LobeAngles::new(nn, i, o, half_vector(i, o)); if a.n_dot_i > 0.0 && a.n_dot_o > 0.0 { term.lobe_cos(&a) } else { 0.0 } };
            let total = |vi: &[f32], vo: &[f32], va: &[f32], o: Vec3, f: &dyn Fn(usize) -> f32| -> Vec3 {
                let (mut g, mut a) = (0.0, 0.0);
                for s in 0..n {
                    let w = facets.areas[s];
                    a += w * va[s] * facets.normals[s].dot(o).max(0.0);
                    if vi[s] * vo[s] > 0.0 { g += w * vi[s] * vo[s] * f(s); }
                }
                Vec3::splat(g / a)
            };
            let reference: Vec<Vec3> = pairs.par_iter().map(|p| { let (vi, vo) = (exact(p.i), exact(p.o)); total(&vi, &vo, &vo, p.o, &|s| f(facets.normals[s], p.i, p.o)) }).collect();
            let direct: Vec<Vec3> = pairs.par_iter().map(|p| { let (vi, vo) = (soft(p.i), soft(p.o)); total(&vi, &vo, &vo, p.o, &|s| f(facets.normals[s], p.i, p.o)) }).collect();
            eprintln!("{name} m={m}: direct {:.2} %", compare(&direct, &reference).rel_l2 * 100.0);
            for (r, a) in [(16, 36), (24, 48)] {
              for p in [1.0_f32, 1.5, 2.0] {
                // rings x = (a+1/2)/r, last at 1 (89.9); theta = 90 (1-(1-x)^p)
                let warp = |x: f32| std::f32::consts::FRAC_PI_2 * (1.0 - (1.0 - x).powf(p));
                let unwarp = |t: f32| 1.0 - (1.0 - (t / std::f32::consts::FRAC_PI_2).min(1.0)).powf(1.0 / p);
                let grid = PolarGrid::new(r, a);
                let theta = |k: usize| warp((k as f32 + 0.5) / r as f32).min(PolarGrid::HORIZON_DEG.to_radians());
                let dir = |node: usize| { let k = node / a; biscale::directions::from_angles(if k >= r { PolarGrid::HORIZON_DEG.to_radians() } else { theta(k) }, grid.phi(node % a)) };
                let run = |rows: &[Vec<f32>]| {
                    let at = |d: Vec3| -> Vec<f32> { let mut v = vec![0.0; n];
                        let (t, phi) = biscale::directions::to_angles(d);
                        let d2 = biscale::directions::from_angles(unwarp(t) * std::f32::consts::FRAC_PI_2, phi);
                        for (node, w) in grid.taps(d2) { for (x, y) in v.iter_mut().zip(&rows[node]) { *x += w * y; } } v };
                    let values: Vec<Vec3> = pairs.par_iter().map(|p| { let (vi, vo) = (at(p.i), at(p.o)); let va = exact(p.o); total(&vi, &vo, &va, p.o, &|s| f(facets.normals[s], p.i, p.o)) }).collect();
                    compare(&values, &reference).rel_l2 * 100.0
                };
                let (s, l): (Vec<_>, Vec<_>) = (0..grid.len()).into_par_iter().map(|k| (soft(dir(k)), lifted(dir(k)))).unzip();
                eprintln!("   U {r}x{a} p={p}: soft {:.2} %, lifted {:.2} %", run(&s), run(&l));
              }
            }
            for (r, a, d, t) in [(32, 64, 16, 8), (32, 64, 16, 16), (40, 80, 12, 12), (32, 64, 12, 12), (48, 96, 20, 10), (48, 96, 16, 16)] {
              for p in [1.0_f32, 1.5, 2.0, 3.0] {
                use std::f32::consts::FRAC_PI_2;
                let grid = HalfDifferenceGrid { rings: r, azimuths: a, difference: d, turn: t };
                let values: Vec<Vec3> = pairs.par_iter().map(|q| {
                    let (vi, vo) = (exact(q.i), exact(q.o));
                    // difference angle warped: theta_d = 90 (1-(1-x)^p)
                    let h = half_vector(q.i, q.o);
                    let td = q.i.dot(h).clamp(-1.0, 1.0).acos();
                    let x = (1.0 - (1.0 - td / FRAC_PI_2).max(0.0).powf(1.0 / p)).clamp(0.0, 1.0) * (d - 1) as f32;
                    let low = (x as usize).min(d - 2);
                    let fx = x - low as f32;
                    // fold the theta_d taps of the plain grid into ours
                    let taps = grid.taps(q.i, q.o);
                    let mut nodes = Vec::new();
                    for &(node, w) in &taps {
                        let (turn, rest) = (node % t, node / t); let (diff, rest) = (rest % d, rest / d); let (az, ring) = (rest % a, rest / a);
                        let lows = taps[0].0 / t % d;
                        if diff != lows { continue; }
                        let other = taps.iter().find(|&&(m, _)| m != node && m % t == turn && m / t % d == diff + 1 && m / t / d == node / t / d).map_or(0.0, |x| x.1);
                        let w = w + other;
                        for (k, wk) in [(low, 1.0 - fx), (low + 1, fx)] {
                            let theta = FRAC_PI_2 * (1.0 - (1.0 - k as f32 / (d - 1) as f32).powf(p));
                            let (i, o) = HalfDifferenceGrid::pair(grid.theta_h(ring), grid.phi_h(az), theta, grid.phi_d(turn));
                            nodes.push((w * wk, i, o));
                        }
                    }
                    total(&vi, &vo, &vo, q.o, &|s| nodes.iter().map(|&(w, i, o)| w * f(facets.normals[s], i, o)).sum())
                }).collect();
                eprintln!("   P {r}x{a}x{d}x{t} p={p}: {:.2} %", compare(&values, &reference).rel_l2 * 100.0);
              }
            }
        }
    }
}
