//! `biscale basis` prints size and rank of each material's rotated basis, in the columns of the paper's Table 3.

use std::io::Write;
use std::time::Instant;

use crate::brdf::{Brdf, ColorBasis, MeasuredCache, Term, analytic_lobe};
use crate::effective::{RotatedBasis, RotatedLobe};
use crate::plan::Settings;
use anyhow::Result;
use serde::Serialize;

use super::SceneArgs;
use super::print_json;

/// Wu et al. 2011, Table 3: name, rows, columns, size [MB], final size [MB], rank, seconds.
const PAPER: [(&str, usize, usize, f64, f64, usize, f64); 11] = [
    ("lambertian", 8_778, 448, 30.00, 0.23, 7, 22.0),
    ("ward-0.3", 161_596, 3_768, 4_645.49, 22.81, 37, 1_573.5),
    ("cook-torrance-0.5", 46_056, 1_512, 531.29, 2.99, 17, 262.8),
    ("cook-torrance-0.2", 1_725_153, 6_442, 84_788.78, 460.67, 70, 93_409.3),
    ("pearl-paint", 49_141, 2_042, 765.58, 7.50, 40, 681.3),
    ("silver-paint", 161_596, 3_768, 4_645.49, 37.60, 61, 4_276.5),
    ("silver-metallic-paint2", 283_128, 6_442, 13_915.33, 101.52, 94, 10_172.2),
    ("gold-metallic-paint", 453_628, 6_442, 22_295.16, 160.93, 93, 15_282.9),
    ("blue-metallic-paint", 453_628, 6_442, 22_295.16, 164.39, 95, 20_835.7),
    ("special-walnut-224", 935_028, 4_250, 30_318.21, 178.34, 50, 38_016.3),
    ("white-diffuse", 49_141, 626, 234.70, 1.87, 10, 1_138.9),
];

#[derive(Serialize)]
struct Row {
    material: String,
    rows: usize,
    columns: usize,
    /// Size of M with f64 elements, as the paper counts it.
    full_mb: f64,
    #[serde(rename = "kept_mb")]
    final_mb: f64,
    rank: usize,
    seconds: f64,
    /// Part of the energy (squared norm) that the factors of `rank` represent.
    kept_energy: f64,
    /// Rank at 0.98² of the energy, which is 98 % of the norm. The ranks of the paper's Table 3 match this rule.
    rank_at_98_percent_norm: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    paper: Option<Paper>,
}

#[derive(Serialize)]
struct Paper {
    rows: usize,
    columns: usize,
    full_mb: f64,
    #[serde(rename = "kept_mb")]
    final_mb: f64,
    rank: usize,
    seconds: f64,
}

pub fn run(args: &SceneArgs) -> Result<()> {
    let (loaded, ()) = args.open(|loaded| super::slab::refuse(loaded, "basis"))?;
    let settings = Settings::from_quality(&loaded.scene.quality).low_rank(false);
    let mut cache = MeasuredCache::default();
    let mut rows = Vec::new();
    let specs: Vec<(String, crate::scene::BrdfSpec)> = if loaded.scene.materials.is_empty() {
        let default = loaded.scene.material_for_slot("default")?;
        vec![(default.name.to_owned(), default.brdf.clone())]
    } else {
        let spec = |material: &crate::scene::MaterialSpec| -> Result<_> {
            Ok((material.name.clone(), loaded.scene.material_for_slot(&material.name)?.brdf.clone()))
        };
        loaded.scene.materials.iter().map(spec).collect::<Result<_>>()?
    };
    // All files are read before the first factorization, which may take minutes.
    let mut brdfs = Vec::with_capacity(specs.len());
    for (name, spec) in specs {
        brdfs.push((name, Brdf::from_specs(&spec, &loaded.base_dir, &mut cache)?));
    }
    for (name, brdf) in brdfs {
        let start = Instant::now();
        let mut bases = Vec::new();
        for term in &brdf.terms {
            let lobe = match (term, analytic_lobe(term)) {
                (_, Some(lobe)) => RotatedLobe::Analytic(lobe),
                (Term::Measured(table), None) => {
                    let colors = ColorBasis::of(&Brdf { terms: vec![term.clone()] });
                    RotatedLobe::Measured { table: table.as_ref(), along: colors.directions[0] }
                }
                _ => continue,
            };
            bases.push(RotatedBasis::new(lobe, settings.basis, settings.keep_m)?);
        }
        let seconds = start.elapsed().as_secs_f64();
        let (pairs, columns) = (settings.basis.pairs.nodes(), settings.basis.columns());
        const MIB: f64 = 1_048_576.0;
        rows.push(Row {
            paper: PAPER.iter().find(|row| row.0 == name).map(|row| Paper {
                rows: row.1,
                columns: row.2,
                full_mb: row.3,
                final_mb: row.4,
                rank: row.5,
                seconds: row.6,
            }),
            material: name,
            rows: pairs,
            columns,
            full_mb: (pairs * columns * 8) as f64 / MIB,
            final_mb: bases.iter().map(RotatedBasis::bytes).sum::<usize>() as f64 / MIB,
            rank: bases.iter().map(|basis| basis.rank).sum(),
            seconds,
            kept_energy: bases.iter().map(|basis| basis.kept_energy).fold(1.0, f64::min),
            rank_at_98_percent_norm: bases.iter().map(|basis| basis.rank_at(0.98 * 0.98)).sum(),
        });
    }
    if args.json {
        return print_json(&rows);
    }
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{:<24} {:>9} {:>8} {:>10} {:>8} {:>6} {:>8} {:>9}   (the paper: rows, columns, MB, final MB, rank, seconds)",
        "material", "rows", "columns", "full MB", "final MB", "rank", "rank98", "seconds"
    )?;
    for row in rows {
        write!(
            out,
            "{:<24} {:>9} {:>8} {:>10.1} {:>8.2} {:>6} {:>8} {:>9.2}",
            row.material,
            row.rows,
            row.columns,
            row.full_mb,
            row.final_mb,
            row.rank,
            row.rank_at_98_percent_norm,
            row.seconds
        )?;
        match row.paper {
            Some(p) => {
                writeln!(out, "   ({} {} {} {} {} {})", p.rows, p.columns, p.full_mb, p.final_mb, p.rank, p.seconds)?
            }
            None => writeln!(out)?,
        }
    }
    Ok(())
}
