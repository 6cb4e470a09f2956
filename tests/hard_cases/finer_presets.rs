//! Finer presets: a case of each family at `standard` and `fine`, and the paper's method at its full size.

use biscale::pipeline::Pipeline;

use crate::cases::{Case, brdfs, geometries};
use crate::evaluators::Evaluator;
use crate::examination::{Row, examine, measured, open, pairs};
use crate::invariants::{assert_none, violations};

/// Families and names of the cases.
const CHOSEN: [(&str, &str); 3] =
    [("geometry, glossy", "cliffs"), ("geometry, white", "overhang"), ("BRDFs", "Cook-Torrance 0.2")];

pub fn chosen() -> impl Iterator<Item = Case> {
    let all = [geometries(), brdfs()].concat();
    CHOSEN.map(|(family, name)| all.iter().find(|c| (c.family, c.name) == (family, name)).unwrap().clone()).into_iter()
}

/// Returns the rows of evaluators, by their names in the table.
fn rows(case: &Case, preset: &str, evaluators: &[&'static str]) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let pipeline = Pipeline::new();
    let mut direct = Vec::new();
    let mut rows = Vec::new();
    for &name in evaluators {
        let mut loaded = open(case, &name.replace(' ', "_"), folder.path());
        loaded.scene.quality.preset = preset.to_owned();
        let outcome = pipeline.effective(&loaded).unwrap();
        let evaluator = Evaluator { name, brdf: outcome.brdf.clone(), health: outcome.health().clone() };
        if direct.is_empty() {
            direct = pairs().iter().map(|p| evaluator.brdf.eval(p.i, p.o)).collect();
        }
        rows.push(measured(case, &evaluator, &pairs(), &direct));
    }
    rows
}

#[test]
fn a_case_at_standard_keeps_every_invariant() {
    assert_none(rows(&chosen().next().unwrap(), "standard", &["direct"]).iter().flat_map(violations));
}

#[test]
#[ignore = "half a minute: standard and fine, with direct sums and low-rank factors"]
fn one_case_of_each_family_keeps_every_invariant_at_finer_presets() {
    for case in chosen() {
        for preset in ["standard", "fine"] {
            // Low-rank factors of all cases at `fine` take a minute.
            let both = preset == "standard" || case.family == "BRDFs";
            let rows = rows(&case, preset, if both { &["direct", "low rank"] } else { &["direct"] });
            for row in &rows {
                println!(
                    "{preset:<9} {:<17} {:<10} swap {:.1e}, area {:.3?}, albedo {:.3?}, from direct {:.1} %",
                    row.case,
                    row.evaluator,
                    row.reciprocity,
                    row.area,
                    row.albedo,
                    100.0 * row.against_direct
                );
            }
            assert_none(rows.iter().flat_map(violations));
        }
    }
}

#[test]
#[ignore = "half a minute: 1857 directions, 6442 normals"]
fn the_papers_method_at_its_full_size_keeps_every_invariant() {
    let case = chosen().last().unwrap();
    assert_none(examine(&case, None).iter().flat_map(violations));
}
