//! Candidates for sweeps: presets, each setting varied alone, quality levels, and combinations of all settings.

use serde::{Deserialize, Serialize};

use super::quality_scale;
use crate::base::Result;
use crate::scene::{LoadedScene, Quality};

/// Reason why a candidate is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    Preset,
    /// One setting varied alone; the others are those of `standard`.
    #[serde(rename = "knob")]
    Setting(String),
    /// A quality level, as `--target-db` and `--budget-ms` choose them.
    #[serde(rename = "ladder")]
    QualityScale,
    /// All settings varied at once, spread evenly over their ranges.
    Combination,
}

/// Settings to measure: overrides of a preset.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    pub family: Family,
    pub preset: &'static str,
    /// Overrides `quality.key=value`.
    pub set: Vec<String>,
}

impl Candidate {
    fn new(family: Family, preset: &'static str, set: Vec<String>) -> Self {
        Self { family, preset, set }
    }

    /// Command-line options that select these settings.
    pub fn cli_args(&self) -> String {
        let set: Vec<String> = self.set.iter().map(|setting| format!("--set {setting}")).collect();
        [vec![format!("--quality {}", self.preset)], set].concat().join(" ")
    }
}

/// Settings that are varied alone: key, values from coarse to fine, and the overrides that they require.
const SETTINGS: &[(&str, &[&str], &[&str])] = &[
    ("facets", &["512", "1024", "2048", "4096", "8192", "24576"], &["quality.method=\"direct\""]),
    ("azimuths", &["12", "24", "36", "64", "96", "144"], &["quality.method=\"direct\""]),
    ("visibility", &["\"slices\"", "\"maps\""], &["quality.method=\"direct\""]),
    ("normal_bins", &["64", "256", "1024", "4096"], &["quality.method=\"direct\""]),
    ("penumbra_deg", &["0.1", "3", "6"], &["quality.method=\"direct\""]),
    ("method", &["\"direct\"", "\"low_rank\""], &[]),
    ("keep_m", &["0.9", "0.98", "0.995", "0.9999"], &["quality.method=\"low_rank\""]),
    ("keep_n", &["0.9", "0.98", "0.995", "0.9999"], &["quality.method=\"low_rank\""]),
    ("grid", &["[8,16]", "[12,24]", "[24,48]"], &["quality.method=\"low_rank\""]),
    ("interpolation", &["\"linear\""], &["quality.method=\"low_rank\""]),
    ("colors", &["1", "2", "3"], &["quality.method=\"low_rank\""]),
];

/// Presets, single settings, quality levels, and a number of `combinations` that cover the space of all settings
/// evenly.
pub fn candidates(measured_colors: bool, overhangs: bool, combinations: usize) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = ["draft", "standard", "fine", "wu2011"]
        .into_iter()
        .map(|preset| Candidate::new(Family::Preset, preset, Vec::new()))
        .collect();
    for (key, values, required) in SETTINGS {
        if *key == "colors" && !measured_colors {
            continue;
        }
        for value in *values {
            let set = required
                .iter()
                .map(|setting| (*setting).to_owned())
                .chain([format!("quality.{key}={value}")])
                .collect();
            all.push(Candidate::new(Family::Setting((*key).to_owned()), "standard", set));
        }
    }
    all.extend((1..=5).map(|k| quality_scale::candidate_at(2.0 * f64::from(k), overhangs)));
    all.extend((0..combinations).map(combination));
    all
}

/// The k-th point of an additive recurrence in five dimensions, scaled to the ranges of the settings. Its steps are the
/// powers of the inverse root of `x⁶ = x + 1`.
fn combination(k: usize) -> Candidate {
    const ROOT: f64 = 1.134_724_138_401_519_4;
    let at = |axis: i32| (0.5 + (k + 1) as f64 * ROOT.powi(-(axis + 1))).fract();
    let log = |from: f64, to: f64, x: f64| (from * (to / from).powf(x)).round();
    let kept_energy = |x: f64| 1.0 - 10_f64.powf(-1.0 - 3.0 * x);
    let mut set = vec![
        format!("quality.facets={}", log(512.0, 24_576.0, at(0))),
        format!("quality.azimuths={}", log(12.0, 128.0, at(1))),
    ];
    if at(2) < 0.5 {
        set.push("quality.method=\"direct\"".to_owned());
    } else {
        let rings = log(8.0, 24.0, at(3));
        set.push("quality.method=\"low_rank\"".to_owned());
        set.push(format!("quality.grid=[{rings},{}]", 2.0 * rings));
        set.push(format!("quality.keep_m={:.4}", kept_energy(at(4))));
        set.push(format!("quality.keep_n={:.4}", kept_energy(at(2).mul_add(2.0, -1.0))));
    }
    Candidate::new(Family::Combination, "standard", set)
}

/// The scene with a candidate's settings, and its own seed and backend.
///
/// # Errors
/// Returns an error if an override is not a valid setting.
pub fn with_settings(loaded: &LoadedScene, candidate: &Candidate) -> Result<LoadedScene> {
    let mut scene = loaded.clone();
    scene.scene.quality = Quality {
        preset: candidate.preset.to_owned(),
        seed: loaded.scene.quality.seed,
        backend: loaded.scene.quality.backend.clone(),
        ..Quality::default()
    };
    scene.scene = scene.scene.with_quality(&candidate.set)?;
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_spread_over_every_setting_and_are_valid() {
        let facets: Vec<f64> = (0..40)
            .filter_map(|k| combination(k).set[0].strip_prefix("quality.facets=").and_then(|n| n.parse::<f64>().ok()))
            .collect();
        assert_eq!(facets.len(), 40);
        for octave in 0..5 {
            let (from, to) = (512.0 * 2_f64.powi(octave), 512.0 * 2_f64.powi(octave + 1));
            assert!(facets.iter().filter(|n| (from..to).contains(*n)).count() >= 4, "{octave}: {facets:?}");
        }
        let loaded = crate::scene::open("default", &[]).unwrap();
        for candidate in candidates(true, false, 40) {
            with_settings(&loaded, &candidate).unwrap();
        }
    }
}
