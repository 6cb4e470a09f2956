//! `biscale export`: the effective BRDF as a table.

use anyhow::Result;

use crate::ExportArgs;

pub fn run(args: &ExportArgs) -> Result<()> {
    let _ = args;
    anyhow::bail!("export is being merged")
}
