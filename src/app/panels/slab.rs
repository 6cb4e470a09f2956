//! The panel of a thin transparent slab: its faces, its material and its background. The lobe view shows its light.

use std::path::PathBuf;

use crate::scene::{Background, Kind, Scene, SlabFace, SlabSpec};
use eframe::egui::Ui;
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::controls;
use super::fields::{self, PanelContext};
use super::large_scale::edit;

/// A file that a slab reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlabFile {
    /// Slopes of the top or the bottom face.
    Table {
        is_top: bool,
    },
    /// Scene whose tile is the top or the bottom face.
    Tile {
        is_top: bool,
    },
    /// A captured sheet in place of both faces.
    Svbtdf,
    Background,
}

/// Draws the controls of the slab, which a scene may have or not. Returns a request for a file.
pub fn ui(ui: &mut Ui, scene: &mut Scene, context: &mut PanelContext) -> Option<SlabFile> {
    let mut has_slab = scene.slab.is_some();
    let tip = "The surface is a sheet of glass or plastic between two rough faces.";
    if ui.checkbox(&mut has_slab, "Thin transparent slab").on_hover_text(tip).changed() {
        if has_slab {
            let bottom = SlabFace::with_defaults("ggx").unwrap_or(SlabFace::Smooth {});
            scene.slab = Some(SlabSpec { bottom, ..SlabSpec::default() });
            scene.background = Background::with_defaults("checkerboard");
        } else {
            (scene.slab, scene.background) = (None, None);
        }
    }
    let slab = scene.slab.as_mut()?;
    let mut request = if slab.svbtdf.is_some() {
        captured_ui(ui, slab, context)
    } else {
        let top = face_ui(ui, "Top", &mut slab.top, true, context);
        let bottom = face_ui(ui, "Bottom", &mut slab.bottom, false, context);
        edit(ui, slab, &SlabSpec::fields(), &["top", "bottom", "svbtdf", "repeat"], context);
        let tip = "A sheet that `biscale capture` made of photographs, in place of both faces (.npz)";
        let captured = ui.button("Use a captured sheet…").on_hover_text(tip).clicked().then_some(SlabFile::Svbtdf);
        top.or(bottom).or(captured)
    };
    if let Some(background) = &mut scene.background {
        let mut removed = false;
        ui.push_id("background", |ui| {
            let now = background.kind();
            let kinds = Background::kinds();
            let of_file =
                tagged_ui(ui, "Background", background, now, &kinds, Background::with_defaults, "image", context);
            request = request.or(of_file.then_some(SlabFile::Background));
            let tip = "Behind the slab lies only the environment";
            removed = ui.button("Remove the background").on_hover_text(tip).clicked();
        });
        if removed {
            scene.background = None;
        }
    } else if ui.button("Add a background").on_hover_text("A plane behind the slab").clicked() {
        scene.background = Background::with_defaults("checkerboard");
    }
    request
}

/// Draws the controls of a captured sheet.
fn captured_ui(ui: &mut Ui, slab: &mut SlabSpec, context: &mut PanelContext) -> Option<SlabFile> {
    let fields: Vec<_> =
        SlabSpec::fields().into_iter().filter(|field| matches!(field.key, "svbtdf" | "repeat" | "thickness")).collect();
    let mut inside = PanelContext { unit: context.unit.clone(), ..PanelContext::default() };
    edit(ui, slab, &fields, &[], &mut inside);
    context.error = context.error.take().or(inside.error);
    if ui.button("Use two faces").on_hover_text("Faces with slopes in place of the captured sheet").clicked() {
        (slab.svbtdf, slab.repeat) = (None, [1, 1]);
    }
    inside.browse.map(|_| SlabFile::Svbtdf)
}

/// Draws the controls of a face. Returns a request for its file.
fn face_ui(
    ui: &mut Ui,
    caption: &str,
    face: &mut SlabFace,
    is_top: bool,
    context: &mut PanelContext,
) -> Option<SlabFile> {
    ui.push_id(caption, |ui| {
        let now = face.kind();
        let of_file = tagged_ui(ui, caption, face, now, &SlabFace::kinds(), SlabFace::with_defaults, "table", context);
        of_file.then_some(match face {
            SlabFace::Tile(_) => SlabFile::Tile { is_top },
            _ => SlabFile::Table { is_top },
        })
    })
    .inner
}

/// Draws the choice of a kind and its fields. The kind `of_file` needs a file first. Returns true if the user requests one.
#[expect(clippy::too_many_arguments, reason = "one call for faces and one for backgrounds, which share no type")]
fn tagged_ui<T: Serialize + DeserializeOwned>(
    ui: &mut Ui,
    caption: &str,
    value: &mut T,
    now: &str,
    kinds: &[Kind],
    with_defaults: impl Fn(&str) -> Option<T>,
    of_file: &str,
    context: &mut PanelContext,
) -> bool {
    let Some(kind) = kinds.iter().find(|kind| kind.kind == now) else { return false };
    let chosen = fields::row(ui, caption, kind.doc, |ui| controls::kind_ui(ui, caption, now, kinds));
    if chosen == Some(of_file) {
        return true;
    }
    if let Some(chosen) = chosen.and_then(with_defaults) {
        *value = chosen;
        return false;
    }
    let mut inside = PanelContext { unit: context.unit.clone(), ..PanelContext::default() };
    edit_kind(ui, value, kind, &mut inside);
    context.error = context.error.take().or(inside.error);
    inside.browse.is_some()
}

/// Draws the fields of a kind.
fn edit_kind<T: Serialize + DeserializeOwned>(ui: &mut Ui, value: &mut T, kind: &Kind, context: &mut PanelContext) {
    let Ok(mut table) = Table::try_from(&*value) else { return };
    let before = table.clone();
    fields::table_ui(ui, &mut table, &kind.fields, &[], context);
    if table != before {
        match table.try_into() {
            Ok(changed) => *value = changed,
            Err(error) => context.error = Some(error.message().to_owned()),
        }
    }
}

/// Sets a file that the user chose.
pub fn set_file(scene: &mut Scene, file: SlabFile, path: PathBuf) {
    if file == SlabFile::Background {
        let mut image = match scene.background.take() {
            Some(Background::Image(image)) => image,
            _ => crate::scene::ImagePlane::default(),
        };
        image.path = path;
        scene.background = Some(Background::Image(image));
        return;
    }
    let Some(slab) = &mut scene.slab else { return };
    let (SlabFile::Table { is_top } | SlabFile::Tile { is_top }) = file else {
        // A captured sheet has no faces.
        (slab.top, slab.bottom) = (SlabFace::Smooth {}, SlabFace::Smooth {});
        slab.svbtdf = Some(path);
        return;
    };
    let face = if is_top { &mut slab.top } else { &mut slab.bottom };
    match (face, file) {
        (SlabFace::Table(table), SlabFile::Table { .. }) => table.path = path,
        (SlabFace::Tile(tile), SlabFile::Tile { .. }) => tile.scene = Some(path),
        (face, SlabFile::Tile { .. }) => {
            *face = SlabFace::Tile(crate::scene::TileFace { scene: Some(path), ..Default::default() });
        }
        (face, _) => *face = SlabFace::Table(crate::scene::TableFace { path, ..Default::default() }),
    }
}
