//! Tiles and BRDFs to which no default is tuned, with their facets and references. The tests and `benches/measure`
//! share them.

use std::f32::consts::TAU;
use std::path::{Path, PathBuf};

use biscale::effective::EffectiveBrdf;
use biscale::geometry;
use biscale::geometry::{FacetSampler, Facets, PeriodicGrid, SampleShift, TileMesh};
use biscale::metrics::Pair;
use biscale::scene;
use biscale::scene::LoadedScene;
use biscale::visibility::{HorizonMap, OcclusionIntervals, Visibility};
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

pub const BRDFS: [(&str, &str); 5] = [
    ("lambertian", r#"{ kind = "lambertian", albedo = 0.7 }"#),
    ("cook-torrance 0.2", r#"{ kind = "cook_torrance", roughness = 0.2, f0 = 0.9 }"#),
    ("cook-torrance 0.5", r#"{ kind = "cook_torrance", roughness = 0.5, f0 = 0.9 }"#),
    ("ward 0.3", r#"{ kind = "ward", roughness = 0.3, specular = 0.5 }"#),
    ("blinn-phong 50", r#"{ kind = "blinn_phong", exponent = 50, specular = 0.5 }"#),
];

/// Returns the geometry of a smooth height field of waves with random directions, heights and phases, as TOML.
fn random_heights(seed: u64) -> String {
    const N: usize = 48;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let waves: Vec<[f32; 4]> = (0..12)
        .map(|_| {
            let [kx, ky] = [(); 2].map(|()| (rng.random::<f32>() * 9.0).floor() - 4.0);
            [kx, ky, TAU * rng.random::<f32>(), 0.07 * rng.random::<f32>() / (1.0 + kx.hypot(ky))]
        })
        .collect();
    let at = |k: usize| (k as f32 + 0.5) / N as f32;
    let rows: Vec<String> = (0..N)
        .map(|j| {
            let row: Vec<String> = (0..N)
                .map(|i| {
                    waves
                        .iter()
                        .map(|[kx, ky, phase, height]| height * (TAU * (kx * at(i) + ky * at(j)) + phase).sin())
                        .sum::<f32>()
                })
                .map(|z| format!("{z:.6}"))
                .collect();
            format!("[{}]", row.join(","))
        })
        .collect();
    format!(r#"{{ kind = "heightfield", values = [{}] }}"#, rows.join(","))
}

/// Returns the names and the geometries of tiles to which no default is tuned.
pub fn untuned() -> Vec<(&'static str, String)> {
    vec![
        ("random heights", random_heights(20_260_111)),
        ("v-groove", r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.13, side_angle_deg = 43, rotation_deg = 0 }"#.to_owned()),
        ("leaning rods", r#"{ kind = "rods", count = 23, radius = 0.05, length = 0.24, lean_deg = 37, lean_azimuth_deg = 70, seed = 5 }"#.to_owned()),
        ("twill", r#"{ kind = "weave", pattern = "twill" }"#.to_owned()),
    ]
}

/// Returns a scene on the CPU with one material, without interreflection, as in the paper's Eq. 7.
pub fn open(geometry: &str, brdf: &str, preset: &str) -> LoadedScene {
    let source = format!(
        "[tile]\ngeometry = {geometry}\n[[material]]\nname = \"default\"\nbrdf = {brdf}\n[quality]\npreset = \"{preset}\"\nbackend = \"cpu\"\n[effects]\ninterreflection = \"off\"\n"
    );
    LoadedScene {
        scene: scene::parse(&source).unwrap(),
        base_dir: PathBuf::new(),
        name: "test".to_owned(),
        painted: scene::Painted::default(),
    }
}

/// Returns the BRDF of a MERL file, as TOML.
pub fn merl_spec(path: &Path) -> String {
    format!(r#"{{ kind = "merl", path = "{}" }}"#, path.display())
}

pub fn evaluate(brdf: &EffectiveBrdf, pairs: &[Pair]) -> Vec<Vec3> {
    pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
}

/// Returns the mesh of a tile without files.
pub fn mesh(geometry: &str) -> TileMesh {
    let scene = scene::parse(&format!("[tile]\ngeometry = {geometry}\n")).unwrap();
    geometry::build(&scene.tile, Path::new("")).unwrap()
}

/// Returns sorted facets of a mesh and their exact visibility on 48 azimuths.
pub fn sample(mesh: &TileMesh, count: usize) -> (Facets, Visibility) {
    let mut facets = FacetSampler::new(mesh).sample(mesh, count, SampleShift::from_seed(1));
    facets.sort_for_sums();
    let grid = PeriodicGrid::new(mesh);
    let visibility = if mesh.is_height_field() {
        Visibility::HorizonMap(HorizonMap::scan(&grid, &facets, 48, 0.02))
    } else {
        Visibility::OcclusionIntervals(OcclusionIntervals::scan(&grid, &facets, 48, 0.02))
    };
    (facets, visibility)
}
