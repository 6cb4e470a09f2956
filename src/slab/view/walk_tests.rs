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
                let (mut fast, mut simple) = (Tally::default(), Vec::new());
                let mut masked = 0.0;
                for first in (0..viewer.paths).step_by(LANES) {
                    faces.through_both(group, &start, first, &mut fast);
                }
                for path in 0..viewer.paths {
                    masked += through_both(faces, group, &start, path, &mut |end| simple.push(end));
                }
                let lost = [fast.masked, masked];
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
