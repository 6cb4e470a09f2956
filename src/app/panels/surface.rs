//! The panel of the small-scale surface: family, parameters, extent.

use std::path::{Path, PathBuf};

use crate::scene::{Field, Geometry, GrooveProfile, Heightfield, Painted, Scene, Tile};
use eframe::egui::Ui;
use toml::{Table, Value};

use super::controls;
use super::fields::{self, PanelContext};
use crate::app::worker::Subject;

/// Initial image of a height field.
const FIRST_HEIGHTS: &str = "asset:leather.png";

/// Draws the controls of the tile. `name` is the document's name, which painted files contain.
pub fn ui(ui: &mut Ui, scene: &mut Scene, painted: &Painted, name: &str, context: &mut PanelContext) {
    context.unit.clone_from(&scene.tile.unit);
    let kinds = Geometry::kinds();
    let now = scene.tile.geometry.kind();
    let doc = kinds.iter().find(|kind| kind.kind == now).map_or("", |kind| kind.doc);
    let chosen = fields::row(ui, "Surface", doc, |ui| {
        controls::pictured_kind_ui(ui, "surface", now, &kinds, (&context.thumbnails, Subject::Surface))
    });
    if let Some(kind) = chosen {
        match initial_geometry(kind, painted, name) {
            Some(geometry) => scene.tile.geometry = geometry,
            // A mesh needs a file first.
            None => context.browse = Some("mesh"),
        }
    }
    if let Some(kind) = kinds.iter().find(|kind| kind.kind == scene.tile.geometry.kind())
        && let Ok(mut table) = Table::try_from(&scene.tile.geometry)
    {
        let before = table.clone();
        context.ignored = ignored(&scene.tile.geometry);
        fields::table_ui(ui, &mut table, &kind.fields, &[], context);
        context.ignored = None;
        if table != before
            && let Ok(geometry) = table.try_into::<Geometry>()
        {
            scene.tile.geometry = geometry;
        }
    }
    tile_ui(ui, &mut scene.tile, context);
}

/// The parameter that the profile of grooves ignores, and why.
fn ignored(geometry: &Geometry) -> Option<(&'static str, &'static str)> {
    let Geometry::Grooves(grooves) = geometry else { return None };
    match grooves.profile {
        GrooveProfile::Trapezoid => None,
        GrooveProfile::V => Some(("bottom_width", "V-shaped grooves have no bottom")),
        GrooveProfile::Rectangular => Some(("side_angle_deg", "the sides of rectangular grooves are vertical")),
        GrooveProfile::U => Some(("side_angle_deg", "U-shaped grooves are rounded")),
    }
}

/// Returns a family with initial parameters; `None` for a mesh, which needs a file.
fn initial_geometry(kind: &str, painted: &Painted, name: &str) -> Option<Geometry> {
    match kind {
        "mesh" => None,
        "heightfield" => {
            let painted = painted.heights.as_ref().map(|_| PathBuf::from(format!("{name}_heights.exr")));
            let path = Some(painted.unwrap_or_else(|| PathBuf::from(FIRST_HEIGHTS)));
            Some(Geometry::Heightfield(Heightfield { height_scale: 0.1, path, ..Default::default() }))
        }
        kind => Geometry::with_defaults(kind),
    }
}

/// Returns the geometry for a dropped or chosen file: an OBJ mesh, or an image of heights.
pub fn of_file(path: &Path, scene: &Scene) -> Option<Geometry> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "obj" => Some(Geometry::Mesh(crate::scene::MeshFile { path: path.to_owned() })),
        "png" | "tif" | "tiff" | "jpg" | "jpeg" => {
            let height_scale = match &scene.tile.geometry {
                Geometry::Heightfield(field) => field.height_scale,
                _ => 0.1,
            };
            let path = Some(path.to_owned());
            Some(Geometry::Heightfield(Heightfield { height_scale, path, ..Default::default() }))
        }
        _ => None,
    }
}

fn tile_ui(ui: &mut Ui, tile: &mut Tile, context: &mut PanelContext) {
    let Ok(mut table) = Table::try_from(&*tile) else { return };
    let geometry = table.remove("geometry").unwrap_or(Value::Boolean(false));
    let before = table.clone();
    // The paint panel opens images. This panel lists only those that the tile has.
    let is_shown = |field: &Field| match field.key {
        "geometry" => false,
        "color_path" | "slot_path" => table.contains_key(field.key),
        _ => true,
    };
    let fields: Vec<_> = Tile::fields().into_iter().filter(is_shown).collect();
    ui.add_space(4.0);
    fields::table_ui(ui, &mut table, &fields, &[], context);
    if table != before {
        table.insert("geometry".to_owned(), geometry);
        if let Ok(changed) = table.try_into::<Tile>()
            && changed.size.min_element() >= 1e-3
        {
            *tile = changed;
        }
    }
}
