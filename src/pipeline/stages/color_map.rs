//! Stages of colour maps: the samples of textures and noise, and the colours of the tile and of its facets. A scene
//! without `[color_map]` runs none of them.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::{FacetsRole, TileShape};
use crate::base::Result;
use crate::cache::{Key, KeyBuilder};
use crate::color_map::layers::{LayeredMap, Relief};
use crate::color_map::statistics::{DriverGrid, PlaceDriver};
use crate::effective::mean_colors;
use crate::geometry::relief::{relief, relief_of_surface};
use crate::geometry::{ColorField, Facets, image_file};
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage};
use crate::plan::Settings;
use crate::scene::{ColorLayer, ColorMap, Driver, GaussianSurface, LoadedScene, Switch};

/// The samples of each texture and noise of a scene's colour map.
#[derive(Debug, Default)]
pub struct PlaceDrivers(Vec<(Driver, Arc<PlaceDriver>)>);

impl PlaceDrivers {
    fn find(&self, driver: &Driver) -> Option<Arc<PlaceDriver>> {
        self.0.iter().find(|(known, _)| known == driver).map(|(_, place)| place.clone())
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

/// Measures heights and slopes of the surface that a colour map is on. Stops are no input.
pub struct MeasureRelief<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub surface: Option<&'a GaussianSurface>,
}

impl Stage for MeasureRelief<'_> {
    type Output = Relief;
    const NAME: &'static str = "color_relief";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.surface).debug("analytic", &self.surface);
    }

    fn run(&self, _: &Env) -> Result<Relief> {
        Ok(self.surface.map_or_else(|| relief(&self.tile.mesh), relief_of_surface))
    }
}

/// Lays the colour map of a scene over its tile.
pub struct ColorTile<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub map: &'a ColorMap,
    pub drivers: &'a Keyed<PlaceDrivers>,
    pub relief: &'a Keyed<Relief>,
}

impl Stage for ColorTile<'_> {
    type Output = TileShape;
    const NAME: &'static str = "color_tile";

    fn hash_into(&self, key: &mut KeyBuilder) {
        let Self { tile, map, drivers, relief } = self;
        key.key("tile", &tile.key).key("drivers", &drivers.key).key("relief", &relief.key);
        key.debug("layers", &(&map.combine, &map.layer, &map.surface));
    }

    fn run(&self, _: &Env) -> Result<TileShape> {
        let Self { tile, map, drivers, relief } = self;
        let map = LayeredMap::new(map, *relief.value, &|driver| drivers.find(driver));
        let mut mesh = tile.mesh.clone();
        mesh.color = ColorField::Mapped { map: Arc::new(map), below: Box::new(mesh.color) };
        let TileShape { surface, flat, height_field, across, steepest, colors_place_facets, .. } = *tile.value;
        let below = Some((*tile).clone());
        Ok(TileShape { mesh, below, surface, flat, height_field, across, steepest, colors_place_facets })
    }
}

/// Gives facets of the tile without its colour map the colours of the map. The places of facets do not depend on it.
pub struct ColorFacets<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub settings: &'a Settings,
    pub role: FacetsRole,
}

impl Stage for ColorFacets<'_> {
    type Output = Facets;
    const NAME: &'static str = "color_facets";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key).key("facets", &self.facets.key);
        key.flags("mean colors", [self.settings.effects.color_weights == Switch::Off]);
    }

    fn slot(&self) -> &'static str {
        match self.role {
            FacetsRole::Main => Self::NAME,
            FacetsRole::Clusters => "coloured facets of clusters",
            FacetsRole::Refined => "refined coloured facets",
        }
    }

    fn run(&self, _: &Env) -> Result<Facets> {
        let mesh = &self.tile.mesh;
        let mut facets = (*self.facets.value).clone();
        let color = |(position, normal): (&Vec3, &Vec3)| mesh.color.at(*position, *normal, mesh.size);
        let points = facets.positions.par_iter().zip(facets.coloring_normals(mesh));
        facets.colors = points.with_min_len(512).map(color).collect();
        if self.settings.effects.color_weights == Switch::Off {
            mean_colors(&mut facets);
        }
        Ok(facets)
    }
}
