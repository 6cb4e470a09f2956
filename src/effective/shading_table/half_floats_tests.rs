//! The error that half floats would add to a shading table.

use std::path::Path;

use glam::{Vec3, Vec4};

use crate::base::Cancel;
use crate::effective::{EffectiveBrdf, Nodes, Representation, ShadingTable};
use crate::math::directions::HemispherePairGrid;
use crate::metrics::{image_pairs, upper_errors};
use crate::pipeline::Pipeline;
use crate::scene;

/// A number rounded to a half float (IEEE 754 binary16), ties away from zero.
fn as_half(x: f32) -> f32 {
    let quantum =
        if x.abs() < 2.0_f32.powi(-14) { 2.0_f32.powi(-24) } else { 2.0_f32.powf(x.abs().log2().floor() - 10.0) };
    (x / quantum).round() * quantum
}

/// Rounds a table to half floats, with each column scaled to at most 1.
fn in_halves(table: &ShadingTable) -> ShadingTable {
    let mut values: Vec<Vec4> = table.values.to_vec();
    for vec4 in 0..table.vec4s {
        let highest = values.iter().skip(vec4).step_by(table.vec4s).fold(Vec4::ZERO, |high, v| high.max(v.abs()));
        for value in values.iter_mut().skip(vec4).step_by(table.vec4s) {
            for c in 0..4 {
                if highest[c] > 0.0 {
                    value[c] = as_half(value[c] / highest[c]) * highest[c];
                }
            }
        }
    }
    ShadingTable { values: values.into(), ..table.clone() }
}

#[test]
fn halves_are_those_of_ieee_754() {
    for (x, expected) in
        [(1.0, 1.0), (0.1, 0.099_975_586), (1e-7, 1.192_092_9e-7), (-0.333_333_34, -0.333_251_95), (0.0, 0.0)]
    {
        assert_eq!(as_half(x), expected);
    }
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- half-floats"]
fn half_floats_would_change_a_table_by_this() {
    let pairs = image_pairs(4096, 12345);
    let values = |of: &EffectiveBrdf| -> Vec<Vec3> { pairs.iter().map(|pair| of.eval(pair.i, pair.o)).collect() };
    let grid = HemispherePairGrid { rings: 24, azimuths: 48, phi_d: 8, theta_d: 12 };
    println!("scene            table against the sum    in halves                 halves against the table");
    for name in ["table4_plate", "table4_pillow", "table4_skirt", "fig6a_velvet_spread"] {
        let mut loaded = scene::open(name, &[]).unwrap();
        loaded.scene.quality.preset = "draft".to_owned();
        loaded.base_dir = Path::new(".").to_owned();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let Representation::Direct(direct) = outcome.brdf.direct_representation() else { panic!("{name}: not a sum") };
        let table = ShadingTable::build(direct, Nodes::all(grid), &Cancel::default()).unwrap().unwrap();
        let halves = values(&outcome.brdf.with_direct_representation(Representation::Table(in_halves(&table))));
        let (exact, whole) =
            (values(&outcome.brdf), values(&outcome.brdf.with_direct_representation(Representation::Table(table))));
        let errors_text = |a: &[Vec3], b: &[Vec3]| {
            let errors = upper_errors(a, b);
            format!("{:>7.3} % {:>5.1} dB", 100.0 * errors.rel_l2, errors.psnr_db)
        };
        println!(
            "{name:<20} {}    {}    {}",
            errors_text(&whole, &exact),
            errors_text(&halves, &exact),
            errors_text(&halves, &whole)
        );
    }
}
