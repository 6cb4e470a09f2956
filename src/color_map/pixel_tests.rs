use super::super::filter::{HeightsSeen, SlopesSeen, SurfaceSeen, VisibleValues};
use super::super::layers::tests::{RELIEF, resolved};
use super::super::slopes::direction;
use super::*;

const LAYERS: &str = "[color_map]\n[[color_map.layer]]\ndriver = { kind = \"height\" }\n\
    stops = [[-1, [0.1, 0.2, 0.3]], [0.2, [0.9, 0.1, 0]], [0.2, 1]]\nweight = 0.5\n\
    [[color_map.layer]]\ndriver = { kind = \"slope\", azimuth_deg = 20 }\nstops = [[-1, 0], [0.3, 0], [0.3, [0, 0.5, 0.2]]]\n\
    [[color_map.layer]]\nstops = [[-1, 0], [1, 0.6]]\n[color_map.layer.driver]\nkind = \"sum\"\n\
    terms = [{ driver = { kind = \"height\", noise = 0.5 }, weight = 1.0 }, { driver = { kind = \"slope\" }, weight = 0.5 }]\n";

/// The colour under normal heights and narrow slopes.
fn color(map: &PixelMap, heights: Normal, slopes: &NarrowSlopes) -> DVec3 {
    let colors = map.at(None);
    let (mut height, mut slope) = (vec![DVec3::ZERO; map.count()], vec![DVec3::ZERO; map.count()]);
    colors.by_heights(&heights, &mut height);
    colors.by_slopes(slopes, &mut slope);
    colors.times_sums(&heights, slopes, &mut slope);
    height.iter().zip(&slope).map(|(height, slope)| *height * *slope).sum()
}

#[test]
fn a_pixel_that_sees_one_point_has_the_colour_of_that_point() {
    // The point's own colour leaves out the noise on heights in a sum.
    let map = resolved(&LAYERS.replace("noise = 0.5", "noise = 0.0"));
    let pixels = PixelMap::new(&map);
    assert_eq!(pixels.slope_axes(), SlopeAxes::All);
    for height in [0.1, 0.29, 0.33, 0.5] {
        for slope in [DVec2::ZERO, DVec2::new(-0.4, 0.3), DVec2::new(0.6, 0.1)] {
            let point = super::super::layers::SurfacePoint { place: DVec2::ZERO, height, slope };
            let ours = color(
                &pixels,
                Normal { mean: height, deviation: 0.0 },
                &NarrowSlopes { mean: slope, covariance: [0.0; 3] },
            );
            let exact = map.color(&point).as_dvec3();
            assert!((ours - exact).abs().max_element() < 1e-5, "{ours} {exact}");
        }
    }
}

#[test]
fn a_pixel_that_sees_the_whole_surface_from_above_has_the_filters_colour() {
    let map = resolved(LAYERS);
    let seen = VisibleValues {
        surface: SurfaceSeen::Gaussian {
            heights: HeightsSeen::Normal(Normal { mean: 0.0, deviation: 1.0 }),
            slopes: SlopesSeen::Apart(direction(0.0, 0.0)),
        },
        gaussianize: crate::scene::Gaussianize::Auto,
    };
    let all = NarrowSlopes { mean: RELIEF.slopes.mean, covariance: RELIEF.slopes.covariance };
    let (ours, exact) = (color(&PixelMap::new(&map), RELIEF.height, &all), seen.color(&map));
    assert!((ours - exact).abs().max_element() < 0.005, "{ours} {exact}");
}

#[test]
fn the_axes_of_slopes_are_those_of_the_layers() {
    let axes = |driver: &str| {
        let text = format!("[color_map]\n[[color_map.layer]]\ndriver = {driver}\nstops = [[0, 0], [1, 1]]\n");
        PixelMap::new(&resolved(&text)).slope_axes()
    };
    assert_eq!(axes("{ kind = \"height\" }"), SlopeAxes::None);
    assert_eq!(axes("{ kind = \"slope\", azimuth_deg = 0 }"), SlopeAxes::One(DVec2::X));
    assert_eq!(axes("{ kind = \"steepness\" }"), SlopeAxes::All);
}
