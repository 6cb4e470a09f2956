//! The first stages: the tile's mesh, the materials of its slots, and its facets.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::base::Result;
use crate::brdf::{Brdf, Material, MaterialAssignment};
use crate::cache::{Key, KeyBuilder};
use crate::effective::mean_colors;
use crate::geometry::facets::openness::Openness;
use crate::geometry::facets::strata::colors_place_facets;
use crate::geometry::{self, FacetSampler, Facets, PeriodicGrid, SampleShift, TileMesh};
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage, lock};
use crate::plan::{Preset, Settings};
use crate::scene::{BrdfSpec, Geometry, Heightfield, LoadedScene, Switch, TermSpec};

/// The mesh of a tile, and properties of it that later stages need.
#[derive(Debug)]
pub struct TileShape {
    pub mesh: TileMesh,
    /// The tile without its colour map, if it has one.
    pub below: Option<Keyed<TileShape>>,
    /// The key of the surface and its slots: of everything but colours and the unit of length.
    pub surface: Key,
    pub flat: bool,
    /// Nothing overhangs.
    pub height_field: bool,
    /// The unit direction across the grooves, if nothing overhangs and the surface does not change along another direction
    /// of the plane.
    pub across: Option<Vec2>,
    /// The largest angle between a surface normal and z [rad].
    pub steepest: f32,
    /// The colours decide where facets are, because the image has rare bright texels.
    pub colors_place_facets: bool,
}

impl Keyed<TileShape> {
    /// The key of all that decides where facets are. Colours do so only if the image has rare bright texels.
    pub fn placing_key(&self) -> Key {
        match &self.below {
            _ if !self.colors_place_facets => self.surface,
            Some(below) => below.key,
            None => self.key,
        }
    }
}

/// Builds the mesh of a scene's tile, without its colour map.
pub struct BuildTile<'a> {
    loaded: &'a LoadedScene,
    /// The key of everything but colours and the unit of length.
    surface: Key,
    colors: [Option<Key>; 2],
}

impl<'a> BuildTile<'a> {
    pub fn new(loaded: &'a LoadedScene, env: &Env) -> Self {
        let LoadedScene { scene, base_dir, painted, .. } = loaded;
        let tile = &scene.tile;
        let mut key = KeyBuilder::of_stage("surface");
        key.numbers("size", &[tile.size]);
        let of_geometry = match &tile.geometry {
            Geometry::Mesh(mesh) => Some(&mesh.path),
            Geometry::Heightfield(field) => field.path.as_ref(),
            _ => None,
        };
        match &tile.geometry {
            Geometry::Heightfield(Heightfield { height_scale, path, values: Some(rows) }) => {
                key.numbers("scale", &[*height_scale]).debug("path", path).counts("rows", [rows.len()]);
                for row in rows {
                    key.numbers("row", row);
                }
            }
            geometry => {
                key.debug("geometry", geometry);
            }
        }
        for path in [of_geometry, tile.slot_path.as_ref()].into_iter().flatten() {
            key.key("file", &env.file_key(base_dir, path));
        }
        key.debug("slot image", &tile.slot_path);
        for image in [
            painted.heights.as_ref().map(|image| env.image_key(image)),
            painted.slots.as_ref().map(|image| env.image_key(image)),
        ] {
            key.flags("painted", [image.is_some()]);
            if let Some(image) = image {
                key.key("image", &image);
            }
        }
        let file = tile.color_path.as_ref().map(|path| env.file_key(base_dir, path));
        let image = painted.colors.as_ref().map(|image| env.image_key(image));
        Self { loaded, surface: key.finish(), colors: [file, image] }
    }

    /// The key of everything but colours and the unit of length.
    pub fn surface(&self) -> Key {
        self.surface
    }
}

impl Stage for BuildTile<'_> {
    type Output = TileShape;
    const NAME: &'static str = "geometry";

    fn hash_into(&self, key: &mut KeyBuilder) {
        let tile = &self.loaded.scene.tile;
        key.key("surface", &self.surface).debug("unit", &tile.unit).debug("color image", &tile.color_path);
        for image in &self.colors {
            key.flags("colored", [image.is_some()]);
            if let Some(image) = image {
                key.key("image", image);
            }
        }
    }

    fn run(&self, _: &Env) -> Result<TileShape> {
        let LoadedScene { scene, base_dir, painted, .. } = self.loaded;
        let mesh = geometry::build_painted(&scene.tile, base_dir, painted)?;
        let (low, high) = mesh.z_range();
        let flat = high - low <= 1e-7 * mesh.size.max_element();
        let is_of_file = matches!(scene.tile.geometry, Geometry::Mesh(_));
        let height_field = mesh.is_height_field() || !is_of_file && mesh.closes_plane && nothing_faces_down(&mesh);
        let across = if !flat && height_field && mesh.closes_plane { across_grooves(&mesh) } else { None };
        let steepest = steepest(&mesh);
        let colors_place_facets = colors_place_facets(&mesh);
        let below = None;
        Ok(TileShape { mesh, below, surface: self.surface, flat, height_field, across, steepest, colors_place_facets })
    }
}

/// Returns true if no surface faces down. In the families, whose parts stand on the floor, a point that blocks a direction
/// then also blocks every lower direction, so that one horizon is enough. In a file, a sheet without an underside may
/// hang above others, and light passes below it.
fn nothing_faces_down(mesh: &TileMesh) -> bool {
    (0..mesh.triangles.len()).all(|triangle| mesh.geometric_normal(triangle).z > -1e-6)
}

/// The unit direction across the grooves of a closed surface, if it does not change along the direction at a right angle.
fn across_grooves(mesh: &TileMesh) -> Option<Vec2> {
    /// Largest component of a normal along the grooves. It is due to rounding.
    const MOST_ALONG: f32 = 1e-5;
    /// The same for a direction across them that a normal of this slope shows.
    const ROUGHLY: f32 = 1e-2;
    let normals = || (0..mesh.triangles.len()).map(|triangle| mesh.geometric_normal(triangle).truncate());
    let are_across = |across: Vec2, most: f32| normals().all(|normal| across.perp_dot(normal).abs() <= most);
    // On most other surfaces this ends after a few triangles.
    let first = normals().find(|normal| normal.length() > ROUGHLY).and_then(Vec2::try_normalize);
    if !first.is_none_or(|first| are_across(first, ROUGHLY)) {
        return None;
    }
    let across = normals().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?.try_normalize()?;
    are_across(across, MOST_ALONG).then_some(across)
}

/// The largest angle between a normal and z [rad].
fn steepest(mesh: &TileMesh) -> f32 {
    let normals = (0..mesh.triangles.len()).into_par_iter().with_min_len(2048).map(|t| mesh.geometric_normal(t));
    let cosines = normals.filter(|normal| *normal != Vec3::ZERO).map(|normal| normal.z);
    cosines.reduce(|| 1.0, f32::min).clamp(-1.0, 1.0).acos()
}

/// Loads the material of each slot of a mesh.
pub struct LoadMaterials<'a> {
    loaded: &'a LoadedScene,
    slots: &'a [String],
    files: Vec<Key>,
}

impl<'a> LoadMaterials<'a> {
    pub fn new(loaded: &'a LoadedScene, slots: &'a [String], env: &Env) -> Self {
        let specs = loaded.scene.materials.iter().filter_map(|material| material.brdf.as_ref());
        let paths = specs.flat_map(BrdfSpec::terms).filter_map(TermSpec::path);
        let files = paths.map(|path| env.file_key(&loaded.base_dir, path)).collect();
        Self { loaded, slots, files }
    }
}

impl Stage for LoadMaterials<'_> {
    type Output = MaterialAssignment;
    const NAME: &'static str = "materials";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.debug("materials", &self.loaded.scene.materials);
        key.debug("slots", &self.slots);
        for file in &self.files {
            key.key("file", file);
        }
    }

    fn run(&self, env: &Env) -> Result<MaterialAssignment> {
        let mut assignment = MaterialAssignment::default();
        let mut loaded: Vec<Option<usize>> = Vec::new();
        for slot in self.slots {
            let found = self.loaded.scene.material_for_slot(slot)?;
            if let Some(at) = loaded.iter().position(|index| *index == found.index) {
                assignment.material_of_slot.push(at);
                continue;
            }
            let brdf = Brdf::from_specs(found.brdf, &self.loaded.base_dir, &mut lock(&env.measured))?;
            assignment.materials.push(Material { brdf, color: found.color });
            loaded.push(found.index);
            assignment.material_of_slot.push(assignment.materials.len() - 1);
        }
        Ok(assignment)
    }
}

/// Adds the settings that decide where facets are and in which order.
pub(super) fn hash_sampling_into(settings: &Settings, key: &mut KeyBuilder) {
    let Settings { facets, normal_bins, seed, preset, .. } = settings;
    key.counts("count", [*facets]).counts("bins", *normal_bins).numbers("seed", &[*seed]);
    key.flags("the paper's facets", [*preset == Preset::Wu2011]);
}

/// Samples the facets of a tile, in the order that sums need.
pub struct SampleFacets<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub settings: &'a Settings,
    /// The grid of the tile's cells, shared with other stages that cast rays; built if it is needed and absent. It is not part
    /// of the key, because it follows from the tile.
    pub grid: Option<Arc<PeriodicGrid>>,
    pub role: FacetsRole,
}

impl SampleFacets<'_> {
    /// Returns true if facets are placed by openness, which casts rays: much of a surface that overhangs is hidden.
    pub fn needs_grid(tile: &TileShape, settings: &Settings) -> bool {
        settings.preset != Preset::Wu2011 && !tile.height_field
    }
}

/// Facets that are needed in turns, so that each role has its own slot in the memo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FacetsRole {
    /// As many facets as the settings say.
    Main,
    /// The few facets of a clustered sum on the GPU.
    Clusters,
    /// More facets than the settings say, because the estimated error with the main ones is too large.
    Refined,
}

impl Stage for SampleFacets<'_> {
    type Output = Facets;
    const NAME: &'static str = "facets";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key);
        hash_sampling_into(self.settings, key);
        key.flags("mean colors", [self.settings.effects.color_weights == Switch::Off]);
    }

    fn slot(&self) -> &'static str {
        match self.role {
            FacetsRole::Main => Self::NAME,
            FacetsRole::Clusters => "facets of clusters",
            FacetsRole::Refined => "refined facets",
        }
    }

    fn run(&self, _: &Env) -> Result<Facets> {
        let (mesh, settings) = (&self.tile.mesh, self.settings);
        let exact =
            if self.tile.flat && settings.preset != Preset::Wu2011 { Facets::of_level_tile(mesh) } else { None };
        let mut facets = match exact {
            Some(facets) => facets,
            None if settings.preset == Preset::Wu2011 => Facets::sample_wu2011(mesh, settings.facets, settings.seed),
            None => {
                let (sampler, shift) = (FacetSampler::new(mesh), SampleShift::from_seed(settings.seed));
                if Self::needs_grid(self.tile, settings) {
                    let grid = self.grid.clone().unwrap_or_else(|| Arc::new(PeriodicGrid::new(mesh)));
                    let openness = Openness::measure(&sampler, mesh, &grid);
                    sampler.sample_by_openness(mesh, settings.facets, shift, &openness)
                } else {
                    sampler.sample(mesh, settings.facets, shift)
                }
            }
        };
        if let Some(bins) = settings.normal_bins {
            facets.bin_normals(bins);
        }
        facets.sort_for_sums();
        if settings.effects.color_weights == Switch::Off {
            mean_colors(&mut facets);
        }
        Ok(facets)
    }
}

#[cfg(test)]
#[path = "tile_tests.rs"]
mod tests;
