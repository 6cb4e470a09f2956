//! Paths of a viewer against the photons of the model and against closed forms.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::effective::PathKind;
use crate::slab::{Channel, ChannelSlab, Inner, Ndf, Optics, Profile};

fn slab(top: Ndf, bottom: Ndf, eta: f64, bounces: bool) -> Arc<Slab> {
    absorbing(top, bottom, eta, 0.0, bounces)
}

fn absorbing(top: Ndf, bottom: Ndf, eta: f64, depth: f64, bounces: bool) -> Arc<Slab> {
    let optics =
        Optics { eta: DVec3::splat(eta), thickness: 1.0, absorption: DVec3::splat(depth), ..Optics::default() };
    let slab = Slab::new(Arc::new(top), Arc::new(bottom), optics, 64);
    let inner = bounces.then(|| Inner::new(&slab.top, &slab.bottom, &optics, 64, 1, &Default::default()).unwrap());
    Arc::new(match inner {
        Some(inner) => slab.with_inner(Arc::new(inner)),
        None => slab,
    })
}

fn ggx(roughness: f64) -> Ndf {
    Ndf::analytic(Profile::Ggx, DVec2::new(roughness, 0.5 * roughness), 0.4)
}

fn viewer(degrees: f32, paths: usize) -> Viewer {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Viewer { o: Vec3::new(0.8 * sin, 0.6 * sin, cos), paths, seed: 5 }
}

/// Parts of the light by kind of path, and the mean direction of transmitted light.
fn parts(view: &SlabView, viewer: &Viewer) -> ([f32; 3], Vec3, [Vec3; 2]) {
    let (mut parts, mut mean) = ([0.0; 3], Vec3::ZERO);
    let even = view.follow(viewer, |end| {
        parts[end.kind as usize] += end.weight.x;
        if end.kind == PathKind::Transmitted {
            mean += end.weight.x * end.direction;
        }
    });
    (parts, mean, even)
}

#[test]
fn paths_have_the_parts_and_the_mean_direction_of_photons() {
    let tilted = Ndf::of_facets(&[(DVec2::new(0.2, 0.1), 2.0), (DVec2::ZERO, 1.0), (DVec2::new(-0.1, 0.0), 1.0)], 64);
    let cases = [
        (ggx(0.3), ggx(0.1), 0.0),
        (Ndf::smooth(), ggx(0.3), 0.0),
        (tilted.unwrap(), ggx(0.2), 0.0),
        (ggx(0.3), ggx(0.2), 0.4),
    ];
    for (top, bottom, depth) in cases {
        let slab = absorbing(top, bottom, 1.5, depth, true);
        let view = SlabView::new(slab.clone());
        for degrees in [0.0, 50.0, 75.0_f32] {
            let viewer = viewer(degrees, 40_000);
            let (found, mean, even) = parts(&view, &viewer);
            let walk = ChannelSlab { top: &slab.top, bottom: &slab.bottom, channel: Channel { eta: 1.5, depth } };
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let photons = 100_000;
            let (mut expected, mut expected_mean, mut masked) = ([0.0; 3], DVec3::ZERO, 0.0);
            for _ in 0..photons {
                let losses = walk.run(viewer.o.as_dvec3(), &mut rng, |exit| {
                    if exit.is_straight {
                        return;
                    }
                    let kind = match (exit.bounces, exit.direction.z < 0.0) {
                        (0, true) => 0,
                        (0, false) => 1,
                        _ => 2,
                    };
                    expected[kind] += exit.weight / f64::from(photons);
                    if kind == 0 {
                        expected_mean += exit.weight / f64::from(photons) * exit.direction;
                    }
                });
                masked += losses.masked / f64::from(photons);
            }
            for (kind, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert!((f64::from(*found) - expected).abs() < 1e-2, "{degrees}, kind {kind}: {found} {expected}");
            }
            assert!((mean.as_dvec3() - expected_mean).length() < 6e-3, "{degrees}: {mean} {expected_mean}");
            assert!((f64::from(even[0].x + even[1].x) - masked).abs() < 1e-2, "{degrees}: {even:?} {masked}");
        }
    }
}

/// A face of which half is level.
fn half_level() -> Ndf {
    let tilted = [DVec2::new(0.2, 0.1), DVec2::new(-0.2, 0.0), DVec2::new(0.0, -0.1)];
    let facets: Vec<_> = tilted.map(|slope| (slope, 1.0)).into_iter().chain([(DVec2::ZERO, 3.0)]).collect();
    Ndf::of_facets(&facets, 64).unwrap()
}

#[test]
fn all_light_is_accounted_for_at_any_roughness_and_angle_and_with_level_facets() {
    let faces = [(ggx(0.01), ggx(0.01)), (ggx(0.2), ggx(0.2)), (ggx(0.6), ggx(0.6)), (half_level(), half_level())];
    for (top, bottom) in faces {
        for eta in [1.0, 1.01, 1.5, 3.0] {
            let name = format!("{} over {}, eta {eta}", top.describe(), bottom.describe());
            let view = SlabView::new(slab(top.clone(), bottom.clone(), eta, true));
            for (degrees, paths) in [(0.0, 64), (45.0, 64), (0.0, 4096), (45.0, 4096), (80.0, 4096), (89.0, 4096)] {
                let viewer = viewer(degrees, paths);
                let (parts, _, even) = parts(&view, &viewer);
                let straight = view.straight(viewer.o);
                let sum = parts.iter().sum::<f32>() + even[0].x + even[1].x + straight[0].x + straight[1].x;
                assert!((sum - 1.0).abs() < 1e-3, "{name}, {degrees}°, {paths} paths: {sum}");
            }
        }
    }
}

#[test]
fn light_that_passes_at_once_is_the_same_with_and_without_reflections_inside() {
    for (top, bottom) in [(ggx(0.3), ggx(0.1)), (half_level(), ggx(0.2)), (half_level(), half_level())] {
        let [with, without] =
            [true, false].map(|bounces| SlabView::new(slab(top.clone(), bottom.clone(), 1.5, bounces)));
        for degrees in [0.0, 50.0] {
            let viewer = viewer(degrees, 4096);
            let [with, without] = [&with, &without].map(|view| parts(view, &viewer).0[0]);
            assert!((with - without).abs() < 5e-3, "{degrees}: {with} {without}");
        }
    }
}

#[test]
fn lobes_of_the_table_are_those_of_many_paths() {
    let view = SlabView::new(slab(ggx(0.2), ggx(0.1), 1.5, true));
    for degrees in [3.0, 40.0, 70.0] {
        let viewer = viewer(degrees, 16_384);
        let (parts, mean, _) = parts(&view, &viewer);
        let lobes = view.lobes(viewer.o);
        assert!((lobes.transmitted.part.x - parts[0]).abs() < 0.02, "{degrees}: {lobes:?} {parts:?}");
        let mean = mean / parts[0];
        assert!((lobes.transmitted.mean - mean.truncate()).length() < 0.02, "{degrees}: {lobes:?} {mean}");
        let sum = lobes.transmitted.part + lobes.reflected.part + lobes.even[0] + lobes.even[1];
        assert!((sum.x - 1.0).abs() < 0.05, "{degrees}: {sum}");
    }
}

#[test]
fn channels_of_different_index_take_different_paths_and_absorption_is_per_channel() {
    let optics = Optics {
        eta: DVec3::new(1.4, 1.5, 1.0),
        thickness: 1.0,
        absorption: DVec3::new(0.0, 0.0, 0.5),
        ..Optics::default()
    };
    let flat = Arc::new(Ndf::smooth());
    let view = SlabView::new(Arc::new(Slab::new(flat, Arc::new(ggx(0.2)), optics, 64)));
    let (mut first, mut blue) = (Vec3::ZERO, 0.0);
    view.follow(&viewer(40.0, 64), |end| {
        assert!(end.weight.x == 0.0 || end.weight.y == 0.0);
        first += end.weight;
        blue += end.weight.z;
    });
    assert!(first.x > 0.5 && first.y > 0.5 && blue == 0.0);
    // A channel without a change of index passes straight, and only absorption weakens it.
    let straight = view.straight(viewer(0.0, 1).o)[0];
    assert!((straight.z - (-0.5f32).exp()).abs() < 1e-6 && straight.x == 0.0);
}
