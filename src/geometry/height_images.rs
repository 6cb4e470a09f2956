//! Functions of the height images in `assets/`, and a test that the images match them.
//!
//! `cargo test --lib write_the_height_images -- --ignored` writes the images.

use std::f32::consts::TAU;
use std::path::{Path, PathBuf};

use glam::Vec2;
use image::{ImageBuffer, Luma};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::image_file;

const SIDE: u32 = 128;

/// Height at a point of the unit square, at any scale. The function is periodic.
type HeightFunction = Box<dyn Fn(Vec2) -> f32>;

fn images() -> [(&'static str, HeightFunction); 4] {
    [("brushed", brushed()), ("hammered", hammered()), ("leather", leather()), ("ripples", ripples())]
}

/// Distances to the nearest and second nearest of the points, on the torus.
fn nearest_two(points: &[Vec2], at: Vec2) -> (f32, f32) {
    points.iter().fold((f32::MAX, f32::MAX), |(first, second), point| {
        let offset = at - *point;
        let distance = (offset - offset.round()).length();
        if distance < first { (distance, first) } else { (first, second.min(distance)) }
    })
}

/// One random point in each cell of a lattice.
fn scattered(side: u32, seed: u64) -> Vec<Vec2> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut point = |k: u32| {
        let inside = Vec2::new(random.random(), random.random());
        (Vec2::new((k % side) as f32, (k / side) as f32) + inside) / side as f32
    };
    (0..side * side).map(&mut point).collect()
}

/// Round dents that meet in ridges.
fn hammered() -> HeightFunction {
    let points = scattered(6, 11);
    Box::new(move |at| nearest_two(&points, at).0.powi(2))
}

/// Rounded grains between creases.
fn leather() -> HeightFunction {
    let points = scattered(9, 12);
    Box::new(move |at| {
        let (first, second) = nearest_two(&points, at);
        1.0 - (-18.0 * (second - first)).exp() - 2.0 * first
    })
}

/// Waves along y with wandering crests.
fn ripples() -> HeightFunction {
    Box::new(|at| {
        let bend = 0.05 * (TAU * at.y).sin() + 0.025 * (TAU * (2.0 * at.y + at.x) + 1.0).sin();
        (TAU * 5.0 * (at.x + bend)).sin()
    })
}

/// Scratches along y: many waves across them, few along them.
fn brushed() -> HeightFunction {
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let waves: Vec<[f32; 4]> = (0..60)
        .map(|_| {
            let across = random.random_range(3u8..=24);
            let along = random.random_range(-1i8..=1);
            [f32::from(across), f32::from(along), TAU * random.random::<f32>(), 1.0 / f32::from(across)]
        })
        .collect();
    Box::new(move |at| waves.iter().map(|w| w[3] * (TAU * (w[0] * at.x + w[1] * at.y) + w[2]).sin()).sum())
}

/// The image's 16-bit samples: the function at texel centres, scaled to the full range.
fn samples(height: &HeightFunction) -> Vec<u16> {
    let at = |k: u32| (Vec2::new((k % SIDE) as f32, (k / SIDE) as f32) + 0.5) / SIDE as f32;
    let heights: Vec<f32> = (0..SIDE * SIDE).map(|k| height(at(k))).collect();
    let low = heights.iter().copied().fold(f32::MAX, f32::min);
    let high = heights.iter().copied().fold(f32::MIN, f32::max);
    heights.iter().map(|height| ((height - low) / (high - low) * 65535.0).round() as u16).collect()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

#[test]
#[ignore = "writes assets/"]
fn write_the_height_images() {
    for (name, height) in images() {
        let image = ImageBuffer::<Luma<u16>, _>::from_raw(SIDE, SIDE, samples(&height)).unwrap();
        image.save(folder().join(name).with_extension("png")).unwrap();
    }
}

#[test]
fn the_shipped_height_images_match_their_functions() {
    for (name, height) in images() {
        let shipped = image_file::read_heights(Path::new(""), Path::new(&format!("asset:{name}.png"))).unwrap();
        assert_eq!(shipped.size, glam::UVec2::splat(SIDE));
        for (shipped, computed) in shipped.values.iter().zip(samples(&height)) {
            // The results of `sin` differ slightly between platforms.
            assert!((shipped * 65535.0 - f32::from(computed)).abs() < 3.0, "{name}");
        }
    }
}
