//! The `[[material]]` tables: BRDF terms and colour.

use std::path::PathBuf;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::color;
use super::schema::number;
use super::{Field, FieldShape, Kind};

/// A material, assigned to the mesh slot of its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    pub name: String,
    /// Without one, the BRDF of the material `default`: variants in colour need say no more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brdf: Option<BrdfSpec>,
    /// Multiplies the sum of the terms.
    #[serde(default = "white", with = "color")]
    pub color: Vec3,
}

fn white() -> Vec3 {
    Vec3::ONE
}

const TERM: FieldShape = FieldShape::Tagged(TermSpec::kinds);
/// Colour weights and analytic parameters may gain energy, which is reported, not refused; beyond this it is a slip.
const GAIN_LIMIT: f64 = 1000.0;

impl MaterialSpec {
    pub fn fields() -> Vec<Field> {
        let brdf = FieldShape::AnyOf(&[TERM, FieldShape::List { of: &TERM, min: 1, max: 16 }]);
        vec![
            Field::required("name", FieldShape::Text, "The mesh slot it is for; `default` is for all others."),
            Field::new("brdf", "", brdf, None, "One term or a list of terms that are added."),
            Field::new("color", "", FieldShape::Color { max: GAIN_LIMIT }, None, "Multiplies the BRDF."),
        ]
    }
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

    pub fn terms_mut(&mut self) -> &mut [TermSpec] {
        match self {
            Self::One(term) => std::slice::from_mut(term),
            Self::Sum(terms) => terms,
        }
    }
}

/// A BRDF term as written in a scene (DESIGN.md, Sec. 3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum TermSpec {
    Lambertian {
        #[serde(default = "half_grey", with = "color")]
        albedo: Vec3,
    },
    BlinnPhong {
        #[serde(default = "blinn_phong_exponent")]
        exponent: f32,
        #[serde(default = "half_grey", with = "color")]
        specular: Vec3,
    },
    CookTorrance {
        #[serde(default = "default_roughness")]
        roughness: f32,
        #[serde(default = "metal", with = "color")]
        f0: Vec3,
    },
    Ward {
        #[serde(default = "default_roughness")]
        roughness: f32,
        #[serde(default = "half_grey", with = "color")]
        specular: Vec3,
    },
    Ggx {
        #[serde(default = "default_roughness")]
        roughness: f32,
        #[serde(default = "metal", with = "color")]
        f0: Vec3,
    },
    Merl {
        path: PathBuf,
    },
    Rgl {
        path: PathBuf,
    },
    Utia {
        path: PathBuf,
    },
    Npz {
        path: PathBuf,
    },
}

fn half_grey() -> Vec3 {
    Vec3::splat(0.5)
}

fn metal() -> Vec3 {
    Vec3::splat(0.9)
}

fn blinn_phong_exponent() -> f32 {
    50.0
}

fn default_roughness() -> f32 {
    0.3
}

impl TermSpec {
    /// The catalogue of BRDF models.
    pub fn kinds() -> Vec<Kind> {
        let color = |key, max, doc| Field::new(key, "", FieldShape::Color { max }, None, doc);
        let roughness = || {
            Field::new("roughness", "", number(1e-4, 2.0), Some(f64::from(default_roughness())), "Width of the lobe.")
        };
        let f0 = || color("f0", 1.0, "Reflectance at normal incidence (Schlick).");
        let specular = || color("specular", GAIN_LIMIT, "Strength of the lobe.");
        let exponent = Field::new(
            "exponent",
            "",
            FieldShape::Number { min: 0.0, max: 1e6, soft_max: 1000.0 },
            Some(f64::from(blinn_phong_exponent())),
            "Sharpness of the lobe.",
        );
        let path = |doc| Field::required("path", FieldShape::Path, doc);
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind(
                "lambertian",
                "Ideally matte.",
                vec![color("albedo", GAIN_LIMIT, "Part of the light that leaves again.")],
            ),
            kind("blinn_phong", "A cosine power of the half angle.", vec![exponent, specular()]),
            kind("cook_torrance", "Beckmann facets between V-cavities.", vec![roughness(), f0()]),
            kind("ward", "Ward's isotropic Gaussian lobe.", vec![roughness(), specular()]),
            kind("ggx", "GGX facets with Smith's shadowing; roughness is not squared.", vec![roughness(), f0()]),
            kind("merl", "A measured MERL table.", vec![path("The .binary file.")]),
            kind("rgl", "A measured isotropic RGL material.", vec![path("The .bsdf file.")]),
            kind("utia", "A measured UTIA material, averaged over azimuths.", vec![path("The .bin file.")]),
            kind("npz", "An export of this program that is isotropic.", vec![path("The .npz file.")]),
        ]
    }

    /// The name that stands in the file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Lambertian { .. } => "lambertian",
            Self::BlinnPhong { .. } => "blinn_phong",
            Self::CookTorrance { .. } => "cook_torrance",
            Self::Ward { .. } => "ward",
            Self::Ggx { .. } => "ggx",
            Self::Merl { .. } => "merl",
            Self::Rgl { .. } => "rgl",
            Self::Utia { .. } => "utia",
            Self::Npz { .. } => "npz",
        }
    }
}
