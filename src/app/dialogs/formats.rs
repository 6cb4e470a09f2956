//! Export formats with the programs that read them.

use std::path::Path;

use eframe::egui::{ComboBox, Ui};

use super::Purpose;

/// Ending of the file name, name of the format, programs that read it.
pub type Format = (&'static str, &'static str, &'static str);

/// Formats of the material: tables of the BRDF, then fits.
const MATERIALS: [Format; 11] = [
    (".npz", "NumPy arrays", "Python, and this program again"),
    (".csv", "Text", "any program; one line per direction pair"),
    (".exr", "Image atlas", "shaders and viewers; one image per light"),
    (".bsdf", "RGL tensor", "Mitsuba 3 (plugin `measured`), pbrt"),
    ("_spec.bsdf", "RGL tensor with spectra", "Mitsuba 3 in spectral mode"),
    (".binary", "MERL", "programs that read MERL files; isotropic"),
    (".xml", "Radiance", "Radiance, EnergyPlus, daylight programs"),
    (".bin", "UTIA", "programs that read UTIA files; anisotropic"),
    (".astm", "ASTM E1392", "archives of measurements"),
    (".gltf", "glTF", "game engines, the web; a fit"),
    (".mtlx", "MaterialX", "film and CAD programs; a fit"),
];

/// Formats of the material of a slab: tables of what it transmits and reflects, a scene, then fits.
const SLABS: [Format; 5] = [
    (".npz", "NumPy arrays", "Python"),
    (".xml", "Radiance", "Radiance, EnergyPlus, daylight programs"),
    ("_mitsuba.xml", "Mitsuba scene", "Mitsuba 3; two rough faces"),
    (".gltf", "glTF", "game engines, the web; a fit"),
    (".mtlx", "MaterialX", "film and CAD programs; a fit"),
];

const TILES: [Format; 5] = [
    (".obj", "Triangles", "modellers, and this program again as a mesh"),
    (".stl", "Solid", "3D printers"),
    (".png", "Heights", "image editors, displacement maps"),
    (".svg", "Pattern to fold", "cutters and vector editors; grooves, pyramids, flat"),
    (".pdf", "Pattern to fold", "paper printers; grooves, pyramids, flat"),
];

/// Returns the formats of an export purpose.
pub fn of(purpose: &Purpose) -> Option<&'static [Format]> {
    match purpose {
        Purpose::ExportTable => Some(&MATERIALS),
        Purpose::ExportSlab => Some(&SLABS),
        Purpose::ExportTile => Some(&TILES),
        _ => None,
    }
}

/// Returns the index of the format with the longest ending that matches a name.
fn ending_of(formats: &[Format], name: &str) -> Option<usize> {
    let fits = |at: &usize| name.to_ascii_lowercase().ends_with(formats[*at].0);
    (0..formats.len()).filter(fits).max_by_key(|at| formats[*at].0.len())
}

/// Draws the choice of a format. Choosing one changes the ending of the name.
pub fn ui(ui: &mut Ui, formats: &[Format], name: &mut String) {
    let now = ending_of(formats, name);
    let label_of = |at: usize| format!("{} ({})", formats[at].1, formats[at].0);
    ui.horizontal(|ui| {
        let label = ui.label("Format");
        let selected = now.map_or_else(|| "Choose, or type an ending".to_owned(), label_of);
        let combo = ComboBox::from_id_salt("format").selected_text(selected).width(220.0).height(400.0);
        let response = combo.show_ui(ui, |ui| {
            for (at, (_, _, readers)) in formats.iter().enumerate() {
                let text = format!("{}: {readers}", label_of(at));
                if ui.selectable_label(now == Some(at), text).clicked() {
                    *name = with_ending(formats, name, at);
                }
            }
        });
        response.response.labelled_by(label.id);
        if let Some(at) = now {
            ui.weak(format!("for {}", formats[at].2));
        }
    });
}

fn with_ending(formats: &[Format], name: &str, at: usize) -> String {
    let stem = match ending_of(formats, name) {
        Some(now) => name[..name.len() - formats[now].0.len()].to_owned(),
        None => Path::new(name).with_extension("").to_string_lossy().into_owned(),
    };
    format!("{stem}{}", formats[at].0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_offered_for_a_slab_is_accepted() {
        for (at, (ending, ..)) in SLABS.iter().enumerate() {
            let name = with_ending(&SLABS, "my.pane.npz", at);
            assert_eq!(name, format!("my.pane{ending}"));
            let is_table = crate::export::slab::SlabFormat::of(Path::new(&name)).is_ok();
            assert_ne!(is_table, [".gltf", ".mtlx"].contains(ending), "{ending}");
        }
    }

    #[test]
    fn every_export_format_is_offered_and_accepted() {
        for ending in crate::export::endings() {
            assert!(MATERIALS.iter().any(|(known, ..)| *known == format!(".{ending}")), "{ending}");
        }
        for (at, (ending, ..)) in MATERIALS.iter().enumerate() {
            let name = with_ending(&MATERIALS, "my.cup.npz", at);
            assert_eq!(name, format!("my.cup{ending}"));
            assert!(crate::export::check_ending(Path::new(&name)).is_ok() || [".gltf", ".mtlx"].contains(ending));
            assert_eq!(with_ending(&MATERIALS, &name, 0), "my.cup.npz");
        }
    }
}
