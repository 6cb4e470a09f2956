//! Tables as CSV: `#` lines with the description, a header, one row per pair.

use std::io::{self, Write};

use super::meta::Description;
use super::table::ExportTable;

/// Names of the columns; angles are in radians.
pub const HEADER: &str = "theta_i,phi_i,theta_o,phi_o,r,g,b,g_r,g_g,g_b";

/// Writes the file. Each number is the shortest decimal that parses to the same f32.
pub fn write(table: &ExportTable, description: &Description<'_>, out: &mut dyn Write) -> io::Result<()> {
    for line in description.lines()? {
        writeln!(out, "# {line}")?;
    }
    writeln!(out, "# columns r, g, b: brdf; g_r, g_g, g_b: g")?;
    writeln!(out, "{HEADER}")?;
    let grid = &table.grid;
    let mut entry = 0;
    for theta_i in &grid.light.theta {
        for phi_i in &grid.light.phi {
            for theta_o in &grid.view.theta {
                for phi_o in &grid.view.phi {
                    let (brdf, g) = (table.brdf[entry], table.g[entry]);
                    // `{:?}` writes very small numbers with an exponent.
                    writeln!(
                        out,
                        "{theta_i:?},{phi_i:?},{theta_o:?},{phi_o:?},{:?},{:?},{:?},{:?},{:?},{:?}",
                        brdf.x, brdf.y, brdf.z, g.x, g.y, g.z
                    )?;
                    entry += 1;
                }
            }
        }
    }
    Ok(())
}
