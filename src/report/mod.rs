//! Accuracy against time as a page that explains itself (`report.html`), a table (`report.csv`) and data (`report.json`).

mod conclusions;
mod effects;
mod html;
mod svg;
mod thumbnails;

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

pub use effects::{EffectCost, measure_effects};
pub use thumbnails::{ThumbnailRenderer, difference_png, heat};

use crate::tuning::sweep::Point;

/// Where the figures were taken: they hold nowhere else.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    pub processor: String,
    pub threads: usize,
    pub version: String,
}

impl Machine {
    /// This one.
    pub fn here() -> Self {
        Self {
            processor: processor_name(),
            threads: rayon::current_num_threads(),
            version: env!("CARGO_PKG_VERSION").to_owned() + if cfg!(debug_assertions) { " (debug)" } else { "" },
        }
    }
}

/// The processor's name where the system tells it, else its architecture.
fn processor_name() -> String {
    let told = if cfg!(target_os = "linux") { std::fs::read_to_string("/proc/cpuinfo").ok() } else { None };
    told.as_deref()
        .and_then(|text| text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')))
        .map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

/// A picture at one setting, beside the finest one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    pub label: String,
    /// `data:` addresses of the picture and of its difference; the finest has none.
    #[serde(rename = "picture")]
    pub image: String,
    pub difference: Option<String>,
    pub mean_delta_e: f32,
    /// Of 95 % of the pixels.
    pub high_delta_e: f32,
}

/// All that was found out about a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneReport {
    pub name: String,
    /// Direction pairs, the reference's own relative error, its passes and seconds.
    pub pairs: usize,
    pub reference_error: f64,
    pub reference_passes: usize,
    pub reference_seconds: f64,
    pub points: Vec<Point>,
    pub thumbnails: Vec<Thumbnail>,
    /// Settings that there was no time for.
    pub left_out: usize,
}

/// The whole report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub machine: Machine,
    pub command: String,
    pub scenes: Vec<SceneReport>,
}

impl Report {
    /// One self-contained page.
    pub fn html(&self) -> String {
        html::page(self)
    }

    /// A row a setting.
    pub fn csv(&self) -> String {
        let mut text = "scene,family,settings,ms,query_us,rel_l2,psnr_db,albedo_error,form\n".to_owned();
        for point in self.scenes.iter().flat_map(|scene| &scene.points) {
            let family = html::family_name(point);
            let _ = writeln!(
                text,
                "{},{family},{},{:.3},{:.3},{:.6},{:.2},{:.6},{}",
                quoted(&point.scene),
                quoted(&point.settings),
                point.ms,
                point.query_us,
                point.rel_l2,
                point.psnr_db,
                point.albedo_error,
                quoted(&point.form)
            );
        }
        text
    }

    /// `{"machine", "points": [{"scene", "settings", "ms", "rel_l2", "psnr_db", ...}], "scenes": [...]}`.
    pub fn json(&self) -> serde_json::Value {
        let points: Vec<&Point> = self.scenes.iter().flat_map(|scene| &scene.points).collect();
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
                    "conclusions": conclusions::of(scene),
                })
            })
            .collect();
        serde_json::json!({"machine": self.machine, "command": self.command, "points": points, "scenes": scenes})
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
