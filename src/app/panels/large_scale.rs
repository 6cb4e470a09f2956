//! Panels of the large scale: object, light, camera, quality.

use crate::plan::Settings;
use crate::scene::{Camera, Light, OBJECT_KINDS, Object, Quality, Scene};
use eframe::egui::{self, Ui};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::controls;
use super::fields::{self, PanelContext};
use crate::app::views::thumbnails::Choice;
use crate::app::worker::Subject;

const ENVIRONMENTS: [(&str, &str); 5] = [
    ("studio", "Studio"),
    ("clear_sky", "Clear sky"),
    ("overcast_sky", "Overcast sky"),
    ("sun", "Sun only"),
    ("none", "None"),
];

pub fn object_ui(ui: &mut Ui, scene: &mut Scene, context: &mut PanelContext) {
    let fields = Object::fields();
    let mut object = scene.object.clone();
    let doc = fields.iter().find(|field| field.key == "kind").map_or("", |field| field.doc);
    let chosen = fields::row(ui, "Kind", doc, |ui| {
        let width = ui.available_width().min(180.0);
        controls::object_kind_ui(ui, &object.kind, OBJECT_KINDS.iter().copied(), width, &context.thumbnails)
    });
    if let Some(kind) = chosen {
        kind.clone_into(&mut object.kind);
    }
    if object.kind == "mesh" {
        if object.path.is_none() {
            // A mesh needs a file. The object stays until the user has chosen one.
            context.browse = Some("object");
            return;
        }
        edit(ui, &mut object, &fields, &["kind"], context);
        if context.browse == Some("path") {
            context.browse = Some("object");
        }
    } else {
        object.path = None;
    }
    scene.object = object;
}

pub fn light_ui(ui: &mut Ui, light: &mut Light, context: &mut PanelContext) {
    let now = ENVIRONMENTS.iter().find(|(name, _)| *name == light.environment);
    let shown = now.map_or_else(|| file_name(&light.environment), |(_, label)| (*label).to_owned());
    fields::row(ui, "Environment", "Light from all directions: a built-in sky, or a .hdr or .exr file.", |ui| {
        let combo = egui::ComboBox::from_id_salt("environment").selected_text(shown).width(150.0);
        let choices = ENVIRONMENTS.map(|(name, label)| Choice {
            name,
            caption: label.to_owned(),
            doc: String::new(),
            subject: Subject::Environment(name),
        });
        if let Some(name) = context.thumbnails.picker(ui, combo, &light.environment, choices) {
            name.clone_into(&mut light.environment);
        }
        if ui.button("…").on_hover_text("A .hdr or .exr file").clicked() {
            context.browse = Some("environment");
        }
    });
    edit(ui, light, &Light::fields(), &["environment", "directional"], context);
    let mut removed = None;
    for (at, directional) in light.directional.iter_mut().enumerate() {
        ui.push_id(("light", at), |ui| {
            egui::CollapsingHeader::new(format!("Directional light {}", at + 1)).show(ui, |ui| {
                edit(ui, directional, &crate::scene::DirectionalSpec::fields(), &[], context);
                if ui.button("Remove light").clicked() {
                    removed = Some(at);
                }
            });
        });
    }
    if let Some(at) = removed {
        light.directional.remove(at);
    }
    if ui.button("Add a light").on_hover_text("A directional light in addition to the environment").clicked() {
        let direction = glam::Vec3::new(-0.5, 0.8, 0.6);
        light.directional.push(crate::scene::DirectionalSpec { direction, irradiance: glam::Vec3::splat(2.0) });
    }
}

fn file_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

pub fn camera_ui(ui: &mut Ui, scene: &mut Scene, context: &mut PanelContext) {
    let mut camera = scene.camera.clone().unwrap_or_default();
    let before = camera.clone();
    edit(ui, &mut camera, &Camera::fields(), &[], context);
    // A smaller distance would put the camera into the object. 0 frames the object.
    if camera.distance > 0.0 {
        camera.distance = camera.distance.max(0.05);
    }
    if camera != before {
        scene.camera = Some(camera);
    }
}

pub fn quality_ui(ui: &mut Ui, quality: &mut Quality, context: &mut PanelContext) {
    let fields = Quality::fields();
    let (first, settings): (Vec<_>, Vec<_>) =
        fields.into_iter().partition(|field| matches!(field.key, "preset" | "backend"));
    edit(ui, quality, &first, &[], context);
    context.in_force = in_force(quality);
    egui::CollapsingHeader::new("Advanced").show(ui, |ui| {
        ui.weak("A value that is set here overrides the preset.");
        edit(ui, quality, &settings, &["grid"], context);
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

/// Values of the settings that the preset decides, as far as they are numbers.
fn in_force(quality: &Quality) -> Vec<(&'static str, String)> {
    let settings = Settings::from_quality(quality);
    let number = |value: f64| fields::format_number(value);
    vec![
        ("facets", settings.facets.to_string()),
        ("azimuths", settings.horizon_azimuths.to_string()),
        ("rings", settings.map_grid.rings.to_string()),
        ("normal_bins", settings.normal_bins.map_or_else(|| "none".to_owned(), |bins| bins.to_string())),
        ("keep_m", number(settings.keep_m)),
        ("keep_n", number(settings.keep_n)),
        ("reference_samples", (settings.reference_facets * settings.reference_passes).to_string()),
        ("penumbra_deg", format!("{}°", number(f64::from(settings.penumbra.to_degrees())))),
    ]
}

/// Draws a table of the scene from its catalogue fields, and applies the edits.
pub(super) fn edit<T: Serialize + DeserializeOwned>(
    ui: &mut Ui,
    target: &mut T,
    fields: &[crate::scene::Field],
    skip: &[&str],
    context: &mut PanelContext,
) {
    let Ok(mut table) = Table::try_from(&*target) else { return };
    let before = table.clone();
    fields::table_ui(ui, &mut table, fields, skip, context);
    if table != before {
        match table.try_into::<T>() {
            Ok(changed) => *target = changed,
            Err(error) => context.error = Some(error.message().to_owned()),
        }
    }
}
