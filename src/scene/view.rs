//! What is seen, and how it is lit and looked at: `[object]`, `[light]`, `[camera]`.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::color;
use super::schema::{number, scene_table};
use super::{Field, FieldShape};

/// Objects that `object.kind` names; `mesh` reads `object.path`.
pub const OBJECT_KINDS: &[&str] = &["sphere", "plate", "cup", "cylinder", "pillow", "skirt", "teapot", "mesh"];

/// Tone maps that `camera.tone_map` names.
pub const TONE_MAPS: &[&str] = &["filmic", "plain"];

scene_table! {
    /// The large-scale object that wears the material.
    Object {
        /// FieldShape: sphere, plate, cup, cylinder, pillow, skirt, teapot or mesh.
        kind: String = "sphere".to_owned(), FieldShape::Choice(OBJECT_KINDS), "";
        /// The OBJ file of the kind `mesh`.
        #[serde(skip_serializing_if = "Option::is_none")]
        path: Option<PathBuf> = None, FieldShape::Path, "";
    }
}

const LIGHT: FieldShape = FieldShape::Table(DirectionalSpec::fields);

scene_table! {
    /// What lights it.
    Light {
        /// A built-in sky (studio, clear_sky, overcast_sky, sun, none) or a .hdr / .exr file.
        environment: String = "studio".to_owned(), FieldShape::Text, "";
        /// How many directional lights stand for the environment.
        count: usize = 32, FieldShape::Integer { min: 0, max: 4096 }, "";
        /// Turns the environment about the vertical.
        rotation_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
        /// Scales the environment's radiance.
        intensity: f32 = 1.0, FieldShape::Number { min: 0.0, max: 1e6, soft_max: 10.0 }, "";
        /// Further directional lights.
        directional: Vec<DirectionalSpec> = Vec::new(), FieldShape::List { of: &LIGHT, min: 0, max: 4096 }, "";
    }
}

/// One directional light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalSpec {
    /// Towards the light, world frame, y up; any length but zero.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light.
    #[serde(with = "color")]
    pub irradiance: Vec3,
}

impl DirectionalSpec {
    pub fn fields() -> Vec<Field> {
        let direction = FieldShape::Vector { length: 3, min: -1e6, max: 1e6 };
        vec![
            Field::required("direction", direction, "Towards the light, y up; any length but zero."),
            Field::required(
                "irradiance",
                FieldShape::Color { max: 1e9 },
                "Irradiance on a surface that faces the light.",
            ),
        ]
    }
}

scene_table! {
    /// Where the picture is taken from; framed automatically where a scene has none.
    Camera {
        /// Turns the camera about the vertical.
        azimuth_deg: f32 = 25.0, number(-360.0, 360.0), "degrees";
        /// Height of the camera above the horizon.
        elevation_deg: f32 = 20.0, number(-90.0, 90.0), "degrees";
        /// Distance in radii of the object's bounding sphere; 0 frames the object.
        distance: f32 = 0.0, FieldShape::Number { min: 0.0, max: 1e4, soft_max: 20.0 }, "radii";
        /// Moves what is looked at across the picture: to the right and up.
        pan: Vec2 = Vec2::ZERO, FieldShape::Vector { length: 2, min: -100.0, max: 100.0 }, "radii";
        /// Vertical field of view.
        fov_deg: f32 = 30.0, number(1.0, 150.0), "degrees";
        /// Exposure in stops.
        exposure_ev: f32 = 0.0, FieldShape::Number { min: -40.0, max: 40.0, soft_max: 8.0 }, "EV";
        /// How radiance becomes a pixel: filmic or plain.
        tone_map: String = "filmic".to_owned(), FieldShape::Choice(TONE_MAPS), "";
    }
}
