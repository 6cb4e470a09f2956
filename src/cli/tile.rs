//! `biscale tile` writes the tile itself, to print it, to fold it, or for other programs.

use crate::base::{Error, InputError, print_on_stderr};
use crate::export::tile;
use crate::export::tile::TileOptions;
use anyhow::Result;
use glam::UVec2;

use super::TileArgs;
use super::{check_outputs, print_json, progress_bar, progress_on};

pub fn run(args: &TileArgs) -> Result<()> {
    let count = |[x, y]: [usize; 2]| UVec2::new(x as u32, y as u32);
    let options =
        TileOptions { repeat: count(args.repeat), scale: args.scale, base_mm: args.base, samples: count(args.samples) };
    tile::check(&options, &args.output)?;
    let (loaded, ()) = args.scene.open(|loaded| {
        check_outputs(&args.scene.scene, loaded, &[], [&args.output])?;
        if args.scene.target().is_some() {
            let expected = "neither: the tile does not depend on the accuracy";
            return Err(Error::from(InputError::new("--target-db or --budget-ms", "a target", expected)).into());
        }
        Ok(())
    })?;
    let mesh = crate::gpu::pipeline().mesh(&loaded)?;
    let bar = progress_bar("writing", args.scene.quiet);
    let notes = tile::write(&loaded.scene, &mesh, &options, &args.output, &progress_on(&bar));
    bar.finish_and_clear();
    let notes = notes?;
    if args.scene.json {
        return print_json(&serde_json::json!({ "output": args.output.display().to_string(), "notes": notes }));
    }
    if !args.scene.quiet {
        notes.iter().chain(&mesh.notes).for_each(|note| print_on_stderr(format_args!("note: {note}")));
    }
    Ok(())
}
