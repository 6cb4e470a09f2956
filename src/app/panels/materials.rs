//! The materials of each slot: BRDF model, parameters and colour.

use std::path::Path;

use crate::scene::{BrdfSpec, Geometry, MaterialSpec, Scene, TermSpec};
use eframe::egui::{self, RichText, Ui};
use glam::Vec3;
use toml::Table;

use super::controls;
use super::fields::{self, PanelContext};
use crate::app::views::gallery::DraggedScene;
use crate::app::worker::Subject;

const DEFAULT: &str = "default";

/// A request of the panel to the editor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MaterialRequest {
    /// Choose a measured file for a term of a material.
    Browse {
        material: usize,
        term: usize,
    },
    /// Replace the material of a slot by the copied one.
    Paste {
        slot: String,
    },
    /// Replace the material of a slot by that of a shipped scene.
    FromScene {
        slot: String,
        scene: &'static str,
    },
    Copy {
        material: usize,
    },
}

/// Draws the controls of every slot of the surface, the default first.
pub fn ui(ui: &mut Ui, scene: &mut Scene, slots: &[String], context: &mut PanelContext) -> Option<MaterialRequest> {
    let mut request = None;
    // A scene without materials has this one, and stays as it is until the user edits it.
    let is_implied = scene.materials.is_empty();
    if is_implied {
        scene.materials.push(grey());
    }
    let mut names: Vec<String> = vec![DEFAULT.to_owned()];
    names.extend(slots.iter().filter(|slot| *slot != DEFAULT).cloned());
    names
        .extend(scene.materials.iter().map(|m| m.name.clone()).filter(|name| !slots.contains(name) && name != DEFAULT));
    let has_own = |slot: &String| scene.materials.iter().any(|material| material.name == *slot);
    let inheriting: Vec<String> = slots.iter().filter(|slot| *slot != DEFAULT && !has_own(slot)).cloned().collect();
    for slot in names {
        let index = scene.materials.iter().position(|material| material.name == slot);
        let is_used = slot == DEFAULT || slots.contains(&slot);
        let from_slot = ui.push_id(&slot, |ui| match index {
            Some(index) => own_ui(ui, scene, index, (is_used, &inheriting), context),
            None => inherited_ui(ui, scene, &slot),
        });
        // A picture of the gallery can be dropped onto a slot.
        let area = from_slot.response;
        if area.dnd_hover_payload::<DraggedScene>().is_some() {
            let stroke = egui::Stroke::new(2.0, crate::app::theme::ACCENT);
            ui.painter().rect_stroke(area.rect, 4.0, stroke, egui::StrokeKind::Outside);
        }
        let dropped = area.dnd_release_payload::<DraggedScene>();
        let dropped = dropped.map(|scene| MaterialRequest::FromScene { slot: slot.clone(), scene: scene.0 });
        request = request.or(from_slot.inner).or(dropped);
        ui.add_space(2.0);
    }
    if is_implied && scene.materials == [grey()] {
        scene.materials.clear();
    }
    request
}

pub fn grey() -> MaterialSpec {
    let brdf = Some(BrdfSpec::One(TermSpec::Lambertian { albedo: Vec3::splat(0.5) }));
    MaterialSpec { name: DEFAULT.to_owned(), brdf, color: Vec3::ONE }
}

/// Draws a slot that uses the default material.
fn inherited_ui(ui: &mut Ui, scene: &mut Scene, slot: &str) -> Option<MaterialRequest> {
    let mut request = None;
    fields::row(ui, &fields::display_name(slot), "This part of the surface uses the default material.", |ui| {
        ui.weak("as default");
        if ui.button("Paste").on_hover_text("Use the copied material here").clicked() {
            request = Some(MaterialRequest::Paste { slot: slot.to_owned() });
        }
        if ui.button("Customize").on_hover_text("Give this part of the surface a material of its own").clicked() {
            scene.materials.push(MaterialSpec { name: slot.to_owned(), brdf: None, color: Vec3::ONE });
        }
    });
    request
}

/// Draws the material of one slot. `inheriting` are the slots without a material, which use the default.
fn own_ui(
    ui: &mut Ui,
    scene: &mut Scene,
    index: usize,
    (is_used, inheriting): (bool, &[String]),
    context: &mut PanelContext,
) -> Option<MaterialRequest> {
    let name = scene.materials[index].name.clone();
    let is_default = name == DEFAULT;
    let mut title = fields::display_name(&name);
    if is_default && !inheriting.is_empty() {
        title.push_str(&format!(" ({})", inheriting.join(", ")));
    } else if !is_used {
        title.push_str(" (not on this surface)");
    }
    let mut request = None;
    egui::CollapsingHeader::new(RichText::new(title).strong()).id_salt("material").default_open(true).show(ui, |ui| {
        let material = &mut scene.materials[index];
        color_ui(ui, material, context);
        request = match &mut material.brdf {
            Some(brdf) => brdf_ui(ui, brdf, index, context),
            None => {
                fields::row(ui, "BRDF", "The BRDF of the default material, multiplied by this colour.", |ui| {
                    ui.weak("as default");
                    if ui.button("Change").clicked() {
                        material.brdf = grey().brdf;
                    }
                });
                None
            }
        };
        let actions = actions_ui(ui, material, index, is_default);
        request = request.take().or(actions.0);
        if actions.1 {
            scene.materials.remove(index);
        }
    });
    request
}

fn color_ui(ui: &mut Ui, material: &mut MaterialSpec, context: &mut PanelContext) {
    let Some(field) = MaterialSpec::fields().into_iter().find(|field| field.key == "color") else { return };
    if let Ok(mut table) = Table::try_from(&*material) {
        let before = table.clone();
        fields::field_ui(ui, &mut table, &field, context);
        if table != before
            && let Ok(changed) = table.try_into::<MaterialSpec>()
        {
            *material = changed;
        }
    }
}

/// Draws the terms of a BRDF with their models and parameters.
fn brdf_ui(ui: &mut Ui, brdf: &mut BrdfSpec, material: usize, context: &mut PanelContext) -> Option<MaterialRequest> {
    let mut request = None;
    let mut terms = brdf.terms().to_vec();
    let before = terms.clone();
    let count = terms.len();
    let mut removed = None;
    for (at, term) in terms.iter_mut().enumerate() {
        ui.push_id(at, |ui| {
            let kinds = TermSpec::kinds();
            let doc = kinds.iter().find(|kind| kind.kind == term.kind()).map_or("", |kind| kind.doc);
            let caption = if at == 0 { "BRDF" } else { "+ BRDF" };
            let chosen = fields::row(ui, caption, doc, |ui| {
                let chosen =
                    controls::pictured_kind_ui(ui, "BRDF", term.kind(), &kinds, (&context.thumbnails, Subject::Brdf));
                if count > 1 && ui.small_button("×").on_hover_text("Remove this term").clicked() {
                    removed = Some(at);
                }
                chosen
            });
            match chosen {
                Some("merl" | "rgl" | "utia" | "npz") => request = Some(MaterialRequest::Browse { material, term: at }),
                Some(kind) => *term = converted(term, kind),
                None => {}
            }
            if let (Some(kind), Ok(mut table)) =
                (kinds.iter().find(|kind| kind.kind == term.kind()), Table::try_from(&*term))
            {
                let before = table.clone();
                let mut inside = PanelContext { unit: context.unit.clone(), ..PanelContext::default() };
                fields::table_ui(ui, &mut table, &kind.fields, &[], &mut inside);
                context.error = context.error.take().or(inside.error);
                if inside.browse.is_some() {
                    request = Some(MaterialRequest::Browse { material, term: at });
                }
                if table != before
                    && let Ok(changed) = table.try_into::<TermSpec>()
                {
                    *term = with_kind_of_file(changed);
                }
            }
        });
    }
    if let Some(at) = removed {
        terms.remove(at);
    }
    let add = ui.horizontal(|ui| {
        ui.add_space(2.0);
        ui.button("Add a lobe").on_hover_text("Add a second term to this BRDF").clicked()
    });
    if add.inner && terms.len() < 16 {
        terms.push(TermSpec::Ggx { roughness: 0.2, f0: Vec3::splat(0.04) });
    }
    if terms != before {
        *brdf = match terms.as_slice() {
            [one] => BrdfSpec::One(one.clone()),
            _ => BrdfSpec::Sum(terms),
        };
    }
    request
}

/// Changes the model of a term, and keeps its roughness and colour if both models have them.
fn converted(term: &TermSpec, kind: &str) -> TermSpec {
    let color = match term {
        TermSpec::Lambertian { albedo } => Some(*albedo),
        TermSpec::BlinnPhong { specular, .. } | TermSpec::Ward { specular, .. } => Some(*specular),
        TermSpec::CookTorrance { f0, .. } | TermSpec::Ggx { f0, .. } => Some(*f0),
        TermSpec::Merl { .. } | TermSpec::Rgl { .. } | TermSpec::Utia { .. } | TermSpec::Npz { .. } => None,
    };
    let color = color.unwrap_or(Vec3::splat(0.5));
    let roughness = match term {
        TermSpec::CookTorrance { roughness, .. }
        | TermSpec::Ggx { roughness, .. }
        | TermSpec::Ward { roughness, .. } => *roughness,
        _ => 0.3,
    };
    match kind {
        "lambertian" => TermSpec::Lambertian { albedo: color },
        "blinn_phong" => TermSpec::BlinnPhong { exponent: 50.0, specular: color },
        "cook_torrance" => TermSpec::CookTorrance { roughness, f0: color.min(Vec3::ONE) },
        "ward" => TermSpec::Ward { roughness, specular: color },
        _ => TermSpec::Ggx { roughness, f0: color.min(Vec3::ONE) },
    }
}

/// Draws the buttons of a material. Returns a request, and whether the user removes the material.
fn actions_ui(ui: &mut Ui, material: &MaterialSpec, index: usize, is_default: bool) -> (Option<MaterialRequest>, bool) {
    let mut request = None;
    let mut remove = false;
    ui.horizontal(|ui| {
        ui.add_space(2.0);
        if ui.button("Copy").on_hover_text("Copy this material as text (TOML)").clicked() {
            request = Some(MaterialRequest::Copy { material: index });
        }
        if ui.button("Paste").on_hover_text("Replace this material by the copied one").clicked() {
            request = Some(MaterialRequest::Paste { slot: material.name.clone() });
        }
        if !is_default && ui.button("Use default").on_hover_text("Remove this material").clicked() {
            remove = true;
        }
    });
    (request, remove)
}

/// Sets the kind of a measured term from the ending of its file, which the user may have typed.
fn with_kind_of_file(term: TermSpec) -> TermSpec {
    match &term {
        TermSpec::Merl { path } | TermSpec::Rgl { path } | TermSpec::Utia { path } | TermSpec::Npz { path } => {
            measured(path).unwrap_or(term)
        }
        _ => term,
    }
}

/// Returns the measured term for a file, selected by the file's ending.
pub fn measured(path: &Path) -> Option<TermSpec> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "binary" => Some(TermSpec::Merl { path: path.to_owned() }),
        "bsdf" => Some(TermSpec::Rgl { path: path.to_owned() }),
        "bin" => Some(TermSpec::Utia { path: path.to_owned() }),
        "npz" => Some(TermSpec::Npz { path: path.to_owned() }),
        _ => None,
    }
}

/// Sets a term of a material. A material without a BRDF gets one.
pub fn set_term(scene: &mut Scene, material: usize, term: usize, with: TermSpec) {
    if scene.materials.is_empty() {
        scene.materials.push(grey());
    }
    let Some(material) = scene.materials.get_mut(material) else { return };
    match &mut material.brdf {
        Some(brdf) => {
            if let Some(old) = brdf.terms_mut().get_mut(term) {
                *old = with;
            }
        }
        none => *none = Some(BrdfSpec::One(with)),
    }
}

/// Returns the slots that are known without the mesh: those of the family, and painted slots that have a material.
pub fn slots_of(scene: &Scene) -> Vec<String> {
    let names: &[&str] = match &scene.tile.geometry {
        Geometry::Grooves(_) => &["bottom", "sides"],
        Geometry::Pyramids(_) => &["faces", "floor"],
        Geometry::Rods(_) => &["rods", "floor"],
        Geometry::Weave(_) => &["warp", "weft"],
        _ => &[DEFAULT],
    };
    let painted = scene.materials.iter().map(|material| material.name.as_str());
    let painted = painted.filter(|name| scene.tile.slot_path.is_some() && name.starts_with("paint_"));
    names.iter().copied().chain(painted).map(str::to_owned).collect()
}
