//! Scenes whose tile has Gaussian heights under a colour map.

use std::sync::Arc;

use glam::{DVec2, UVec2};

use crate::color_map::statistics::DriverGrid;
use crate::scene::{self, LoadedScene, NoiseBasis, NoiseDriver, Painted, Pixels};

/// Stops of the measurements: four hard bands, and a smooth ramp.
pub const BANDS: &str = "stops = [[-1.2, [0.6, 0.3, 0.1]], [-1.2, 0.05], [-0.4, 0.05], [-0.4, [0.9, 0.8, 0.2]], \
    [0.3, [0.9, 0.8, 0.2]], [0.3, [0.1, 0.4, 0.7]], [1.0, [0.1, 0.4, 0.7]], [1.0, 0.95]]";
pub const RAMP: &str = "stops = [[-2, [0.05, 0.05, 0.2]], [0, [0.1, 0.5, 0.1]], [2, [1, 0.95, 0.8]]]";

/// Deviation of the slopes along an axis.
pub const SLOPE: f64 = 0.35;

/// A colour map of one layer.
pub fn layer(driver: &str, stops: &str) -> String {
    format!("[color_map]\n[[color_map.layer]]\ndriver = {driver}\n{stops}\n")
}

/// A scene of this text.
pub fn loaded(text: &str) -> LoadedScene {
    LoadedScene {
        scene: scene::parse(text).unwrap(),
        base_dir: std::path::PathBuf::new(),
        name: "test".to_owned(),
        painted: Painted::default(),
    }
}

/// A tile of smooth Gaussian heights, under a map.
pub fn smooth(side: u32, cells: u32, preset: &str, map: &str) -> LoadedScene {
    of_noise(side, &NoiseDriver { basis: NoiseBasis::Gaussian, cells, octaves: 1, seed: 7 }, preset, map)
}

/// A tile of few hills under ripples, whose spectrum falls with the fourth power of the frequency.
pub fn hills_under_ripples(side: u32, preset: &str, map: &str) -> LoadedScene {
    of_noise(side, &NoiseDriver { basis: NoiseBasis::Gaussian, cells: 4, octaves: 4, seed: 7 }, preset, map)
}

fn of_noise(side: u32, noise: &NoiseDriver, preset: &str, map: &str) -> LoadedScene {
    let text = format!(
        "[tile]\ngeometry = {{ kind = \"heightfield\", path = \"painted.png\" }}\n[quality]\npreset = \"{preset}\"\n{map}"
    );
    let mut loaded = loaded(&text);
    let grid = DriverGrid::of_noise(noise);
    let at = |k: u32| grid.at((DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side));
    let values: Vec<f64> = (0..side * side).map(at).collect();
    let next = |k: usize| k / side as usize * side as usize + (k + 1) % side as usize;
    let square = (0..values.len()).map(|k| (values[next(k)] - values[k]).powi(2)).sum::<f64>() / values.len() as f64;
    let scale = SLOPE / (square.sqrt() * f64::from(side));
    let values = values.iter().map(|value| (value * scale) as f32).collect();
    loaded.painted.heights = Some(Arc::new(Pixels { size: UVec2::splat(side), values }));
    loaded
}
