use std::sync::Arc;

use glam::UVec2;

use super::*;
use crate::geometry::SlotField;
use crate::geometry::families::flat;
use crate::scene::{Flat, FlatPattern};

fn stripes(ratio: f32) -> TileMesh {
    flat::build(&Flat { pattern: FlatPattern::Stripes, ratio, count: 1 }, Vec2::new(2.0, 1.0))
}

fn image(size: UVec2) -> ColorField {
    let texel = |k: u32| Vec3::new((k * 7 % 11) as f32, (k * 5 % 13) as f32, f32::from(u8::from(k == 3))) * 0.1;
    ColorField::Image { size, texels: Arc::new((0..size.element_product()).map(texel).collect()) }
}

#[test]
fn the_slots_of_a_level_tile_have_their_exact_areas() {
    let facets = Facets::of_level_tile(&stripes(3e-4)).unwrap();
    assert_eq!(facets.slots, [0, 1]);
    assert!((facets.areas[0] - 6e-4).abs() < 1e-9 && (facets.areas[1] - 1.9994).abs() < 1e-6, "{:?}", facets.areas);
}

#[test]
fn the_mean_colour_of_a_plain_tile_is_that_of_the_texels() {
    let mut mesh = flat::build(&Flat::default(), Vec2::ONE);
    mesh.color = image(UVec2::new(7, 5));
    let ColorField::Image { texels, .. } = &mesh.color else { panic!("no image") };
    let mean = texels.iter().sum::<Vec3>() / texels.len() as f32;
    let facets = Facets::of_level_tile(&mesh).unwrap();
    assert_eq!(facets.len(), 1);
    assert!((facets.colors[0] - mean).abs().max_element() < 1e-6, "{} {mean}", facets.colors[0]);
}

#[test]
fn areas_and_mean_colours_equal_sums_over_many_points() {
    let mut mesh = stripes(0.37);
    mesh.color = image(UVec2::new(5, 4));
    mesh.slots.push("paint_1".to_owned());
    let texels = vec![0, 1, 0, 0, 1, 1];
    mesh.painted_slots = Some(SlotField { size: UVec2::new(3, 2), texels: Arc::new(texels), first: 2 });
    let facets = Facets::of_level_tile(&mesh).unwrap();
    const SIDE: u32 = 1500;
    let mut expected = [(0.0, DVec3::ZERO); 3];
    for k in 0..SIDE * SIDE {
        let at = (DVec2::new(f64::from(k % SIDE), f64::from(k / SIDE)) + 0.5) / f64::from(SIDE);
        let xy = at.as_vec2() * mesh.size;
        let own = u16::from(at.x >= 0.37);
        let sum = &mut expected[usize::from(mesh.painted_slot(xy).unwrap_or(own))];
        sum.0 += 2.0 / f64::from(SIDE * SIDE);
        sum.1 += color_at(&mesh, at);
    }
    assert_eq!(facets.slots, [0, 1, 2]);
    for (s, (area, color)) in expected.iter().enumerate() {
        let mean = *color / (area / 2.0 * f64::from(SIDE * SIDE));
        assert!((f64::from(facets.areas[s]) - area).abs() < 2e-3, "{} {area}", facets.areas[s]);
        assert!((facets.colors[s].as_dvec3() - mean).abs().max_element() < 2e-3, "{} {mean}", facets.colors[s]);
    }
}
