//! Tests of brushes on small images.

use std::sync::Arc;

use crate::scene::{Painted, Pixels};
use glam::{UVec2, Vec2, Vec3};

use super::*;

fn flat() -> Painted {
    let heights = Some(Arc::new(Pixels { size: UVec2::splat(32), values: vec![0.5; 1024] }));
    Painted { heights, ..Painted::default() }
}

fn stroke(brush: &Brush, painted: &Painted, path: &[Vec2]) -> Pixels<f32> {
    let mut stroke = Stroke::begin(painted);
    path.iter().for_each(|at| stroke.move_to(brush, *at, 1.0));
    (*stroke.images().heights.unwrap()).clone()
}

#[test]
fn raise_raises_inside_the_radius_and_nothing_outside() {
    let brush = Brush { radius: 0.2, ..Brush::default() };
    let after = stroke(&brush, &flat(), &[Vec2::splat(0.5)]);
    for (index, value) in after.values.iter().enumerate() {
        let at = (Vec2::new((index % 32) as f32, (index / 32) as f32) + 0.5) / 32.0;
        let inside = at.distance(Vec2::splat(0.5)) < 0.2;
        assert_eq!(*value > 0.5, inside, "{at}: {value}");
    }
}

#[test]
fn a_stroke_over_the_edge_continues_at_the_other_side_only_with_wrap() {
    let path = [Vec2::new(0.9, 0.5), Vec2::new(1.1, 0.5)];
    let wrapped = stroke(&Brush { radius: 0.05, ..Brush::default() }, &flat(), &path);
    let cut = stroke(&Brush { radius: 0.05, wrap: false, ..Brush::default() }, &flat(), &path);
    assert!(wrapped.values[16 * 32 + 1] > 0.5 && cut.values[16 * 32 + 1] == 0.5);
    assert!(cut.values[16 * 32 + 30] > 0.5);
}

#[test]
fn smoothing_reduces_the_spread_of_heights() {
    let mut painted = flat();
    let rough = Arc::make_mut(painted.heights.as_mut().unwrap());
    rough.values.iter_mut().enumerate().for_each(|(k, v)| *v = if (k + k / 32) % 2 == 0 { 0.4 } else { 0.6 });
    let brush = Brush { tool: Tool::Smooth, radius: 0.5, strength: 1.0, falloff: 0.0, ..Brush::default() };
    let after = stroke(&brush, &painted, &[Vec2::splat(0.5)]);
    let spread = |image: &Pixels<f32>| image.values.iter().map(|v| (v - 0.5).powi(2)).sum::<f32>();
    assert!(spread(&after) < 0.4 * spread(painted.heights.as_ref().unwrap()));
}

#[test]
fn every_tool_keeps_heights_finite_and_within_bounds() {
    for tool in Tool::ALL {
        let brush = Brush { tool, strength: 1.0, radius: 0.4, ..Brush::default() };
        let path: Vec<Vec2> = (0..60).map(|k| Vec2::splat(k as f32 * 0.05 - 0.7)).collect();
        let after = stroke(&brush, &flat(), &path);
        assert!(after.values.iter().all(|v| (0.0..=1.0).contains(v)), "{tool:?}");
    }
}

#[test]
fn a_colour_stroke_moves_towards_the_colour_and_leaves_heights() {
    let mut painted = flat();
    painted.colors = Some(Arc::new(Pixels { size: UVec2::splat(8), values: vec![Vec3::ONE; 64] }));
    let brush =
        Brush { tool: Tool::Color, strength: 1.0, color: Vec3::X, radius: 0.3, falloff: 0.0, ..Brush::default() };
    let mut stroke = Stroke::begin(&painted);
    stroke.move_to(&brush, Vec2::splat(0.5), 1.0);
    let Painted { heights, colors, .. } = stroke.images();
    assert_eq!(heights, painted.heights);
    assert_eq!(colors.unwrap().values[8 * 4 + 4], Vec3::X);
}

#[test]
fn a_material_stroke_sets_its_slot_with_a_hard_edge_and_slot_zero_erases_it() {
    let side = 32;
    let slots = Some(Arc::new(Pixels { size: UVec2::splat(side), values: vec![0; (side * side) as usize] }));
    let painted = Painted { slots, ..flat() };
    let run = |painted: &Painted, slot: u8| {
        let brush = Brush { tool: Tool::Material, slot, radius: 0.2, strength: 0.0, ..Brush::default() };
        let mut stroke = Stroke::begin(painted);
        stroke.move_to(&brush, Vec2::splat(0.5), 0.3);
        stroke.images()
    };
    let after = run(&painted, 3);
    assert_eq!(after.heights, painted.heights);
    for (index, slot) in after.slots.as_ref().unwrap().values.iter().enumerate() {
        let at = (Vec2::new((index as u32 % side) as f32, (index as u32 / side) as f32) + 0.5) / side as f32;
        assert_eq!(*slot, if at.distance(Vec2::splat(0.5)) < 0.2 { 3 } else { 0 }, "{at}");
    }
    assert_eq!(run(&after, 0).slots, painted.slots);
}
