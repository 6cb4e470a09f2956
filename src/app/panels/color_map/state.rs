//! State of the colour map panel: the measured values of the drivers.

use std::path::PathBuf;
use std::sync::Arc;

use crate::app::views::zoom::TileScale;
use crate::app::worker::{ColorMapJob, ColorMapResult, DriverValues};
use crate::scene::{ColorLayer, Driver, GaussianSurface, HeightDistribution, LoadedScene, MaterialSpec, Painted, Tile};
use glam::Vec3;

/// Inputs of the values. Stops are no part of them, so that dragging one measures nothing.
type Key = (Tile, Vec<Driver>, Option<GaussianSurface>, HeightDistribution, Vec<MaterialSpec>, PathBuf, Painted);

/// Directions to the light and to the viewer of the picked point, in the tile frame.
type Picked = Option<(Vec3, Vec3)>;

#[derive(Default)]
pub struct ColorMapState {
    /// True while the panel is unfolded. Values are measured only then.
    pub open: bool,
    pub error: Option<String>,
    /// Size of the tiles in the object view; absent until it shows an image.
    pub scale: Option<TileScale>,
    values: Vec<DriverValues>,
    /// Document version and picked directions that were examined last.
    examined: Option<(u64, Picked)>,
    requested: Option<(Box<Key>, Picked)>,
}

impl ColorMapState {
    /// Returns the job that measures the drivers of a scene, unless it is the last request.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>, picked: Picked) -> Option<ColorMapJob> {
        if !self.open || self.examined == Some((version, picked)) {
            return None;
        }
        self.examined = Some((version, picked));
        let scene = &loaded.scene;
        let map = scene.color_map.as_ref()?;
        let drivers = map.layer.iter().flat_map(ColorLayer::drivers).cloned().collect();
        let key = Box::new((
            scene.tile.clone(),
            drivers,
            map.surface.clone(),
            map.distribution,
            // Materials weight what is visible and lit.
            if picked.is_some() { scene.materials.clone() } else { Vec::new() },
            loaded.base_dir.clone(),
            loaded.painted.clone(),
        ));
        let wanted = (key, picked);
        if self.requested.as_ref() == Some(&wanted) {
            return None;
        }
        self.requested = Some(wanted);
        Some(ColorMapJob { loaded: loaded.clone(), picked })
    }

    pub fn receive(&mut self, result: ColorMapResult) {
        match result {
            ColorMapResult::Values(values) => (self.values, self.error) = (values, None),
            ColorMapResult::Failed(text) => {
                (self.error, self.requested) = (Some(text), None);
                self.values.clear();
            }
        }
    }

    /// The values of a driver, if they were measured.
    pub fn values_of(&self, driver: &Driver) -> Option<&DriverValues> {
        self.values.iter().find(|values| values.driver == *driver)
    }
}
