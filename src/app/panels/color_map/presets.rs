//! Stops to start from, in deviations from the driver's mean.

use crate::scene::GradientStop;
use glam::Vec3;

/// A named list of stops.
pub struct PresetMap {
    pub name: &'static str,
    pub doc: &'static str,
    stops: &'static [(f64, [f32; 3])],
}

impl PresetMap {
    pub fn stops(&self) -> Vec<GradientStop> {
        self.stops.iter().map(|&(value, color)| GradientStop { value, color: Vec3::from_array(color) }).collect()
    }
}

/// The preset maps. A new layer has the first one.
pub const PRESETS: [PresetMap; 7] = [
    PresetMap {
        name: "Snow on rock",
        doc: "Rock below, snow above a sharp line",
        stops: &[(-1.2, [0.16, 0.1, 0.06]), (0.4, [0.22, 0.2, 0.18]), (0.6, [0.9, 0.92, 0.95])],
    },
    PresetMap {
        name: "Landscape",
        doc: "Water, sand, grass, rock and snow",
        stops: &[
            (-1.0, [0.02, 0.08, 0.25]),
            (-0.7, [0.05, 0.25, 0.4]),
            (-0.7, [0.5, 0.4, 0.2]),
            (-0.4, [0.1, 0.25, 0.05]),
            (0.5, [0.2, 0.18, 0.15]),
            (1.2, [0.9, 0.9, 0.9]),
        ],
    },
    PresetMap {
        name: "Four bands",
        doc: "Hard bands: the colours whose mean is furthest from the colour of the mean",
        stops: &[
            (-1.2, [0.6, 0.3, 0.1]),
            (-1.2, [0.05, 0.05, 0.05]),
            (-0.4, [0.05, 0.05, 0.05]),
            (-0.4, [0.9, 0.8, 0.2]),
            (0.3, [0.9, 0.8, 0.2]),
            (0.3, [0.1, 0.4, 0.7]),
            (1.0, [0.1, 0.4, 0.7]),
            (1.0, [0.95, 0.95, 0.95]),
        ],
    },
    PresetMap {
        name: "Rust",
        doc: "Bare metal with rust in the low places",
        stops: &[(-0.6, [0.25, 0.07, 0.02]), (0.1, [0.4, 0.16, 0.05]), (0.2, [0.55, 0.55, 0.56])],
    },
    PresetMap {
        name: "Blue and red sides",
        doc: "Blue for low values, red for high ones: two sides of a slope",
        stops: &[(-1.0, [0.05, 0.12, 0.7]), (0.0, [0.8, 0.8, 0.75]), (1.0, [0.75, 0.1, 0.04])],
    },
    PresetMap {
        name: "Thin line",
        doc: "One line on a dark ground",
        stops: &[
            (0.4, [0.03, 0.03, 0.03]),
            (0.4, [1.0, 0.35, 0.05]),
            (0.6, [1.0, 0.35, 0.05]),
            (0.6, [0.03, 0.03, 0.03]),
        ],
    },
    PresetMap { name: "Grey ramp", doc: "Black to white", stops: &[(-2.0, [0.0, 0.0, 0.0]), (2.0, [1.0, 1.0, 1.0])] },
];
