//! What a person edits: plain types that mirror the scene file, their defaults, and their validation.
//! Lengths are in tile units, angles in radians unless a field ends in `_deg`, colour is linear RGB.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// A whole scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    #[serde(default = "one")]
    pub version: u32,
    pub tile: Tile,
    #[serde(default, rename = "material", skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<Material>,
    #[serde(default)]
    pub object: Object,
    #[serde(default)]
    pub light: Light,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    #[serde(default)]
    pub quality: Quality,
}

fn one() -> u32 {
    1
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    #[serde(default = "unit_square")]
    pub size: Vec2,
    #[serde(default = "millimetre")]
    pub unit: String,
    pub geometry: Geometry,
}

fn unit_square() -> Vec2 {
    Vec2::ONE
}

fn millimetre() -> String {
    "mm".to_owned()
}

/// The geometry families; each is a struct of its own in `scene::geometry`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Geometry {
    Flat {},
    Mesh { path: PathBuf },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    pub name: String,
    pub brdf: BrdfSpec,
    #[serde(default = "white")]
    pub color: Vec3,
}

fn white() -> Vec3 {
    Vec3::ONE
}

/// One BRDF term or a sum of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum BrdfSpec {
    One(TermSpec),
    Sum(Vec<TermSpec>),
}

impl BrdfSpec {
    pub fn terms(&self) -> &[TermSpec] {
        match self {
            Self::One(term) => std::slice::from_ref(term),
            Self::Sum(terms) => terms,
        }
    }
}

/// A BRDF term as written in a scene (DESIGN.md, Sec. 3). Colours accept a scalar for an RGB triple.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum TermSpec {
    Lambertian { albedo: Vec3 },
    BlinnPhong { exponent: f32, specular: Vec3 },
    CookTorrance { roughness: f32, f0: Vec3 },
    Ward { roughness: f32, specular: Vec3 },
    Ggx { roughness: f32, f0: Vec3 },
    Merl { path: PathBuf },
    Rgl { path: PathBuf },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Object {
    /// `sphere`, `plate`, `cup`, `cylinder`, `pillow`, `skirt`, `teapot` or `mesh`.
    pub kind: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
}

impl Default for Object {
    fn default() -> Self {
        Self { kind: "sphere".to_owned(), path: None }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// `studio`, `clear_sky`, `overcast_sky`, `sun`, `none`, or a path to a .hdr / .exr file.
    pub environment: String,
    /// How many directional lights stand for the environment.
    pub count: usize,
    /// Turns the environment about the vertical.
    pub rotation_deg: f32,
    /// Scales the environment's radiance.
    pub intensity: f32,
    pub directional: Vec<DirectionalSpec>,
}

impl Default for Light {
    fn default() -> Self {
        Self { environment: "studio".to_owned(), count: 32, rotation_deg: 0.0, intensity: 1.0, directional: Vec::new() }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalSpec {
    /// Towards the light, world frame, y up; any length but zero.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Vec3,
}

/// Where the picture is taken from; framed automatically where a scene has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    pub azimuth_deg: f32,
    pub elevation_deg: f32,
    /// Distance in radii of the object's bounding sphere; 0 frames the object.
    pub distance: f32,
    pub fov_deg: f32,
    pub exposure_ev: f32,
    /// `filmic` or `plain`.
    pub tone_map: String,
}

impl Default for Camera {
    fn default() -> Self {
        Self { azimuth_deg: 25.0, elevation_deg: 20.0, distance: 0.0, fov_deg: 30.0, exposure_ev: 0.0, tone_map: "filmic".to_owned() }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Quality {
    /// `draft`, `standard`, `fine`, `reference` or `wu2011`.
    pub preset: String,
    pub seed: u64,
    /// `auto`, `gpu` or `cpu`.
    pub backend: String,
}

impl Default for Quality {
    fn default() -> Self {
        Self { preset: "standard".to_owned(), seed: 1, backend: "auto".to_owned() }
    }
}
