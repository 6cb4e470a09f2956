//! Stages of colour maps: the samples of textures and noise. A scene without `[color_map]` runs none of them.

use std::sync::Arc;

use glam::Vec3;

use super::TileShape;
use super::tile::hash_sampling_into;
use crate::base::Result;
use crate::cache::{Key, KeyBuilder};
use crate::color_map::Normal;
use crate::color_map::layers::LayeredMap;
use crate::color_map::statistics::{DriverGrid, PlaceDriver, RankedHeights};
use crate::geometry::image_file;
use crate::geometry::relief::{relief, relief_of_surface};
use crate::geometry::{Facets, TileMesh};
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage};
use crate::plan::Settings;
use crate::scene::{ColorLayer, ColorMap, Driver, LoadedScene};

/// The samples of each texture and noise of a scene's colour map.
#[derive(Debug, Default)]
pub struct PlaceDrivers(Vec<(Driver, Arc<PlaceDriver>)>);

impl PlaceDrivers {
    fn find(&self, driver: &Driver) -> Option<Arc<PlaceDriver>> {
        self.0.iter().find(|(known, _)| known == driver).map(|(_, place)| place.clone())
    }

    /// The colour map of a scene on its tile.
    pub fn resolve(&self, spec: &ColorMap, mesh: &TileMesh) -> LayeredMap {
        let relief = spec.surface.as_ref().map_or_else(|| relief(mesh), relief_of_surface);
        LayeredMap::new(spec, relief, &|driver| self.find(driver))
    }
}

/// Reads the textures and computes the noise of a colour map. Stops are no input: an edit of a stop keeps the result.
pub struct SampleDrivers<'a> {
    loaded: &'a LoadedScene,
    drivers: Vec<&'a Driver>,
    files: Vec<Key>,
}

impl<'a> SampleDrivers<'a> {
    pub fn new(loaded: &'a LoadedScene, map: &'a ColorMap, env: &Env) -> Self {
        let mut drivers: Vec<&Driver> = Vec::new();
        for driver in map.layer.iter().flat_map(ColorLayer::drivers).flat_map(Driver::parts) {
            if matches!(driver, Driver::Texture(_) | Driver::Noise(_)) && !drivers.contains(&driver) {
                drivers.push(driver);
            }
        }
        let files = map.files().map(|path| env.file_key(&loaded.base_dir, path)).collect();
        Self { loaded, drivers, files }
    }
}

impl Stage for SampleDrivers<'_> {
    type Output = PlaceDrivers;
    const NAME: &'static str = "color_drivers";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.debug("drivers", &self.drivers);
        self.files.iter().for_each(|file| {
            key.key("file", file);
        });
    }

    fn run(&self, _: &Env) -> Result<PlaceDrivers> {
        let mut places = Vec::new();
        for driver in &self.drivers {
            let grid = match driver {
                Driver::Texture(texture) => {
                    let image = image_file::read_heights(&self.loaded.base_dir, &texture.path)?;
                    DriverGrid::new(image.size, &image.values, texture.repeat)
                }
                Driver::Noise(noise) => DriverGrid::of_noise(noise),
                _ => continue,
            };
            places.push(((*driver).clone(), Arc::new(PlaceDriver::new(grid))));
        }
        Ok(PlaceDrivers(places))
    }
}

/// Ranks the heights of the facets. Neither stops nor visibility are inputs.
pub struct MeasureHeights<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub settings: &'a Settings,
}

impl Stage for MeasureHeights<'_> {
    type Output = RankedHeights;
    const NAME: &'static str = "color_heights";

    fn hash_into(&self, key: &mut KeyBuilder) {
        // As for visibility: colours matter only if they decide where facets are.
        let colored = self.tile.colors_place_facets;
        key.key("surface", if colored { &self.tile.key } else { &self.tile.surface });
        hash_sampling_into(self.settings, key);
    }

    fn run(&self, _: &Env) -> Result<RankedHeights> {
        let Normal { mean, deviation } = relief(&self.tile.mesh).height;
        let scale = if deviation > 0.0 { deviation.recip() } else { 0.0 };
        let standard = |position: &Vec3| ((f64::from(position.z) - mean) * scale) as f32;
        let heights: Vec<f32> = self.facets.positions.iter().map(standard).collect();
        let projected = |(normal, area): (&Vec3, &f32)| normal.z.abs() * area;
        let areas: Vec<f32> = self.facets.geometric_normals.iter().zip(&self.facets.areas).map(projected).collect();
        Ok(RankedHeights::new(&heights, &areas))
    }
}
