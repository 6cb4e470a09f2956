//! Reports of accuracy against time: a page (`report.html`), a table (`report.csv`) and data (`report.json`).

mod conclusions;
mod effects;
mod html;
pub mod svg;
mod thumbnails;

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

pub use effects::{EffectCost, measure_effects};
pub use thumbnails::{FULL_SCALE, ThumbnailRenderer, difference_png, heat};

use crate::tuning::candidates::Family;
use crate::tuning::sweep::SweepPoint;

/// Machine on which the times were measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    pub processor: String,
    pub threads: usize,
    pub version: String,
}

impl Machine {
    /// The machine that runs the program.
    pub fn here() -> Self {
        Self {
            processor: processor_name(),
            threads: rayon::current_num_threads(),
            version: env!("CARGO_PKG_VERSION").to_owned() + if cfg!(debug_assertions) { " (debug)" } else { "" },
        }
    }
}

/// Name of the processor on Linux, else its architecture.
fn processor_name() -> String {
    let cpuinfo = if cfg!(target_os = "linux") { std::fs::read_to_string("/proc/cpuinfo").ok() } else { None };
    cpuinfo
        .as_deref()
        .and_then(|text| text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')))
        .map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

/// Image at one setting, with its difference from the finest image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    pub label: String,
    /// `data:` URL of the image.
    #[serde(rename = "picture")]
    pub image: String,
    /// `data:` URL of the difference; `None` for the finest image.
    pub difference: Option<String>,
    pub mean_delta_e: f32,
    /// 95th percentile of ΔE over the pixels.
    pub high_delta_e: f32,
}

/// Results of one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneReport {
    pub name: String,
    /// Number of direction pairs.
    pub pairs: usize,
    /// Relative L2 of the standard errors of the reference.
    pub reference_error: f64,
    /// 0 if the reference is not computed yet, so that the points have the errors that results state.
    pub reference_passes: usize,
    pub reference_seconds: f64,
    pub points: Vec<SweepPoint>,
    pub thumbnails: Vec<Thumbnail>,
    /// Number of candidates that the time limit left out.
    pub left_out: usize,
}

impl SceneReport {
    /// A report whose points have the errors that results state.
    pub fn without_reference(name: &str, pairs: usize) -> Self {
        Self {
            name: name.to_owned(),
            pairs,
            reference_error: 0.0,
            reference_passes: 0,
            reference_seconds: 0.0,
            points: Vec::new(),
            thumbnails: Vec::new(),
            left_out: 0,
        }
    }

    /// Returns true if the errors of the points are measured against a reference.
    pub fn has_reference(&self) -> bool {
        self.reference_passes > 0
    }
}

/// The whole report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub machine: Machine,
    pub command: String,
    pub scenes: Vec<SceneReport>,
}

impl Report {
    /// The report as one self-contained page.
    pub fn html(&self) -> String {
        html::page(self)
    }

    /// The report as a table with one row per candidate.
    pub fn csv(&self) -> String {
        let mut text =
            "scene,family,settings,ms,query_us,rel_l2,psnr_db,albedo_error,form,rel_l2_std_error,is_stated\n"
                .to_owned();
        for point in self.scenes.iter().flat_map(|scene| &scene.points) {
            let family = csv_family(&point.family);
            let _ = writeln!(
                text,
                "{},{family},{},{:.3},{:.3},{:.6},{:.2},{:.6},{},{:.6},{}",
                quoted(&point.scene),
                quoted(&point.settings),
                point.ms,
                point.query_us,
                point.rel_l2,
                point.psnr_db,
                point.albedo_error,
                quoted(&point.representation),
                point.rel_l2_std_error,
                point.is_stated
            );
        }
        text
    }

    /// The report as JSON: `{"machine", "points": [{"scene", "settings", "ms", "rel_l2", "psnr_db", ...}], "scenes":
    /// [...]}`.
    pub fn json(&self) -> serde_json::Value {
        let points: Vec<&SweepPoint> = self.scenes.iter().flat_map(|scene| &scene.points).collect();
        let scenes: Vec<serde_json::Value> = self
            .scenes
            .iter()
            .map(|scene| {
                serde_json::json!({
                    "name": scene.name,
                    "pairs": scene.pairs,
                    "reference_error": scene.reference_error,
                    "reference_passes": scene.reference_passes,
                    "reference_seconds": scene.reference_seconds,
                    "left_out": scene.left_out,
                    "conclusions": if scene.has_reference() { conclusions::of(scene) } else { Vec::new() },
                })
            })
            .collect();
        serde_json::json!({"machine": self.machine, "command": self.command, "points": points, "scenes": scenes})
    }
}

/// Column `family` of `report.csv`. Its words do not change between versions.
fn csv_family(family: &Family) -> String {
    match family {
        Family::Preset => "preset".to_owned(),
        Family::Setting(name) => format!("knob {name}"),
        Family::QualityScale => "ladder".to_owned(),
        Family::Combination => "combination".to_owned(),
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
