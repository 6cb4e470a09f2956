//! Colours in scene files: a linear RGB triple, or one number for all three channels.

use glam::Vec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Deserialize)]
#[serde(untagged)]
enum ScalarOrTriple {
    Scalar(f32),
    Triple([f32; 3]),
}

/// Reads a colour, for `#[serde(with = "color")]`. A colour is always written as a triple, so that files look alike.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Ok(match ScalarOrTriple::deserialize(deserializer)? {
        ScalarOrTriple::Scalar(value) => Vec3::splat(value),
        ScalarOrTriple::Triple(values) => Vec3::from_array(values),
    })
}

pub fn serialize<S: Serializer>(color: &Vec3, serializer: S) -> Result<S::Ok, S::Error> {
    color.to_array().serialize(serializer)
}
