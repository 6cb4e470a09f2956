//! `biscale plan` lists every effect: on or off, why, and on request its measured cost and influence.

use std::io::Write;

use crate::base::Cancel;
use crate::diagnostics::Health;
use crate::pipeline::{Pipeline, SlabOutcome};
use crate::plan::EffectKind;
use crate::render::RenderScene;
use crate::report::{EffectCost, measure_effects};
use anyhow::Result;
use indicatif::ProgressBar;
use serde::Serialize;

use super::watch::Watch;
use super::{PlanArgs, print_json};

/// Runs of an effect on and off, and of one that is slow.
const RUNS: [u64; 2] = [5, 1];

#[derive(Serialize)]
struct Report<'a> {
    effects: &'a [crate::plan::Effect],
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<&'a [EffectCost]>,
    /// Number of runs of each stage.
    runs: std::collections::BTreeMap<&'static str, u64>,
    /// Number of faint lights that are left out.
    dropped_lights: usize,
    notes: &'a [String],
    health: &'a Health,
}

pub fn run(args: &PlanArgs) -> Result<()> {
    let (loaded, dropped_lights) = args.scene.open(|loaded| Ok(RenderScene::new(loaded)?.dropped_lights()))?;
    let mut pipeline = crate::gpu::pipeline();
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    if loaded.scene.slab.is_some() {
        let outcome = pipeline.slab(&loaded)?;
        drop(watch);
        return of_slab(args, &pipeline, &outcome, dropped_lights);
    }
    let outcome = pipeline.effective(&loaded)?;
    drop(watch);
    let measured = if args.measure {
        let bar = if args.scene.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        let costs = measure_effects(&loaded, RUNS, &Cancel::default(), |name| {
            bar.set_message(format!("with and without {name}"));
            bar.tick();
        })?;
        bar.finish_and_clear();
        Some(costs)
    } else {
        None
    };
    if args.scene.json {
        args.scene.warn(outcome.health());
        return print_json(&Report {
            effects: &outcome.plan.effects,
            measured: measured.as_deref(),
            runs: pipeline.runs().into_iter().collect(),
            dropped_lights,
            notes: &outcome.notes,
            health: outcome.health(),
        });
    }
    let mut out = std::io::stdout().lock();
    print_effects(&mut out, &outcome.plan.effects)?;
    if dropped_lights > 0 {
        writeln!(out, "{dropped_lights} lights left out")?;
    }
    if let Some(measured) = &measured {
        writeln!(
            out,
            "\n{:<20} {:>10} {:>10} {:>10} {:>10} {:>8} {:>8}",
            "edit and image", "on, ms", "off, ms", "auto, ms", "change, %", "mean ΔE", "95 % ΔE"
        )?;
        for cost in measured {
            writeln!(
                out,
                "{:<20} {:>10.1} {:>10.1} {:>10.1} {:>10.2} {:>8.2} {:>8.2}",
                cost.name,
                cost.on_ms,
                cost.off_ms,
                cost.auto_ms,
                cost.rel_l2 * 100.0,
                cost.mean_delta_e,
                cost.high_delta_e
            )?;
        }
    }
    args.scene.notes(&outcome);
    Ok(())
}

/// Prints the plan of a slab. Its effects are not forced, so that `--measure` has nothing to measure.
fn of_slab(args: &PlanArgs, pipeline: &Pipeline, outcome: &SlabOutcome, dropped_lights: usize) -> Result<()> {
    args.scene.warn(&outcome.health);
    if args.scene.json {
        return print_json(&Report {
            effects: &outcome.effects,
            measured: None,
            runs: pipeline.runs().into_iter().collect(),
            dropped_lights,
            notes: &[],
            health: &outcome.health,
        });
    }
    print_effects(&mut std::io::stdout().lock(), &outcome.effects)
}

/// Prints one line per effect, and a heading before each kind.
fn print_effects(out: &mut impl Write, effects: &[crate::plan::Effect]) -> Result<()> {
    writeln!(out, "{:<20} {:<7} {:>12} {:>12}  reason", "effect", "", "predicted", "measured")?;
    let mut kind = None;
    for effect in effects {
        if kind != Some(effect.kind) {
            kind = Some(effect.kind);
            writeln!(out, "{}", heading(effect.kind))?;
        }
        let measured = effect.measured_ms.map_or("-".to_owned(), |ms| format!("{ms:.1} ms"));
        let predicted =
            if effect.predicted_ms > 0.0 { format!("{:.1} ms", effect.predicted_ms) } else { "-".to_owned() };
        let on = if effect.on { "on" } else { "off" };
        let forced = if effect.forced { "!" } else { "" };
        let bound = match effect.bound {
            Some(bound) if bound >= 5e-4 => format!(" (turning it on changes at most {:.1} %)", bound * 100.0),
            Some(_) => " (turning it on changes nothing)".to_owned(),
            None => String::new(),
        };
        let remedy = match effect.left_out {
            Some(left_out) => format!(" (--effect {}=on adds it in {:.0} ms)", effect.name, left_out.predicted_ms),
            None => String::new(),
        };
        writeln!(
            out,
            "{:<20} {:<7} {predicted:>12} {measured:>12}  {}{remedy}{bound}",
            effect.name,
            format!("{on}{forced}"),
            effect.reason
        )?;
    }
    Ok(())
}

/// Line above the effects of one kind.
fn heading(kind: EffectKind) -> &'static str {
    match kind {
        EffectKind::Physics => "physics:",
        EffectKind::Scene => "scene:",
        EffectKind::Method => "method:",
    }
}
