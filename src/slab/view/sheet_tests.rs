use super::*;
use crate::slab::capture::bounced::{ALPHAS, Bounced, ROUGHNESSES, SheetBounces};
use crate::slab::capture::simulated::varying_sheet;
use crate::slab::ring_table::RingTable;

/// The light that arrives from directions below, by the BTDF at pixel centres: radiance `1 + d.x + d.y²`.
fn integrated(sheet: &Svbtdf, pixel: usize, o: DVec3) -> f64 {
    let side = 400;
    let mut sum = 0.0;
    for k in 0..side * side {
        let p = (DVec2::new((k % side) as f64, (k / side) as f64) + 0.5) * (2.0 / side as f64) - 1.0;
        if p.length_squared() < 1.0 {
            let d = p.extend(-(1.0 - p.length_squared()).sqrt());
            sum += (sheet.btdf(pixel, o, d).x - f64::from(sheet.diffuse[pixel].x)) * (1.0 + d.x + d.y * d.y);
        }
    }
    sum * (2.0 / side as f64).powi(2)
}

#[test]
fn paths_and_lobes_of_a_captured_sheet_gather_the_light_of_its_btdf() {
    let sheet = Arc::new(varying_sheet([6, 4]));
    let view = SheetView::new(sheet.clone());
    for (pixel, degrees) in [(0, 0.0), (9, 30.0), (17, 60.0_f32)] {
        let place = (Vec2::new((pixel % 6) as f32, (pixel / 6) as f32) + 0.5) / Vec2::new(6.0, 4.0);
        let point = view.at(place);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let viewer = Viewer { o: Vec3::new(0.6 * sin, 0.8 * sin, cos), paths: 4096, seed: 7 };
        let expected = integrated(&sheet, pixel, viewer.o.as_dvec3());
        let mut sum = 0.0;
        let even = point.follow(&viewer, |end| {
            sum += f64::from(end.weight.x * (1.0 + end.direction.x + end.direction.y.powi(2)));
        });
        assert!((sum / expected - 1.0).abs() < 0.01, "{pixel}: {sum} {expected}");
        assert!((even[0].x - PI * sheet.diffuse[pixel].x).abs() < 1e-6 && even[1] == Vec3::ZERO);
        let ViewLobe { part, mean, covariance, .. } = point.lobes(viewer.o).transmitted;
        let draft = f64::from(part.x * (1.0 + mean.x + mean.y.powi(2) + covariance[2]));
        assert!((draft / expected - 1.0).abs() < 0.1, "{pixel}: draft {draft}, {expected}");
    }
}

#[test]
fn light_reflected_inside_a_captured_sheet_is_even() {
    let plain = varying_sheet([6, 4]);
    let tables = vec![RingTable::new(vec![0.05; RingTable::LEN]); ROUGHNESSES * ALPHAS];
    let bounced = Some(SheetBounces::new(Arc::new(Bounced::of_tables(tables)), &plain.models));
    let view = SheetView::new(Arc::new(Svbtdf { bounced, ..plain }));
    let point = view.at(Vec2::splat(0.3));
    let viewer = Viewer { o: Vec3::new(0.6, 0.0, 0.8), paths: 16, seed: 1 };
    let expected = PI * (point.diffuse + 0.05 * point.scale);
    for even in [point.follow(&viewer, |_| {}), point.lobes(viewer.o).even] {
        assert!((even[0] - expected).length() < 1e-3 && even[1] == Vec3::ZERO, "{even:?} {expected}");
    }
}

#[test]
fn places_between_pixels_are_interpolated_and_the_sheet_repeats() {
    let sheet = Arc::new(varying_sheet([8, 8]));
    let view = SheetView::new(sheet.clone());
    let alpha = |x: f32| view.at(Vec2::new(x, 0.3)).alpha;
    assert!((alpha(0.25) - 0.5 * (alpha(0.1875) + alpha(0.3125))).abs() < 1e-6);
    assert!((alpha(1.1) - alpha(0.1)).abs() < 1e-6 && (alpha(-0.9) - alpha(0.1)).abs() < 1e-6);
    let weights: f32 = view.at(Vec2::splat(0.77)).parts.iter().map(|part| part.1).sum();
    assert!((weights - 1.0).abs() < 1e-5, "{weights}");
}
