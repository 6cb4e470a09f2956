//! Lanes of paths against paths followed one by one.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::*;
use crate::slab::view::Source;
use crate::slab::{Ndf, Optics, Profile, Slab, SlabView};

/// The light of one path that is refracted at both faces, step by step; returns the masked part.
fn through_both(faces: &Faces, group: &ChannelGroup, start: &Start, path: usize, end: &mut impl FnMut(PathEnd)) -> f32 {
    let mut masked = 0.0;
    let Some(met) = Met::new(start.ray, faces.top.slope(start.top + path), start.facing, group.eta) else {
        return 0.0;
    };
    let Some(inner) = leave(&faces.top, met.refracted(start.ray.d), true, &mut masked) else { return masked };
    let (slope, area) = if inner.d.z > -STEEP {
        let Some(chosen) = candidate(&faces.bottom, inner.d, start.numbers_below(path)) else { return masked };
        chosen
    } else {
        (faces.bottom.slope(start.below(path)), 1.0)
    };
    let facing = faces.bottom.facing(inner.d) * area;
    let Some(below) = Met::new(inner, slope, facing, 1.0 / group.eta) else { return masked };
    let part = faces.arriving(group, inner.d.z);
    let mut lost = 0.0;
    if below.reflectance < 1.0
        && let Some(out) = leave(&faces.bottom, below.refracted(inner.d), true, &mut lost)
        && !(met.is_level && below.is_level)
    {
        end(PathEnd { kind: PathKind::Transmitted, direction: out.d, weight: part * out.weight });
    }
    masked + lost * grey(group, part)
}

#[test]
fn lanes_of_paths_are_the_paths_followed_one_by_one() {
    let slopes: Vec<_> = (0..600)
        .map(|k| (DVec2::new(0.3 * (f64::from(k) * 0.37).sin(), 0.2 * (f64::from(k) * 0.71).cos()), 1.0))
        .chain([(DVec2::ZERO, 200.0)])
        .collect();
    let analytic = |profile, x, y| Ndf::analytic(profile, DVec2::new(x, y), 0.3);
    let faces = [
        analytic(Profile::Beckmann, 0.1, 0.3),
        analytic(Profile::Ggx, 0.4, 0.2),
        Ndf::of_facets(&slopes, 64).unwrap(),
        Ndf::smooth(),
    ];
    let optics = Optics { thickness: 1.0, absorption: DVec3::new(0.0, 0.2, 0.4), ..Optics::default() };
    for (top, bottom) in faces.iter().flat_map(|top| faces.iter().map(move |bottom| (top, bottom))) {
        let view = SlabView::new(Arc::new(Slab::new(Arc::new(top.clone()), Arc::new(bottom.clone()), optics, 64)));
        for degrees in [0.0, 40.0, 75.0, 89.5_f32] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let viewer = Viewer { o: Vec3::new(0.6 * sin, 0.8 * sin, cos), paths: 150, seed: 3 };
            let Source::Faces { faces, .. } = &view.source else { panic!("no faces") };
            let Some(start) = Start::new(&viewer, faces) else { continue };
            for group in &faces.groups {
                let (mut fast, mut simple) = (Account::default(), Vec::new());
                let mut masked = 0.0;
                for first in (0..viewer.paths).step_by(LANES) {
                    faces.through_both(group, &start, first, &mut fast);
                }
                for path in 0..viewer.paths {
                    masked += through_both(faces, group, &start, path, &mut |end| simple.push(end));
                }
                let lost = [fast.masked as f32, masked];
                let fast = fast.ends;
                let name = format!("{}/{} at {degrees}", top.describe(), bottom.describe());
                assert_eq!(fast.len(), simple.len(), "{name}");
                assert!((lost[0] - lost[1]).abs() < 2e-3 * (1.0 + lost[1]), "{name}: {lost:?}");
                for (a, b) in fast.iter().zip(&simple) {
                    let difference =
                        (a.weight - b.weight).length() + b.weight.length() * (a.direction - b.direction).length();
                    assert!(difference < 2e-3 * b.weight.length().max(0.1), "{name}: {a:?} {b:?}");
                }
            }
        }
    }
}

#[test]
fn unscaled_paths_account_for_the_light_that_sets_out_within_5_per_cent() {
    for (roughness, eta) in [(0.05, 1.5), (0.2, 1.01), (0.2, 1.5), (0.6, 1.5), (0.4, 3.0)] {
        let face = || Arc::new(Ndf::analytic(Profile::Ggx, DVec2::new(roughness, 0.5 * roughness), 0.3));
        let optics = Optics { eta: DVec3::splat(eta), ..Optics::default() };
        let slab = Slab::new(face(), face(), optics, 64);
        let inner = crate::slab::Inner::new(&slab.top, &slab.bottom, &optics, 64, 1, &Default::default()).unwrap();
        for slab in [slab.clone(), slab.with_inner(Arc::new(inner))] {
            let view = SlabView::new(Arc::new(slab));
            let Source::Faces { faces, .. } = &view.source else { panic!("no faces") };
            for degrees in [0.0, 45.0, 75.0, 85.0_f32] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let viewer = Viewer { o: Vec3::new(0.6 * sin, 0.8 * sin, cos), paths: 4096, seed: 3 };
                let start = Start::new(&viewer, faces).unwrap();
                let (inside, entered) = faces.inside(&faces.groups[0], &start);
                let above = faces.above(&faces.groups[0], &start);
                let turned_back = (4096.0 - entered) / start.every as f64;
                let name = format!("roughness {roughness}, eta {eta}, {degrees}°, bounces {}", faces.bounces);
                assert!((inside.all / entered - 1.0).abs() < 0.05, "{name}: {} of {entered}", inside.all);
                // Half a path of 4096, because the difference of two sums is as small near the index 1.
                let bound = 0.05 * turned_back + 0.5;
                assert!((above.all - turned_back).abs() < bound, "{name}: {} of {turned_back}", above.all);
            }
        }
    }
}
