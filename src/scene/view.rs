//! The tables `[object]`, `[light]` and `[camera]`.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::color;
use super::schema::{number, scene_table};
use super::{Field, FieldShape};

/// Values of `object.kind`; `mesh` reads the file `object.path`.
pub const OBJECT_KINDS: &[&str] =
    &["sphere", "plate", "cup", "cylinder", "pillow", "skirt", "teapot", "bear", "snake", "sheet", "mesh"];

/// Values of `camera.tone_map`.
pub const TONE_MAPS: &[&str] = &["filmic", "plain"];

scene_table! {
    /// The large-scale object that the tile covers.
    Object {
        /// Shape: sphere, plate, cup, cylinder, pillow, skirt, teapot, bear, snake, sheet or mesh.
        kind: String = "sphere".to_owned(), FieldShape::Choice(OBJECT_KINDS), "";
        /// OBJ file; required if the kind is `mesh`.
        #[serde(skip_serializing_if = "Option::is_none")]
        path: Option<PathBuf> = None, FieldShape::Path, "";
    }
}

const LIGHT: FieldShape = FieldShape::Table(DirectionalSpec::fields);

scene_table! {
    /// Lighting of the object: an environment and directional lights.
    Light {
        /// Built-in environment (studio, clear_sky, overcast_sky, sun, none) or a .hdr or .exr file.
        environment: String = "studio".to_owned(), FieldShape::Text, "";
        /// Number of directional lights that represent the environment.
        count: usize = 32, FieldShape::Integer { min: 0, max: 4096 }, "";
        /// Rotation of the environment about the vertical axis.
        rotation_deg: f32 = 0.0, number(-360.0, 360.0), "degrees";
        /// Factor on the environment's radiance.
        intensity: f32 = 1.0, FieldShape::Number { min: 0.0, max: 1e6, soft_max: 10.0 }, "";
        /// Additional directional lights.
        directional: Vec<DirectionalSpec> = Vec::new(), FieldShape::List { of: &LIGHT, min: 0, max: 4096 }, "";
    }
}

/// One directional light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalSpec {
    /// Direction towards the light in the world frame, y up; any length except zero.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light.
    #[serde(with = "color")]
    pub irradiance: Vec3,
}

impl DirectionalSpec {
    pub fn fields() -> Vec<Field> {
        let direction = FieldShape::Vector { length: 3, min: -1e6, max: 1e6 };
        vec![
            Field::required("direction", direction, "Direction towards the light, y up; any length except zero."),
            Field::required(
                "irradiance",
                FieldShape::Color { max: 1e9 },
                "Irradiance on a surface that faces the light.",
            ),
        ]
    }
}

scene_table! {
    /// The camera. A scene without this table is framed automatically.
    Camera {
        /// Azimuth of the camera about the vertical axis.
        azimuth_deg: f32 = 25.0, number(-360.0, 360.0), "degrees";
        /// Elevation of the camera above the horizon.
        elevation_deg: f32 = 20.0, number(-90.0, 90.0), "degrees";
        /// Distance in radii of the object's bounding sphere; 0 fits the object into the image.
        distance: f32 = 0.0, FieldShape::Number { min: 0.0, max: 1e4, soft_max: 20.0 }, "radii";
        /// Offset of the camera's target to the right and up, in radii of the bounding sphere.
        pan: Vec2 = Vec2::ZERO, FieldShape::Vector { length: 2, min: -100.0, max: 100.0 }, "radii";
        /// Field of view across the shorter side of the image.
        fov_deg: f32 = 30.0, number(1.0, 150.0), "degrees";
        /// Exposure in stops; each stop doubles the brightness.
        exposure_ev: f32 = 0.0, FieldShape::Number { min: -40.0, max: 40.0, soft_max: 8.0 }, "EV";
        /// Tone map from radiance to pixel values: filmic or plain.
        tone_map: String = "filmic".to_owned(), FieldShape::Choice(TONE_MAPS), "";
    }
}
