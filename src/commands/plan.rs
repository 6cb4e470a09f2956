//! `biscale plan`: every effect, on or off, and why.

use std::io::Write;

use anyhow::Result;
use biscale::accuracy::Health;
use biscale::pipeline::Pipeline;
use serde::Serialize;

use super::print_json;
use crate::SceneArgs;

#[derive(Serialize)]
struct Report<'a> {
    effects: &'a [biscale::plan::Effect],
    notes: &'a [String],
    health: &'a Health,
}

pub fn run(args: &SceneArgs) -> Result<()> {
    let loaded = args.open()?;
    let outcome = Pipeline::new().effective(&loaded)?;
    if args.json {
        return print_json(&Report { effects: &outcome.plan.effects, notes: &outcome.notes, health: outcome.health() });
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "{:<20} {:<4} {:>12} {:>12}  reason", "effect", "", "predicted", "measured")?;
    for effect in &outcome.plan.effects {
        let measured = effect.measured_ms.map_or("-".to_owned(), |ms| format!("{ms:.1} ms"));
        let predicted =
            if effect.predicted_ms > 0.0 { format!("{:.1} ms", effect.predicted_ms) } else { "-".to_owned() };
        let on = if effect.on { "on" } else { "off" };
        writeln!(out, "{:<20} {on:<4} {predicted:>12} {measured:>12}  {}", effect.name, effect.reason)?;
    }
    args.notes(&outcome);
    Ok(())
}
