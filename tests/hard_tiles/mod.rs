//! Hard tiles: tiles made by code on which a sum over facets easily misses what reflects most of the light, with their
//! true values. The tests and `benches/measure` share them.
#![allow(dead_code, unused_imports, reason = "each of them uses a part")]

mod closed_forms;
mod errors;
mod images;
mod meshes;
mod ray_cast;
mod rows;

use std::path::Path;

use biscale::metrics::{Pair, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};
use glam::Vec3;

pub use errors::{Measured, PAIRS_SEED, measure};
pub use ray_cast::RayCast;
pub use rows::all;

/// Smallest effective number of pairs, `(Σ|f̄|²)² / Σ|f̄|⁴`, at which a closed form is compared.
const MIN_EFFECTIVE_PAIRS: f64 = 16.0;
const MAX_PAIRS: usize = 25_600;

/// A tile and its materials, as the text of a scene, with the files that it names.
#[derive(Debug, Clone)]
pub struct HardTile {
    pub name: &'static str,
    /// The table `[tile]` without its header.
    pub tile: String,
    /// Names of materials and their BRDFs.
    pub materials: Vec<(&'static str, &'static str)>,
    pub files: Vec<(&'static str, File)>,
    pub truth: Truth,
}

/// Content of a file that a tile names.
#[derive(Debug, Clone)]
pub enum File {
    /// The text of an OBJ file.
    Mesh(String),
    /// Linear colours, row by row, in an EXR file.
    Colors(usize, Vec<Vec3>),
    /// Numbers of slots, row by row, in a square PNG file.
    Slots(Vec<u8>),
}

/// Source of the true values of a tile.
#[derive(Debug, Clone)]
pub enum Truth {
    /// A level tile, on which nothing is blocked: the weight of each slot's BRDF, which is its share of the area times
    /// its mean colour.
    Level(Vec<(&'static str, Vec3)>),
    /// Rectangular grooves with the slots `bottom` and `sides`.
    Grooves(closed_forms::Grooves),
    /// A level floor below a black sheet with square holes.
    Holes(closed_forms::Holes),
    /// Rays from points that are dense where the surface is bright.
    RayCast,
}

/// True values of f̄ at direction pairs.
#[derive(Debug, Clone)]
pub struct TrueValues {
    pub values: Vec<Vec3>,
    /// Relative L2 of their standard errors; 0 for a closed form.
    pub std_error: f64,
}

impl HardTile {
    /// Writes the files of the tile to `folder` and returns its scene on the CPU, without interreflection, which the closed
    /// forms leave out.
    pub fn open(&self, folder: &Path, preset: &str, seed: u64) -> LoadedScene {
        for (name, file) in &self.files {
            file.write(&folder.join(name));
        }
        let mut text = format!("[tile]\n{}\n", self.tile);
        for (name, brdf) in &self.materials {
            text += &format!("[[material]]\nname = \"{name}\"\nbrdf = {brdf}\n");
        }
        text += &format!(
            "[quality]\npreset = \"{preset}\"\nbackend = \"cpu\"\nseed = {seed}\n[effects]\ninterreflection = \"off\"\n"
        );
        let scene = scene::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", self.name));
        LoadedScene { scene, base_dir: folder.to_owned(), name: self.name.to_owned(), painted: Painted::default() }
    }

    /// Returns the true values, by a closed form if there is one.
    pub fn true_values(&self, loaded: &LoadedScene, pairs: &[Pair], settings: &RayCast) -> TrueValues {
        let pipeline = Pipeline::new();
        let (mesh, assigned) = (pipeline.mesh(loaded).unwrap(), pipeline.materials(loaded).unwrap());
        // The part of f̄ of a surface with one normal, per visible area.
        let part = |slot: &str, normal: Vec3, pair: &Pair| {
            let index = mesh.slots.iter().position(|name| name == slot).unwrap();
            let material = &assigned.materials[assigned.material_of_slot[index]];
            material.color * material.brdf.f(normal, pair.i, pair.o) / pair.o.z
        };
        let value = |pair: &Pair| match &self.truth {
            Truth::Level(weights) => {
                Some(weights.iter().map(|(slot, weight)| *weight * part(slot, Vec3::Z, pair)).sum())
            }
            Truth::Grooves(grooves) => {
                let wall = |side: f64| {
                    let normal = grooves.across() * side as f32;
                    part("sides", normal, pair) * grooves.wall(pair, side) as f32
                };
                let land = part("sides", Vec3::Z, pair) * grooves.land() as f32;
                Some(part("bottom", Vec3::Z, pair) * grooves.bottom(pair) as f32 + land + wall(1.0) + wall(-1.0))
            }
            Truth::Holes(holes) => Some(part("floor", Vec3::Z, pair) * holes.share(pair) as f32),
            Truth::RayCast => None,
        };
        match pairs.iter().map(value).collect() {
            Some(values) => TrueValues { values, std_error: 0.0 },
            None => ray_cast::estimate(&mesh, &assigned, pairs, settings),
        }
    }

    /// `count` direction pairs and the true values at them. Closed forms cost nothing, so that there are more pairs if few see
    /// through a deep or small opening.
    pub fn pairs_and_values(
        &self,
        loaded: &LoadedScene,
        mut count: usize,
        settings: &RayCast,
    ) -> (Vec<Pair>, TrueValues) {
        loop {
            let pairs = mirror_biased_pairs(count, PAIRS_SEED);
            let truth = self.true_values(loaded, &pairs, settings);
            let squares = || truth.values.iter().map(|value| f64::from(value.length_squared()));
            let effective = squares().sum::<f64>().powi(2) / squares().map(|square| square * square).sum::<f64>();
            if truth.std_error > 0.0 || effective >= MIN_EFFECTIVE_PAIRS || count >= MAX_PAIRS {
                return (pairs, truth);
            }
            count *= 2;
        }
    }

    /// Returns the ray-cast values, also if there is a closed form.
    pub fn ray_cast(&self, loaded: &LoadedScene, pairs: &[Pair], settings: &RayCast) -> TrueValues {
        Self { truth: Truth::RayCast, ..self.clone() }.true_values(loaded, pairs, settings)
    }
}

impl File {
    fn write(&self, path: &Path) {
        match self {
            Self::Mesh(text) => std::fs::write(path, text).unwrap(),
            Self::Colors(width, texels) => {
                let at = |x: usize, y: usize| texels[y * width + x].into();
                exr::prelude::write_rgb_file(path, *width, texels.len() / width, at).unwrap();
            }
            Self::Slots(texels) => {
                let side = texels.len().isqrt() as u32;
                image::GrayImage::from_raw(side, side, texels.clone()).unwrap().save(path).unwrap();
            }
        }
    }
}
