//! Materials slot by slot: which BRDF, its parameters, its colour.

use std::path::Path;

use crate::scene::{BrdfSpec, Geometry, MaterialSpec, Scene, TermSpec};
use eframe::egui::{self, RichText, Ui};
use glam::Vec3;
use toml::Table;

use super::controls;
use super::fields::{self, Around};

const DEFAULT: &str = "default";

/// What a click here asks of the editor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// A measured file for a term of a material.
    Browse {
        material: usize,
        term: usize,
    },
    /// The clipboard's material over this slot's.
    Paste {
        slot: String,
    },
    Copy {
        material: usize,
    },
}

/// Controls of every slot of the surface, the default first.
pub fn ui(ui: &mut Ui, scene: &mut Scene, slots: &[String], around: &mut Around) -> Option<Request> {
    let mut request = None;
    if scene.materials.is_empty() {
        scene.materials.push(grey());
    }
    let mut names: Vec<String> = vec![DEFAULT.to_owned()];
    names.extend(slots.iter().filter(|slot| *slot != DEFAULT).cloned());
    names
        .extend(scene.materials.iter().map(|m| m.name.clone()).filter(|name| !slots.contains(name) && name != DEFAULT));
    let has_own = |slot: &String| scene.materials.iter().any(|material| material.name == *slot);
    let wearers: Vec<String> = slots.iter().filter(|slot| *slot != DEFAULT && !has_own(slot)).cloned().collect();
    for slot in names {
        let index = scene.materials.iter().position(|material| material.name == slot);
        let is_used = slot == DEFAULT || slots.contains(&slot);
        let asked = ui
            .push_id(&slot, |ui| match index {
                Some(index) => own_ui(ui, scene, index, (is_used, &wearers), around),
                None => inherited_ui(ui, scene, &slot),
            })
            .inner;
        request = request.or(asked);
        ui.add_space(2.0);
    }
    request
}

pub fn grey() -> MaterialSpec {
    let brdf = Some(BrdfSpec::One(TermSpec::Lambertian { albedo: Vec3::splat(0.5) }));
    MaterialSpec { name: DEFAULT.to_owned(), brdf, color: Vec3::ONE }
}

/// A slot that looks like the default.
fn inherited_ui(ui: &mut Ui, scene: &mut Scene, slot: &str) -> Option<Request> {
    let mut request = None;
    fields::row(ui, &fields::words(slot), "This part of the surface wears the default material.", |ui| {
        ui.weak("as default");
        if ui.button("Paste").on_hover_text("Use the copied material here").clicked() {
            request = Some(Request::Paste { slot: slot.to_owned() });
        }
        if ui.button("Customize").on_hover_text("Give this part of the surface a material of its own").clicked() {
            scene.materials.push(MaterialSpec { name: slot.to_owned(), brdf: None, color: Vec3::ONE });
        }
    });
    request
}

/// A material of its own. `wearers`: the parts of the surface that have none and wear the default.
fn own_ui(
    ui: &mut Ui,
    scene: &mut Scene,
    index: usize,
    (is_used, wearers): (bool, &[String]),
    around: &mut Around,
) -> Option<Request> {
    let name = scene.materials[index].name.clone();
    let is_default = name == DEFAULT;
    let mut title = fields::words(&name);
    if is_default && !wearers.is_empty() {
        title.push_str(&format!(" ({})", wearers.join(", ")));
    } else if !is_used {
        title.push_str(" (not on this surface)");
    }
    let mut request = None;
    egui::CollapsingHeader::new(RichText::new(title).strong()).id_salt("material").default_open(true).show(ui, |ui| {
        let material = &mut scene.materials[index];
        color_ui(ui, material, around);
        request = match &mut material.brdf {
            Some(brdf) => brdf_ui(ui, brdf, index, around),
            None => {
                fields::row(ui, "BRDF", "The default material's, in this colour.", |ui| {
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

fn color_ui(ui: &mut Ui, material: &mut MaterialSpec, around: &mut Around) {
    let Some(field) = MaterialSpec::fields().into_iter().find(|field| field.key == "color") else { return };
    if let Ok(mut table) = Table::try_from(&*material) {
        let before = table.clone();
        fields::field_ui(ui, &mut table, &field, around);
        if table != before
            && let Ok(changed) = table.try_into::<MaterialSpec>()
        {
            *material = changed;
        }
    }
}

/// The terms of a BRDF: model, parameters, and terms added to it.
fn brdf_ui(ui: &mut Ui, brdf: &mut BrdfSpec, material: usize, around: &mut Around) -> Option<Request> {
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
                let chosen = controls::kind_ui(ui, "BRDF", term.kind(), &kinds);
                if count > 1 && ui.small_button("×").on_hover_text("Remove this term of the sum").clicked() {
                    removed = Some(at);
                }
                chosen
            });
            match chosen {
                Some("merl" | "rgl" | "utia" | "npz") => request = Some(Request::Browse { material, term: at }),
                Some(kind) => *term = converted(term, kind),
                None => {}
            }
            if let (Some(kind), Ok(mut table)) =
                (kinds.iter().find(|kind| kind.kind == term.kind()), Table::try_from(&*term))
            {
                let before = table.clone();
                let mut inside = Around { unit: around.unit.clone(), ..Around::default() };
                fields::table_ui(ui, &mut table, &kind.fields, &[], &mut inside);
                around.complaint = around.complaint.take().or(inside.complaint);
                if inside.browse.is_some() {
                    request = Some(Request::Browse { material, term: at });
                }
                if table != before
                    && let Ok(changed) = table.try_into::<TermSpec>()
                {
                    *term = of_its_file(changed);
                }
            }
        });
    }
    if let Some(at) = removed {
        terms.remove(at);
    }
    let add = ui.horizontal(|ui| {
        ui.add_space(2.0);
        ui.button("Add a lobe").on_hover_text("A further BRDF, added to this one").clicked()
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

/// Another model with what carries over: roughness and colour.
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

/// Copy, paste, remove; whether it is to be removed.
fn actions_ui(ui: &mut Ui, material: &MaterialSpec, index: usize, is_default: bool) -> (Option<Request>, bool) {
    let mut request = None;
    let mut remove = false;
    ui.horizontal(|ui| {
        ui.add_space(2.0);
        if ui.button("Copy").on_hover_text("Copy this material as text (TOML)").clicked() {
            request = Some(Request::Copy { material: index });
        }
        if ui.button("Paste").on_hover_text("Replace it by the copied material").clicked() {
            request = Some(Request::Paste { slot: material.name.clone() });
        }
        if !is_default && ui.button("Use default").on_hover_text("Remove this material").clicked() {
            remove = true;
        }
    });
    (request, remove)
}

/// A measured term whose file was typed is of the kind that the file's ending says.
fn of_its_file(term: TermSpec) -> TermSpec {
    match &term {
        TermSpec::Merl { path } | TermSpec::Rgl { path } | TermSpec::Utia { path } | TermSpec::Npz { path } => {
            measured(path).unwrap_or(term)
        }
        _ => term,
    }
}

/// The measured term that a file holds, by its ending.
pub fn measured(path: &Path) -> Option<TermSpec> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "binary" => Some(TermSpec::Merl { path: path.to_owned() }),
        "bsdf" => Some(TermSpec::Rgl { path: path.to_owned() }),
        "bin" => Some(TermSpec::Utia { path: path.to_owned() }),
        "npz" => Some(TermSpec::Npz { path: path.to_owned() }),
        _ => None,
    }
}

/// Puts a term into a material; a material without a BRDF gets one.
pub fn set_term(scene: &mut Scene, material: usize, term: usize, with: TermSpec) {
    if scene.materials.is_empty() {
        scene.materials.push(grey());
    }
    let Some(material) = scene.materials.get_mut(material) else { return };
    match &mut material.brdf {
        Some(brdf) => {
            if let Some(place) = brdf.terms_mut().get_mut(term) {
                *place = with;
            }
        }
        none => *none = Some(BrdfSpec::One(with)),
    }
}

/// The slots of a scene, as far as they are known without its mesh: the family's own, and painted ones that have a material.
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
