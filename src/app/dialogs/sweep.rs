//! A sweep: the ranges of some keys of the scene, written as the specification of a data set for `biscale.batch`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use eframe::egui::{self, Context, DragValue, Grid, Id, ScrollArea, Ui};

use super::export::{ExportDecision, footer};
use crate::base::{Result, replace_file};
use crate::scene::{KeyEntry, PRESETS, Scene, describes_material, keys_of};

/// Largest range of a whole number, whose values the specification lists.
const MAX_CHOICES: f64 = 1000.0;

/// A data set of materials that vary in some keys of a scene.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// File or shipped name of the scene.
    base: String,
    keys: Vec<SweptKey>,
    count: u64,
    /// Pairs of directions per material.
    directions: u64,
    preset: String,
    /// Milliseconds of one material without its pairs, and of a pair.
    ms: [f64; 2],
}

/// A number of the scene and the range from which the data set draws it.
#[derive(Debug, Clone)]
struct SweptKey {
    entry: KeyEntry,
    is_on: bool,
    range: [f64; 2],
    is_log: bool,
}

impl Sweep {
    /// A sweep over the numbers of a scene, none of which vary yet. `ms` is the time of one material without its pairs of
    /// directions, and of a pair.
    pub fn new(scene: &Scene, base: String, ms: [f64; 2]) -> Self {
        let keys = keys_of(scene).unwrap_or_default().into_iter();
        let keys = keys.filter(describes_material).filter_map(SweptKey::new).collect();
        Self { base, keys, count: 1000, directions: 4096, preset: scene.quality.preset.clone(), ms }
    }

    /// Hours that the data set takes on this machine, and its bytes. Values are stored in half precision.
    fn hours_and_bytes(&self) -> (f64, f64) {
        let [material, pair] = self.ms;
        let count = self.count as f64;
        let hours = count * (material + pair * self.directions as f64) / 3.6e6;
        (hours, count * self.directions as f64 * 6.0)
    }

    /// Returns true if the specification can be written.
    fn is_complete(&self) -> bool {
        let varied: Vec<&SweptKey> = self.keys.iter().filter(|key| key.is_on).collect();
        !varied.is_empty() && varied.iter().all(|key| key.range[0] < key.range[1])
    }

    /// The specification as a file of `biscale.batch`.
    pub fn text(&self) -> String {
        let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
        let base = quoted(&self.base);
        let mut text = format!("base = {base}\ncount = {}\nseed = 1\n\n[sample]\n", self.count);
        for SweptKey { entry, range: [low, high], is_log, .. } in self.keys.iter().filter(|key| key.is_on) {
            let drawn = match (entry.kind, is_log) {
                // Between whole numbers, `uniform` would draw others.
                ("integer", _) => {
                    let all: Vec<String> = (*low as i64..=*high as i64).map(|value| value.to_string()).collect();
                    format!("choice = [{}]", all.join(", "))
                }
                (_, true) => format!("log = [{low:?}, {high:?}]"),
                (_, false) => format!("uniform = [{low:?}, {high:?}]"),
            };
            let _ = writeln!(text, "{} = {{ {drawn} }}", quoted(&entry.key));
        }
        let Self { directions, preset, .. } = self;
        let preset = quoted(preset);
        let _ = write!(
            text,
            "\n[output]\nwhat = \"pairs\"\ndirections = {directions}\nquality = {preset}\ndtype = \"float16\"\n"
        );
        text
    }

    /// Writes the specification and returns the command that makes the data set.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<String> {
        replace_file(path, self.text().as_bytes())?;
        let folder: PathBuf = path.with_extension("");
        Ok(format!("python -m biscale.batch run \"{}\" -o \"{}\"", path.display(), folder.display()))
    }

    /// Draws the dialog.
    pub fn ui(&mut self, ctx: &Context, path: &Path) -> Option<ExportDecision> {
        let mut decision = None;
        let modal = egui::Modal::new(Id::unique("sweep")).show(ctx, |ui| {
            ui.set_width(620.0);
            ui.heading("Sweep: a data set of materials");
            ui.label(
                "Tick the keys that vary. biscale.batch, a module of the Python package, draws each value from its range.",
            );
            ui.separator();
            ScrollArea::vertical().max_height(300.0).auto_shrink([false, true]).show(ui, |ui| self.keys_ui(ui));
            ui.separator();
            self.size_ui(ui);
            ui.weak(path.display().to_string());
            footer(ui, self.is_complete(), &mut decision);
        });
        if modal.should_close() && decision.is_none() {
            decision = Some(ExportDecision::Cancel);
        }
        decision
    }

    fn keys_ui(&mut self, ui: &mut Ui) {
        Grid::new("swept keys").num_columns(5).striped(true).show(ui, |ui| {
            for key in &mut self.keys {
                let SweptKey { entry, is_on, range, is_log } = key;
                let name =
                    if entry.unit.is_empty() { entry.key.clone() } else { format!("{} [{}]", entry.key, entry.unit) };
                ui.checkbox(is_on, name).on_hover_text(entry.doc);
                let [least, most] = entry.range.unwrap_or([f64::MIN, f64::MAX]);
                let is_whole = entry.kind == "integer";
                for (end, name) in range.iter_mut().zip(["from", "to"]) {
                    let speed = if is_whole { 0.1 } else { 0.002 * (most - least).min(10.0) };
                    let drag = DragValue::new(end).range(least..=most).speed(speed).prefix(format!("{name} "));
                    ui.add_enabled(*is_on, if is_whole { drag.fixed_decimals(0) } else { drag.max_decimals(5) });
                }
                let can_log = range[0] > 0.0 && !is_whole;
                *is_log &= can_log;
                let tip = "Even in the logarithm: as many values between 0.01 and 0.1 as between 0.1 and 1";
                ui.add_enabled(*is_on && can_log, egui::Checkbox::new(is_log, "log")).on_hover_text(tip);
                ui.end_row();
            }
        });
    }

    fn size_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let label = ui.label("Materials");
            ui.add(DragValue::new(&mut self.count).range(1..=1_000_000_000)).labelled_by(label.id);
            let label = ui.label("Direction pairs each");
            ui.add(DragValue::new(&mut self.directions).range(1..=1_000_000)).labelled_by(label.id);
            let label = ui.label("Quality");
            let presets = egui::ComboBox::from_id_salt("quality").selected_text(&self.preset).show_ui(ui, |ui| {
                for preset in PRESETS {
                    ui.selectable_value(&mut self.preset, (*preset).to_owned(), *preset);
                }
            });
            presets.response.labelled_by(label.id);
        });
        let (hours, bytes) = self.hours_and_bytes();
        let time = if hours < 1.0 { format!("{:.1} minutes", 60.0 * hours) } else { format!("{hours:.1} hours") };
        ui.label(format!("About {time} on this machine, at the speed of the last edit, and {:.3} GB", bytes / 1e9));
    }
}

impl SweptKey {
    /// A key that is a number, with a range of half to double its value. An angle of 0 varies in all directions.
    fn new(entry: KeyEntry) -> Option<Self> {
        let [least, most] = entry.range.filter(|_| matches!(entry.kind, "number" | "integer"))?;
        let value = entry.value.as_ref().and_then(|value| value.as_float().or(value.as_integer().map(|n| n as f64)))?;
        let about_zero = if entry.unit == "degrees" { [least, most] } else { [-1.0, 1.0] };
        let ends = if value == 0.0 { about_zero } else { [0.5 * value, 2.0 * value] };
        let (low, high) = (ends[0].min(ends[1]).clamp(least, most), ends[0].max(ends[1]).clamp(least, most));
        if entry.kind == "integer" && most - least > MAX_CHOICES {
            return None;
        }
        let range = if entry.kind == "integer" { [low.floor(), high.ceil()] } else { [low, high] };
        Some(Self { entry, is_on: false, range, is_log: false })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> Sweep {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &[]).unwrap();
        Sweep::new(&loaded.scene, "fig4b_bicolor_cup".to_owned(), [10.0, 0.01])
    }

    #[test]
    fn a_sweep_offers_the_numbers_of_tile_and_materials_within_their_ranges() {
        let sweep = sweep();
        assert!(sweep.keys.iter().any(|key| key.entry.key == "tile.geometry.depth"));
        assert!(sweep.keys.iter().any(|key| key.entry.key.ends_with(".roughness")));
        for SweptKey { entry, range: [low, high], .. } in &sweep.keys {
            let [least, most] = entry.range.unwrap();
            assert!(least <= *low && low <= high && *high <= most, "{}", entry.key);
        }
        assert!(!sweep.is_complete(), "nothing varies yet");
    }

    #[test]
    fn the_specification_holds_what_is_ticked_and_states_hours_and_bytes() {
        let mut sweep = sweep();
        for key in &mut sweep.keys {
            key.is_on = matches!(key.entry.key.as_str(), "tile.geometry.depth" | "tile.geometry.count");
            if key.entry.key == "tile.geometry.depth" {
                (key.range, key.is_log) = ([0.02, 0.4], true);
            }
        }
        assert!(sweep.is_complete());
        let spec: toml::Table = toml::from_str(&sweep.text()).unwrap();
        assert_eq!(spec["base"].as_str(), Some("fig4b_bicolor_cup"));
        assert_eq!(spec["sample"]["tile.geometry.depth"]["log"].as_array().unwrap().len(), 2);
        assert_eq!(spec["sample"].as_table().unwrap().len(), 2);
        let counts = spec["sample"]["tile.geometry.count"]["choice"].as_array().unwrap();
        assert!(counts.iter().all(toml::Value::is_integer) && counts.len() > 1, "{counts:?}");
        let (hours, bytes) = sweep.hours_and_bytes();
        assert!((hours - 1000.0 * (10.0 + 40.96) / 3.6e6).abs() < 1e-12 && bytes == 1000.0 * 4096.0 * 6.0);
    }
}
