//! The `[[material]]` tables: BRDF terms and colour.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::color;
use super::schema::number;
use super::{Field, FieldShape, Kind};

/// A material for the mesh slot of the same name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    pub name: String,
    /// `None` means the BRDF of the material `default`, so that a colour variant needs only a colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brdf: Option<BrdfSpec>,
    /// Factor on the sum of the terms.
    #[serde(default = "white", with = "color")]
    pub color: Vec3,
}

fn white() -> Vec3 {
    Vec3::ONE
}

const TERM: FieldShape = FieldShape::Tagged(TermSpec::kinds);
/// Largest colour factor, of a material and of a texel of its colour image. Factors above 1 may gain energy, which the
/// health reports; a larger one is taken for a mistake.
pub const MAX_COLOR: f64 = 1000.0;

impl MaterialSpec {
    pub fn fields() -> Vec<Field> {
        let brdf = FieldShape::AnyOf(&[TERM, FieldShape::List { of: &TERM, min: 1, max: 16 }]);
        vec![
            Field::required(
                "name",
                FieldShape::Text,
                "Slot that the material is for; `default` is for all other slots.",
            ),
            Field::new(
                "brdf",
                "",
                brdf,
                None,
                "One term, or a list of terms to add. Without it, the BRDF of the material `default`.",
            ),
            Field::new("color", "", FieldShape::Color { max: MAX_COLOR }, None, "Factor on the BRDF."),
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

/// A BRDF term as a scene file writes it.
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
            Field::new(
                "roughness",
                "",
                number(1e-4, 2.0),
                Some(f64::from(default_roughness())),
                "Width of the lobe, used as α without squaring.",
            )
        };
        let f0 = || color("f0", 1.0, "Reflectance at normal incidence (Schlick).");
        let specular = || color("specular", MAX_COLOR, "Factor on the lobe.");
        let exponent = Field::new(
            "exponent",
            "",
            FieldShape::Number { min: 0.0, max: 1e6, soft_max: 1000.0 },
            Some(f64::from(blinn_phong_exponent())),
            "Exponent of the cosine; a larger one gives a narrower lobe.",
        );
        let path = |doc| Field::required("path", FieldShape::Path, doc);
        let kind = |kind, doc, fields| Kind { kind, doc, fields };
        vec![
            kind(
                "lambertian",
                "Ideally diffuse reflection.",
                vec![color("albedo", MAX_COLOR, "Fraction of the light that is reflected.")],
            ),
            kind("blinn_phong", "A power of the cosine between normal and half vector.", vec![exponent, specular()]),
            kind(
                "cook_torrance",
                "Beckmann microfacets with V-cavity shadowing and Schlick's Fresnel term.",
                vec![roughness(), f0()],
            ),
            kind("ward", "Ward's isotropic Gaussian lobe.", vec![roughness(), specular()]),
            kind("ggx", "GGX microfacets with Smith's shadowing and Schlick's Fresnel term.", vec![roughness(), f0()]),
            kind("merl", "A measured BRDF from the MERL database.", vec![path("The .binary file.")]),
            kind("rgl", "A measured isotropic BRDF from the RGL database.", vec![path("The .bsdf file.")]),
            kind(
                "utia",
                "A measured BRDF from the UTIA database, averaged over azimuths.",
                vec![path("The .bin file.")],
            ),
            kind("npz", "An isotropic `.npz` export of this program.", vec![path("The .npz file.")]),
        ]
    }

    /// The file of a measured BRDF; `None` for an analytic term.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Merl { path } | Self::Rgl { path } | Self::Utia { path } | Self::Npz { path } => Some(path),
            _ => None,
        }
    }

    /// As [`TermSpec::path`].
    pub fn path_mut(&mut self) -> Option<&mut PathBuf> {
        match self {
            Self::Merl { path } | Self::Rgl { path } | Self::Utia { path } | Self::Npz { path } => Some(path),
            _ => None,
        }
    }

    /// The name in the scene file.
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
