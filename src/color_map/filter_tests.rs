use super::super::layers::tests::{RELIEF, resolved};
use super::super::slopes::direction;
use super::*;

fn layers(text: &str) -> LayeredMap {
    resolved(&format!("[color_map]\n{text}"))
}

fn seen(slopes: SlopesSeen<'_>) -> VisibleValues<'_> {
    VisibleValues {
        surface: SurfaceSeen::Gaussian { heights: HeightsSeen::Normal(Normal { mean: 0.4, deviation: 0.8 }), slopes },
        gaussianize: Gaussianize::Auto,
    }
}

const BLEND: &str = "[[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[-1, [1, 0, 0]], [1, [0, 1, 0]]]\n\
    weight = { driver = { kind = \"slope\" }, stops = [[-1, 0], [1, 1]] }\n";

#[test]
fn a_blend_is_the_product_of_the_means_of_independent_maps_and_agrees_with_sampling() {
    let map = layers(BLEND);
    let o = direction(1.0, 0.3);
    let ours = seen(SlopesSeen::Apart(o)).color(&map);
    let slope = RELIEF.slopes.visible(o).driver(0.0);
    let slope = Normal { mean: slope.mean / 0.12_f64.sqrt(), deviation: slope.deviation / 0.12_f64.sqrt() };
    let (mut sum, count) = (DVec3::ZERO, 400);
    for j in 0..count {
        for k in 0..count {
            let z = |k: i32| super::super::normal::quantile((f64::from(k) + 0.5) / f64::from(count));
            let t = ((slope.mean + slope.deviation * z(j)).clamp(-1.0, 1.0) + 1.0) / 2.0;
            let h = ((0.4 + 0.8 * z(k)).clamp(-1.0, 1.0) + 1.0) / 2.0;
            sum += DVec3::new(1.0 - h, h, 0.0) * t / f64::from(count * count);
        }
    }
    assert!((ours - sum).abs().max_element() < 1e-3, "{ours} {sum}");
}

#[test]
fn light_and_brdf_inside_the_mean_of_slopes_differ_from_the_papers_separation_where_it_says_so() {
    // View and light at 60 degrees from opposite sides: the paper's colour is far off.
    let map = layers("[[color_map.layer]]\ndriver = { kind = \"slope\" }\nstops = [[-1, 0], [1, 1]]\n");
    let (o, i) = (direction(1.047, 0.0), direction(1.047, std::f64::consts::PI));
    let weight = |s: DVec2| {
        let cosines = (o.z - s.dot(o.truncate())).max(0.0) * (i.z - s.dot(i.truncate())).max(0.0);
        DVec3::splat(cosines / (1.0 + s.length_squared()).sqrt())
    };
    let joint = seen(SlopesSeen::Joint { weight: &weight, focus: None }).color(&map).x;
    let apart = seen(SlopesSeen::Apart(o)).color(&map).x;
    // By symmetry of view and light the joint distribution has mean 0.
    assert!((joint - 0.5).abs() < 1e-3, "{joint}");
    assert!(apart > 0.6, "{apart}");
}

#[test]
fn the_color_of_facets_is_their_weighted_mean_in_each_channel_and_sums_are_blurred_by_their_noise() {
    let map = layers(
        "[[color_map.layer]]\ndriver = { kind = \"steepness\" }\nunit = \"value\"\nstops = [[0, 0], [1, 1]]\n\
         [[color_map.layer]]\nweight = 0.5\nstops = [[0, 0], [0, 1]]\n[color_map.layer.driver]\nkind = \"sum\"\n\
         terms = [{ driver = { kind = \"height\", noise = 1.0 }, weight = 3.0 }, { driver = { kind = \"slope\" }, weight = 4.0 }]\n",
    );
    // Two heights and slopes; the third channel sees only the first.
    let point = |height, x| SurfacePoint { place: DVec2::ZERO, height, slope: DVec2::new(x, 0.0) };
    let facets = [(point(0.4, 0.2), DVec3::new(1.0, 3.0, 2.0)), (point(0.2, -0.6), DVec3::new(1.0, 1.0, 0.0))];
    let seen = VisibleValues { surface: SurfaceSeen::Facets(&facets), gaussianize: Gaussianize::Auto };
    // Deviations: heights 1 and -1, slopes -0.2 and 0.6 over 0.12^½. The noise in the sum has the deviation of its weight.
    let deviation = |weight: f64| weight / 34.0_f64.sqrt();
    let of = |height: f64, slope: f64, steepness: f64| {
        let sum = deviation(3.0) * height + deviation(4.0) * slope / 0.12_f64.sqrt();
        steepness + 0.5 * super::super::normal::cdf(sum / deviation(3.0))
    };
    let (first, second) = (of(1.0, -0.2, 0.2), of(-1.0, 0.6, 0.6));
    let exact = DVec3::new(0.5 * (first + second), 0.75 * first + 0.25 * second, first);
    let ours = seen.color(&map);
    assert!((ours - exact).abs().max_element() < 1e-9, "{ours} {exact}");
    assert!(naive_color(&map).x > 0.4 && !is_naive_enough(&map));
    // Without weight the mean surface shows, and a map of textures alone has no surface.
    let dark = VisibleValues { surface: SurfaceSeen::Facets(&[]), gaussianize: Gaussianize::Auto };
    assert!((dark.color(&map).x - of(0.0, 0.0, 0.0)).abs() < 1e-9);
}

#[test]
fn a_sum_of_height_and_slope_has_the_moments_of_its_terms() {
    let map = layers(
        "[[color_map.layer]]\nstops = [[-40, 0], [40, 1]]\n[color_map.layer.driver]\nkind = \"sum\"\n\
         terms = [{ driver = { kind = \"height\" }, weight = 3.0 }, { driver = { kind = \"slope\" }, weight = 4.0 }]\n",
    );
    let o = direction(1.2, 0.0);
    let ours = seen(SlopesSeen::Apart(o)).color(&map).x;
    let slope = RELIEF.slopes.visible(o).driver(0.0).mean / 0.12_f64.sqrt();
    let mean = (3.0 * 0.4 + 4.0 * slope) / 5.0;
    assert!((ours - (mean + 40.0) / 80.0).abs() < 1e-6, "{ours}");
}
