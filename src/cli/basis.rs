//! `biscale basis` prints size and rank of each material's rotated basis, in the columns of the paper's Table 3.

use std::io::Write;
use std::time::Instant;

use crate::brdf::{Brdf, ColorBasis, MeasuredCache, Term, analytic_lobe};
use crate::effective::{LowRankSettings, RotatedBasis, RotatedLobe};
use crate::pipeline::refuse_slab;
use crate::plan::Settings;
use crate::scene::LoadedScene;
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
    let (loaded, ()) = args.open(|loaded| Ok(refuse_slab(loaded, "`biscale basis`")?))?;
    let settings = Settings::from_quality(&loaded.scene.quality).low_rank(false);
    // All files are read before the first factorization, which may take minutes.
    let brdfs = brdfs(&loaded)?;
    let rows = brdfs.into_iter().map(|(name, brdf)| row(name, &brdf, &settings)).collect::<Result<Vec<Row>>>()?;
    if args.json { print_json(&rows) } else { print(&rows) }
}

/// Name and BRDF of each material, or of the default material if the scene lists none.
fn brdfs(loaded: &LoadedScene) -> Result<Vec<(String, Brdf)>> {
    let scene = &loaded.scene;
    let names: Vec<&str> = match scene.materials.as_slice() {
        [] => vec![scene.material_for_slot("default")?.name],
        materials => materials.iter().map(|material| material.name.as_str()).collect(),
    };
    let mut cache = MeasuredCache::default();
    let brdf = |name: &str| -> Result<_> {
        let material = scene.material_for_slot(name)?;
        Ok((name.to_owned(), Brdf::from_specs(material.brdf, &loaded.base_dir, &mut cache)?))
    };
    names.into_iter().map(brdf).collect()
}

/// Factors the rotated basis of each term of a BRDF.
fn row(name: String, brdf: &Brdf, settings: &LowRankSettings) -> Result<Row> {
    const MIB: f64 = 1_048_576.0;
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
    let (rows, columns) = (settings.basis.pairs.nodes(), settings.basis.columns());
    Ok(Row {
        paper: Paper::row(&name),
        material: name,
        rows,
        columns,
        full_mb: (rows * columns * 8) as f64 / MIB,
        final_mb: bases.iter().map(RotatedBasis::bytes).sum::<usize>() as f64 / MIB,
        rank: bases.iter().map(|basis| basis.rank).sum(),
        seconds: start.elapsed().as_secs_f64(),
        kept_energy: bases.iter().map(|basis| basis.kept_energy).fold(1.0, f64::min),
        rank_at_98_percent_norm: bases.iter().map(|basis| basis.rank_at(0.98 * 0.98)).sum(),
    })
}

impl Paper {
    /// The row of a material in the paper's table.
    fn row(material: &str) -> Option<Self> {
        let &(_, rows, columns, full_mb, final_mb, rank, seconds) = PAPER.iter().find(|row| row.0 == material)?;
        Some(Self { rows, columns, full_mb, final_mb, rank, seconds })
    }
}

fn print(rows: &[Row]) -> Result<()> {
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
        match &row.paper {
            Some(p) => {
                writeln!(out, "   ({} {} {} {} {} {})", p.rows, p.columns, p.full_mb, p.final_mb, p.rank, p.seconds)?
            }
            None => writeln!(out)?,
        }
    }
    Ok(())
}
