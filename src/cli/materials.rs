//! `biscale materials` lists the scenes that ship with the program.

use std::io::Write;

use crate::scene::shipped;
use anyhow::Result;
use serde::Serialize;

use super::MaterialsArgs;
use super::print_json;

#[derive(Serialize)]
struct Row {
    name: &'static str,
    description: String,
}

pub fn run(args: &MaterialsArgs) -> Result<()> {
    let rows: Vec<Row> = shipped::names()
        .map(|name| Row { name, description: shipped::description(name).unwrap_or_default() })
        .collect();
    if args.json {
        return print_json(&rows);
    }
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0);
    let mut out = std::io::stdout().lock();
    for row in rows {
        writeln!(out, "{:width$}  {}", row.name, row.description)?;
    }
    Ok(())
}
