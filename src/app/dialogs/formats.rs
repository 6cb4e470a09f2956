//! The formats of a table in a person's words: what to choose for which program.

use std::path::Path;

use eframe::egui::{ComboBox, Ui};

/// End of a file's name, what it is, who reads it.
const TABLES: [(&str, &str, &str); 9] = [
    (".npz", "NumPy arrays", "Python, and this program again"),
    (".csv", "Text", "any program, a line a pair of directions"),
    (".exr", "Image atlas", "shaders and viewers, an image a light"),
    (".bsdf", "RGL tensor", "Mitsuba 3 (plugin `measured`), pbrt"),
    ("_spec.bsdf", "RGL tensor with spectra", "Mitsuba 3 in spectral mode"),
    (".binary", "MERL", "programs that read MERL files; isotropic"),
    (".xml", "Radiance", "Radiance, EnergyPlus, daylight programs"),
    (".bin", "UTIA", "programs that read UTIA files; anisotropic"),
    (".astm", "ASTM E1392", "archives of measurements"),
];

/// The longest ending of a name that is known.
fn ending_of(name: &str) -> Option<usize> {
    let fits = |at: &usize| name.to_ascii_lowercase().ends_with(TABLES[*at].0);
    (0..TABLES.len()).filter(fits).max_by_key(|at| TABLES[*at].0.len())
}

/// A choice of formats; the name gets the ending of the one that is chosen.
pub fn ui(ui: &mut Ui, name: &mut String) {
    let now = ending_of(name);
    let words = |at: usize| format!("{} ({})", TABLES[at].1, TABLES[at].0);
    ui.horizontal(|ui| {
        let label = ui.label("Format");
        let shown = now.map_or_else(|| "Choose, or type an ending".to_owned(), words);
        let combo = ComboBox::from_id_salt("format").selected_text(shown).width(220.0).height(400.0);
        let response = combo.show_ui(ui, |ui| {
            for (at, (_, _, readers)) in TABLES.iter().enumerate() {
                let text = format!("{}: {readers}", words(at));
                if ui.selectable_label(now == Some(at), text).clicked() {
                    *name = with_ending(name, now, at);
                }
            }
        });
        response.response.labelled_by(label.id);
        if let Some(at) = now {
            ui.weak(format!("for {}", TABLES[at].2));
        }
    });
}

fn with_ending(name: &str, now: Option<usize>, at: usize) -> String {
    let stem = match now {
        Some(now) => name[..name.len() - TABLES[now].0.len()].to_owned(),
        None => Path::new(name).with_extension("").to_string_lossy().into_owned(),
    };
    format!("{stem}{}", TABLES[at].0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_that_export_writes_is_offered_and_taken() {
        for ending in biscale::export::endings() {
            assert!(TABLES.iter().any(|(known, ..)| *known == format!(".{ending}")), "{ending}");
        }
        for (at, (ending, ..)) in TABLES.iter().enumerate() {
            let name = with_ending("my.cup.npz", ending_of("my.cup.npz"), at);
            assert_eq!(name, format!("my.cup{ending}"));
            biscale::export::check_ending(Path::new(&name)).unwrap();
            assert_eq!(with_ending(&name, ending_of(&name), 0), "my.cup.npz");
        }
    }
}
