//! The large scale: object, light, camera, quality.

use crate::scene::{Camera, Light, Object, Quality, Scene};
use eframe::egui::{self, Ui};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::fields::{self, Around};

const ENVIRONMENTS: [(&str, &str); 5] = [
    ("studio", "Studio"),
    ("clear_sky", "Clear sky"),
    ("overcast_sky", "Overcast sky"),
    ("sun", "Sun alone"),
    ("none", "None"),
];

pub fn object_ui(ui: &mut Ui, scene: &mut Scene, around: &mut Around) {
    let fields = Object::fields();
    let mut object = scene.object.clone();
    edit(ui, &mut object, &fields, &["path"], around);
    if object.kind == "mesh" {
        if object.path.is_none() {
            // It begins with its file; until one is chosen the object stays.
            around.browse = Some("object");
            return;
        }
        edit(ui, &mut object, &fields, &["kind"], around);
        if around.browse == Some("path") {
            around.browse = Some("object");
        }
    } else {
        object.path = None;
    }
    scene.object = object;
}

pub fn light_ui(ui: &mut Ui, light: &mut Light, around: &mut Around) {
    let now = ENVIRONMENTS.iter().find(|(name, _)| *name == light.environment);
    let shown = now.map_or_else(|| file_name(&light.environment), |(_, words)| (*words).to_owned());
    fields::row(ui, "Environment", "What surrounds the object: a sky, or a .hdr or .exr file.", |ui| {
        egui::ComboBox::from_id_salt("environment").selected_text(shown).width(150.0).show_ui(ui, |ui| {
            for (name, words) in ENVIRONMENTS {
                if ui.selectable_label(light.environment == name, words).clicked() {
                    name.clone_into(&mut light.environment);
                }
            }
        });
        if ui.button("…").on_hover_text("A .hdr or .exr file").clicked() {
            around.browse = Some("environment");
        }
    });
    edit(ui, light, &Light::fields(), &["environment", "directional"], around);
    let mut removed = None;
    for (at, lamp) in light.directional.iter_mut().enumerate() {
        ui.push_id(("lamp", at), |ui| {
            egui::CollapsingHeader::new(format!("Lamp {}", at + 1)).show(ui, |ui| {
                edit(ui, lamp, &crate::scene::DirectionalSpec::fields(), &[], around);
                if ui.button("Remove lamp").clicked() {
                    removed = Some(at);
                }
            });
        });
    }
    if let Some(at) = removed {
        light.directional.remove(at);
    }
    if ui.button("Add a lamp").on_hover_text("A directional light besides the environment").clicked() {
        let direction = glam::Vec3::new(-0.5, 0.8, 0.6);
        light.directional.push(crate::scene::DirectionalSpec { direction, irradiance: glam::Vec3::splat(2.0) });
    }
}

fn file_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

pub fn camera_ui(ui: &mut Ui, scene: &mut Scene, around: &mut Around) {
    let mut camera = scene.camera.clone().unwrap_or_default();
    let before = camera.clone();
    edit(ui, &mut camera, &Camera::fields(), &[], around);
    // Nearer than this is inside the object; 0 frames it.
    if camera.distance > 0.0 {
        camera.distance = camera.distance.max(0.05);
    }
    if camera != before {
        scene.camera = Some(camera);
    }
}

pub fn quality_ui(ui: &mut Ui, quality: &mut Quality, around: &mut Around) {
    let fields = Quality::fields();
    let (first, knobs): (Vec<_>, Vec<_>) =
        fields.into_iter().partition(|field| matches!(field.key, "preset" | "backend"));
    edit(ui, quality, &first, &[], around);
    egui::CollapsingHeader::new("Knobs").show(ui, |ui| {
        ui.weak("What is set here overrides the preset.");
        edit(ui, quality, &knobs, &["grid"], around);
        if ui.button("Back to the preset").clicked() {
            *quality = Quality {
                preset: quality.preset.clone(),
                backend: quality.backend.clone(),
                seed: quality.seed,
                ..Quality::default()
            };
        }
    });
}

/// Edits a plain table of the scene through its catalogue.
fn edit<T: Serialize + DeserializeOwned>(
    ui: &mut Ui,
    place: &mut T,
    fields: &[crate::scene::Field],
    skip: &[&str],
    around: &mut Around,
) {
    let Ok(mut table) = Table::try_from(&*place) else { return };
    let before = table.clone();
    fields::table_ui(ui, &mut table, fields, skip, around);
    if table != before {
        match table.try_into::<T>() {
            Ok(changed) => *place = changed,
            Err(error) => around.complaint = Some(error.message().to_owned()),
        }
    }
}
