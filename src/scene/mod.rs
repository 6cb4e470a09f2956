//! The scene: plain types that mirror the scene file, their defaults, and their validation.
//! Lengths are in tile units, fields that end in `_deg` are in degrees, and colours are linear RGB.
//!
//! [`open`] reads a file or a shipped name; the catalogue ([`Field`]) lists every key with its range and meaning.

mod assignments;
mod background;
mod check;
mod color;
mod color_map;
mod editable;
mod edits;
mod effects;
pub mod files;
mod key_list;
mod load;
mod material;
mod overrides;
mod painted;
mod quality;
mod schema;
pub mod shipped;
pub mod slab;
mod tile;
mod variants;
mod view;

#[cfg(test)]
mod catalogue_doc;
#[cfg(test)]
mod overrides_tests;
#[cfg(test)]
pub(crate) mod tests;

use std::collections::HashSet;
use std::sync::LazyLock;

use glam::Vec3;
use serde::{Deserialize, Serialize};

pub use assignments::assignments;
pub use background::{Background, Checkerboard, ImagePlane};
#[cfg(feature = "cli")]
pub(crate) use check::nearest;
pub use color_map::{
    Blend, ColorLayer, ColorMap, Combine, Driver, DriverSum, GaussianSurface, Gaussianize, GradientStop,
    HeightDistribution, HeightDriver, LayerWeight, MAX_CELLS, NoiseBasis, NoiseDriver, SlopeAlong, Steepness,
    StopEvaluation, StopUnit, TextureDriver, WeightedDriver,
};
pub use editable::{EditableScene, SceneBundle};
pub use effects::{Effects, Switch};
pub use key_list::{KeyEntry, keys_of};
pub use load::{
    LoadedScene, is_standard_input, load, load_with_overrides, open, open_argument, parse, parse_table, shown_name,
};
pub use material::{BrdfSpec, MAX_COLOR, MaterialSpec, TermSpec};
pub use painted::{Painted, Pixels};
pub use quality::{BACKENDS, INTERPOLATIONS, METHODS, PRESETS, Quality, VISIBILITIES};
pub use schema::{Field, FieldShape, Kind, number};
pub use slab::{Alpha, RoughFace, SlabFace, SlabMethod, SlabSpec, TableFace, TileFace};
pub use tile::{
    Arrangement, Backing, CrossSection, Flat, FlatPattern, FloatPattern, Geometry, GrooveProfile, Grooves, Heightfield,
    MeshFile, Pyramids, Rods, Tile, Weave, WeavePattern, millimetres,
};
pub use variants::{describes_material, variant};
pub use view::{Camera, DirectionalSpec, Light, OBJECT_KINDS, Object, TONE_MAPS};

use check::{PathStep, Problem};

use crate::base::{InputError, Result};

/// A whole scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    #[serde(default = "one")]
    pub version: u32,
    pub tile: Tile,
    #[serde(default, rename = "material", skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<MaterialSpec>,
    #[serde(default)]
    pub object: Object,
    #[serde(default)]
    pub light: Light,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Colours that the surface's place, heights and slopes drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color_map: Option<ColorMap>,
    #[serde(default)]
    pub quality: Quality,
    #[serde(default, skip_serializing_if = "Effects::is_default")]
    pub effects: Effects,
    /// A thin transparent slab; without it, the scene reflects only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slab: Option<SlabSpec>,
    /// The background seen through the slab; without it, the environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<Background>,
}

fn one() -> u32 {
    1
}

/// The material of a slot after all lookups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlotMaterial<'a> {
    /// Index into [`Scene::materials`]; `None` for the grey of a scene without materials.
    pub index: Option<usize>,
    pub name: &'a str,
    pub brdf: &'a BrdfSpec,
    /// Factor on the BRDF.
    pub color: Vec3,
}

/// BRDF of a scene without materials.
static GREY: LazyLock<BrdfSpec> = LazyLock::new(|| BrdfSpec::One(TermSpec::Lambertian { albedo: Vec3::splat(0.5) }));

const DEFAULT_MATERIAL: &str = "default";
const MATERIAL: FieldShape = FieldShape::Table(MaterialSpec::fields);

impl Scene {
    /// A scene with this geometry and defaults for everything else.
    pub fn of(geometry: Geometry) -> Self {
        Self {
            version: 1,
            tile: Tile::of(geometry),
            materials: Vec::new(),
            object: Object::default(),
            light: Light::default(),
            camera: None,
            color_map: None,
            quality: Quality::default(),
            effects: Effects::default(),
            slab: None,
            background: None,
        }
    }

    /// The catalogue of the whole scene file.
    pub fn fields() -> Vec<Field> {
        let optional = |key, shape, doc| Field::new(key, "", shape, None, doc);
        vec![
            optional("version", FieldShape::Integer { min: 1, max: 1 }, "Version of the file format."),
            Field::required(
                "tile",
                FieldShape::Table(Tile::fields),
                "The tile: one period of the small-scale surface.",
            ),
            optional(
                "material",
                FieldShape::List { of: &MATERIAL, min: 0, max: 4096 },
                "Materials, each for the slot of its name.",
            ),
            optional("object", FieldShape::Table(Object::fields), "The large-scale object."),
            optional("light", FieldShape::Table(Light::fields), "Lighting of the object."),
            optional(
                "camera",
                FieldShape::Table(Camera::fields),
                "The camera; without it, the object is framed automatically.",
            ),
            optional(
                "color_map",
                FieldShape::Table(ColorMap::fields),
                "Colour maps of textures, noise, heights and slopes; they multiply the materials.",
            ),
            optional("quality", FieldShape::Table(Quality::fields), "Accuracy and backend."),
            optional("effects", FieldShape::Table(Effects::fields), "Effects that are forced on or off."),
            optional("slab", FieldShape::Table(SlabSpec::fields), "A thin transparent slab with two faces."),
            optional(
                "background",
                FieldShape::Tagged(Background::kinds),
                "What is seen through the slab; without it, the environment.",
            ),
        ]
    }

    /// The material of a mesh slot: its own, else `default`, else (in a scene without materials) a grey Lambertian one.
    ///
    /// # Errors
    /// The scene has materials, but none with the slot's name and no `default`.
    pub fn material_for_slot(&self, slot: &str) -> Result<SlotMaterial<'_>> {
        if self.materials.is_empty() {
            return Ok(SlotMaterial { index: None, name: DEFAULT_MATERIAL, brdf: &GREY, color: Vec3::ONE });
        }
        let find = |name: &str| self.materials.iter().position(|material| material.name == name);
        let index = find(slot).or_else(|| find(DEFAULT_MATERIAL)).ok_or_else(|| {
            let names: Vec<String> = self.materials.iter().map(|material| format!("`{}`", material.name)).collect();
            let expected = match slot {
                DEFAULT_MATERIAL => format!("a material `{DEFAULT_MATERIAL}`"),
                _ => format!("a material `{slot}` or `{DEFAULT_MATERIAL}`"),
            };
            let error = InputError::new("material", names.join(", "), expected);
            match check::nearest(slot, self.materials.iter().map(|material| &*material.name)) {
                Some(name) => error.with_hint(format!("if `{name}` is meant for this part, call it `{slot}`")),
                None => error,
            }
        })?;
        let material = &self.materials[index];
        let brdf = material
            .brdf
            .as_ref()
            .or_else(|| find(DEFAULT_MATERIAL).and_then(|index| self.materials[index].brdf.as_ref()));
        let brdf = brdf.ok_or_else(|| {
            InputError::new(
                format!("material.{}.brdf", material.name),
                "nothing",
                "a BRDF here or in the material `default`",
            )
        })?;
        Ok(SlotMaterial { index: Some(index), name: &material.name, brdf, color: material.color })
    }

    /// Materials that no slot uses and whose names resemble that of a slot without a material of its own: `(name, slot)`.
    pub fn misspelt_materials<'a>(&'a self, slots: &'a [String]) -> Vec<(&'a str, &'a str)> {
        let has = |slot: &str| self.materials.iter().any(|material| material.name == slot);
        let free = || slots.iter().map(String::as_str).filter(|slot| !has(slot));
        let names = self.materials.iter().map(|material| &*material.name);
        let unused = names.filter(|name| *name != DEFAULT_MATERIAL && !slots.iter().any(|slot| slot == name));
        // The rule of overrides, which take such a name for a typing error.
        let is_near = |name: &str, slot: &str| strsim::damerau_levenshtein(&name.to_lowercase(), slot) <= 2;
        unused.filter_map(|name| Some((name, free().find(|slot| is_near(name, slot))?))).collect()
    }

    /// Checks rules that relate several fields, which the catalogue cannot express.
    fn check_relations(&self) -> std::result::Result<(), Problem> {
        let key = |name: &str| PathStep::Key(name.to_owned());
        let problem = |path: Vec<PathStep>, found: &str, expected: &str| Err(Problem::new(&path, found, expected));
        let geometry = |name: &str| vec![key("tile"), key("geometry"), key(name)];
        match &self.tile.geometry {
            Geometry::Mesh(mesh) if mesh.path.as_os_str().is_empty() => {
                return problem(geometry("path"), "nothing", "an OBJ file");
            }
            Geometry::Heightfield(field) => match (&field.path, &field.values) {
                (Some(_), Some(_)) => {
                    return problem(geometry("values"), "both `path` and `values`", "one of them");
                }
                (None, None) => {
                    return problem(geometry("path"), "nothing", "`path` (an image) or `values` (rows of heights)");
                }
                (None, Some(rows)) if rows.iter().any(|row| row.len() != rows[0].len()) => {
                    return problem(geometry("values"), "rows of different lengths", "rows of one length");
                }
                _ => {}
            },
            Geometry::Weave(Weave { pattern: WeavePattern::Matrix(rows), .. })
                if rows.iter().any(|row| row.len() != rows[0].len()) =>
            {
                return problem(geometry("pattern"), "rows of different lengths", "rows of one length");
            }
            _ => {}
        }
        for (side, face) in self.slab.iter().flat_map(SlabSpec::faces) {
            if face.path().is_some_and(|path| path.as_os_str().is_empty()) {
                let key_of_path = if matches!(face, SlabFace::Table(_)) { "path" } else { "scene" };
                return problem(vec![key("slab"), key(side), key(key_of_path)], "nothing", "a file");
            }
        }
        if let Some(background) = &self.background {
            if self.slab.is_none() {
                return problem(vec![key("background")], "a background without a slab", "a table [slab] beside it");
            }
            if background.path().is_some_and(|path| path.as_os_str().is_empty()) {
                return problem(vec![key("background"), key("path")], "nothing", "an image file");
            }
        }
        if let Some(side) = self.slab.as_ref().and_then(SlabSpec::face_beside_svbtdf) {
            let found = format!("`svbtdf` and `{side}`");
            return problem(
                vec![key("slab"), key("svbtdf")],
                &found,
                "a captured sheet, or the faces `top` and `bottom`",
            );
        }
        if let Some(map) = &self.color_map {
            map.check(self)?;
        }
        let mut names = HashSet::new();
        for (index, material) in self.materials.iter().enumerate() {
            let path = |field: &str| vec![key("material"), PathStep::Entry(index, None), key(field)];
            if !names.insert(material.name.as_str()) {
                return problem(path("name"), &format!("`{}` a second time", material.name), "each name once");
            }
            let inherits = self.materials.iter().any(|other| other.name == DEFAULT_MATERIAL && other.brdf.is_some());
            if material.brdf.is_none() && !inherits {
                return problem(path("brdf"), "nothing", "a BRDF here or in the material `default`");
            }
        }
        if self.object.kind == "mesh" && self.object.path.is_none() {
            return problem(vec![key("object"), key("path")], "nothing", "an OBJ file");
        }
        for (index, light) in self.light.directional.iter().enumerate() {
            if light.direction.try_normalize().is_none() {
                let path = vec![key("light"), key("directional"), PathStep::Entry(index, None), key("direction")];
                return problem(path, "a vector without length", "a direction towards the light");
            }
        }
        Ok(())
    }
}
