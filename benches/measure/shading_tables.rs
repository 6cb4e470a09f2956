//! Errors and times of shading tables.

use std::time::Instant;

use biscale::base::Cancel;
use biscale::effective::{Direct, EffectiveBrdf, GpuVisibilityInput, Nodes, Representation, ShadingTable};
use biscale::math::directions::HemispherePairGrid;
use biscale::metrics::{Pair, image_pairs, upper_errors};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::scene;
use glam::Vec3;

fn values(brdf: &EffectiveBrdf, pairs: &[Pair]) -> Vec<Vec3> {
    pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
}

fn outcome(scene: &str, overrides: &[String]) -> Outcome {
    Pipeline::new().effective(&scene::open(scene, overrides).unwrap()).unwrap()
}

fn direct(outcome: &Outcome) -> &Direct {
    let Representation::Direct(direct) = outcome.brdf.direct_representation() else { panic!("not a direct sum") };
    direct
}

/// Returns f̄ with a shading table in place of the direct sum.
fn tabulated(outcome: &Outcome, direct: &Direct, nodes: Nodes<'_>) -> EffectiveBrdf {
    let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
    outcome.brdf.with_direct_representation(Representation::Table(table))
}

/// Prints the times of a trial, which computes only the nodes that its check reads, and of the whole table, and their
/// error.
pub fn trials(print: &mut dyn FnMut(String)) {
    let pairs = image_pairs(512, 12345);
    print("scene                facets      trial     whole   rel. L2   PSNR".to_owned());
    for scene in ["table4_pillow", "table4_skirt", "fig7a_shot_silk", "fig6a_velvet_spread"] {
        let outcome = outcome(scene, &["quality.backend=cpu".to_owned()]);
        let (direct, grid) = (direct(&outcome), outcome.settings.image_grids[0]);
        let exact = values(&outcome.brdf, &pairs);
        for facets in [None, Some(direct.sum.facet_count() / 5)] {
            let timed = |read_by| {
                let start = Instant::now();
                let brdf = tabulated(&outcome, direct, Nodes { facets, read_by, ..Nodes::all(grid) });
                let ms = start.elapsed().as_secs_f64() * 1e3;
                (values(&brdf, &pairs), ms)
            };
            let ((trial, trial_ms), (whole, whole_ms)) = (timed(Some(&pairs[..])), timed(None));
            assert_eq!(trial, whole, "{scene}: the trial and the whole table have different values");
            let errors = upper_errors(&whole, &exact);
            let (percent, db, count) = (100.0 * errors.rel_l2, errors.psnr_db, facets.map_or("all", |_| "a fifth"));
            print(format!(
                "{scene:<20} {count:<8} {trial_ms:>6.0} ms {whole_ms:>6.0} ms {percent:>6.2} % {db:>6.1} dB"
            ));
        }
    }
}

/// Prints the errors of tables from part of the facets, with the azimuths and the grids of the CPU and of the GPU.
pub fn steps(print: &mut dyn FnMut(String)) {
    let pairs = image_pairs(512, 12345);
    print("scene                preset    facets subset  azimuths  nodes  rel. L2   PSNR".to_owned());
    let height_fields = ["table4_plate", "fig8b_ripples", "fig8d_leather"];
    let overhangs = ["table4_pillow", "table4_skirt", "fig6a_velvet_spread"];
    for preset in ["standard", "fine"] {
        for scene in height_fields.into_iter().chain(overhangs) {
            // The GPU computes no tile whose facets send light to each other.
            let interreflection = "effects.interreflection=\"off\"".to_owned();
            let overrides = ["quality.backend=cpu".to_owned(), format!("quality.preset={preset}"), interreflection];
            let on_cpu = outcome(scene, &overrides);
            let tile = Pipeline::new().gpu_tile(&scene::open(scene, &overrides).unwrap()).unwrap().unwrap();
            let (gpu_azimuths, is_height_field) = match &tile.input.visibility_input {
                GpuVisibilityInput::Heights(heights) => (heights.azimuths, true),
                GpuVisibilityInput::OcclusionIntervals(sliced) => (sliced.azimuths, false),
                _ => panic!("{scene}: found another input of visibility"),
            };
            let as_on_gpu = outcome(scene, &[&overrides[..], &[format!("quality.azimuths={gpu_azimuths}")]].concat());
            let gpu_grid = (gpu_azimuths, tile.input.nodes.unwrap().grid);
            let settings = &on_cpu.settings;
            let cpu_azimuths = if is_height_field { settings.horizon_azimuths } else { settings.slice_azimuths };
            let cpu_grid = (cpu_azimuths, settings.image_grids[0]);
            let exact = values(&on_cpu.brdf, &pairs);
            let all = settings.facets;
            let mut cases = vec![(all, cpu_grid), (3000, cpu_grid), (1200, cpu_grid), (1600, gpu_grid)];
            cases.dedup();
            for (count, (azimuths, grid)) in cases {
                let outcome = if azimuths == gpu_azimuths { &as_on_gpu } else { &on_cpu };
                let facets = (count < all).then_some(count);
                let nodes = Nodes { facets, read_by: Some(&pairs[..]), ..Nodes::all(grid) };
                let errors = upper_errors(&values(&tabulated(&on_cpu, direct(outcome), nodes), &pairs), &exact);
                let (percent, db) = (100.0 * errors.rel_l2, errors.psnr_db);
                let nodes = grid.nodes();
                print(format!(
                    "{scene:<20} {preset:<9} {count:>5} of {all:>5} {azimuths:>7} {nodes:>7} {percent:>7.2} % {db:>6.1} dB"
                ));
            }
        }
    }
}

/// Prints the errors of tables from all facets on grids of different shapes.
pub fn grids(print: &mut dyn FnMut(String)) {
    let pairs = image_pairs(512, 12345);
    // Rings and azimuths of half vectors, φ_d and θ_d.
    let shapes =
        [[24, 48, 8, 12], [20, 40, 12, 12], [16, 32, 12, 12], [20, 40, 12, 10], [24, 48, 12, 16], [20, 40, 16, 16]];
    let name = |[rings, azimuths, phi_d, theta_d]: [usize; 4]| format!("{rings}x{azimuths}x{phi_d}x{theta_d}");
    print(format!("{:<20} {}", "scene", shapes.map(|shape| format!("{:>12}", name(shape))).join(" ")));
    for scene in
        ["table4_plate", "fig8b_ripples", "fig8d_leather", "table4_pillow", "table4_skirt", "fig6a_velvet_spread"]
    {
        let outcome = outcome(scene, &["quality.backend=cpu".to_owned()]);
        let exact = values(&outcome.brdf, &pairs);
        let errors = shapes.map(|[rings, azimuths, phi_d, theta_d]| {
            let nodes =
                Nodes { read_by: Some(&pairs), ..Nodes::all(HemispherePairGrid { rings, azimuths, phi_d, theta_d }) };
            let table = tabulated(&outcome, direct(&outcome), nodes);
            format!("{:>10.2} %", 100.0 * upper_errors(&values(&table, &pairs), &exact).rel_l2)
        });
        print(format!("{scene:<20} {}", errors.join(" ")));
    }
}
