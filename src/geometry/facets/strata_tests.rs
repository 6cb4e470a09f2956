use std::sync::Arc;

use super::*;
use crate::geometry::families::heightfield;
use crate::geometry::{FacetSampler, Facets, SampleShift, SlotField};

/// Smooth hills.
fn hills() -> TileMesh {
    let height = |p: Vec2| 0.05 * (p.x * 12.0).sin() * (p.y * 6.0).cos();
    heightfield::from_function(UVec2::new(30, 40), Vec2::new(1.0, 1.0), height)
}

/// A black image of 256 x 256 texels, of which `count` are white.
fn white_texels(count: usize) -> ColorField {
    let mut texels = vec![Vec3::ZERO; 256 * 256];
    (0..count).for_each(|k| texels[(k * 40_503 + 77) % (256 * 256)] = Vec3::ONE);
    ColorField::Image { size: UVec2::splat(256), texels: Arc::new(texels) }
}

#[test]
fn counts_sum_to_their_total_and_no_stratum_is_left_out() {
    for (areas, count) in [(vec![1.0], 7), (vec![0.5, 0.5], 100), (vec![1e-6, 1.0], 6144), (vec![1e-9; 300], 300)] {
        let counts = allocate(&areas, count);
        assert_eq!(counts.iter().sum::<usize>(), count);
        assert!(counts.iter().all(|count| *count >= 1), "{counts:?}");
    }
    assert_eq!(allocate(&[0.5, 0.5], 100), [50, 50]);
    assert_eq!(allocate(&[1e-6, 1.0], 6400)[0], 800);
    assert_eq!(allocate(&[2.0], 0), [0]);
}

#[test]
fn a_few_white_texels_get_facets_and_the_mean_colour_over_all_facets_is_that_of_the_image() {
    let mut mesh = hills();
    mesh.color = white_texels(10);
    let sampler = FacetSampler::new(&mesh);
    let mut mean = 0.0;
    for seed in 1..=4 {
        let facets = sampler.sample(&mesh, 6144, SampleShift::from_seed(seed));
        let white = facets.colors.iter().filter(|color| color.x > 0.1).count();
        assert!(white > 25, "{white}");
        let area: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
        assert!((area / sampler.area() - 1.0).abs() < 1e-5);
        // The mean over the base, as a level tile would have it.
        let weight = |s: usize| f64::from(facets.areas[s] * facets.geometric_normals[s].z);
        mean += 0.25 * (0..facets.len()).map(|s| weight(s) * f64::from(facets.colors[s].x)).sum::<f64>();
    }
    let expected = 10.0 / (256.0 * 256.0);
    assert!((mean / expected - 1.0).abs() < 0.12, "{mean} {expected}");
    // Samples by area alone miss nearly all of it.
    mesh.color = ColorField::Uniform;
    let by_area = Facets::sample(&mesh, 6144, 1);
    let hit = by_area.positions.iter().filter(|p| white_texels(10).at(**p, Vec3::Z, mesh.size).x > 0.1).count();
    assert!(hit < 10, "{hit}");
}

#[test]
fn a_white_line_along_grooves_gets_its_share_of_the_facets() {
    let settings = ["tile.geometry.profile=v", "tile.geometry.side_angle_deg=40"].map(str::to_owned);
    let loaded = crate::scene::open("fig4b_bicolor_cup", &settings).unwrap();
    let mut mesh = crate::geometry::build(&loaded.scene.tile, &loaded.base_dir).unwrap();
    let mut texels = vec![Vec3::ZERO; 2048];
    texels[700] = Vec3::ONE;
    mesh.color = ColorField::Image { size: UVec2::new(2048, 1), texels: Arc::new(texels) };
    for seed in 1..=3 {
        let facets = FacetSampler::new(&mesh).sample(&mesh, 2048, SampleShift::from_seed(seed));
        let white = facets.colors.iter().filter(|color| color.x > 0.1).count();
        let weight = |s: usize| f64::from(facets.areas[s] * facets.geometric_normals[s].z);
        let mean = (0..facets.len()).map(|s| weight(s) * f64::from(facets.colors[s].x)).sum::<f64>();
        assert!(white > 30, "{white}");
        assert!((mean * 2048.0 - 1.0).abs() < 0.15, "{mean}");
    }
}

#[test]
fn a_small_painted_spot_gets_its_share_of_the_facets() {
    let mut mesh = hills();
    let texels = (0..128 * 128).map(|k| u8::from(k % 128 / 3 == 20 && k / 128 / 3 == 11)).collect();
    mesh.slots.push("paint_1".to_owned());
    mesh.painted_slots = Some(SlotField { size: UVec2::splat(128), texels: Arc::new(texels), first: 1 });
    let facets = Facets::sample(&mesh, 6144, 1);
    let painted: Vec<usize> = (0..facets.len()).filter(|s| facets.slots[*s] == 1).collect();
    assert!(painted.len() > 96, "{}", painted.len());
    let area: f64 = painted.iter().map(|&s| f64::from(facets.areas[s] * facets.geometric_normals[s].z)).sum();
    let expected = 9.0 / (128.0 * 128.0);
    assert!((area / expected - 1.0).abs() < 0.1, "{area} {expected}");
}

#[test]
fn the_range_over_a_rectangle_includes_the_ranges_of_its_texels() {
    let size = UVec2::new(13, 6);
    let classes: Vec<u8> = (0..78).map(|k| (k * 29 % 17) as u8).collect();
    let image = ClassImage::new(size, classes.clone(), 0.0);
    for k in 0..500_u32 {
        let at = |step: u32, range: f32| (k * step % 1009) as f32 / 1009.0 * range;
        let low = Vec2::new(at(17, 2.0) - 0.5, at(31, 2.0) - 0.5);
        let high = low + Vec2::new(at(73, 0.9), at(91, 0.9));
        let found = image.range(low, high);
        let (from, to) = ((low * size.as_vec2()).floor(), (high * size.as_vec2()).floor());
        for y in from.y as i64..=to.y as i64 {
            for x in from.x as i64..=to.x as i64 {
                let class = classes[(y.rem_euclid(6) * 13 + x.rem_euclid(13)) as usize];
                assert!(found[0] <= class && class <= found[1], "{low} {high}");
            }
        }
    }
}
