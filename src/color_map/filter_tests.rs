use super::super::layers::tests::{RELIEF, resolved};
use super::super::slopes::direction;
use super::*;

fn layers(text: &str) -> LayeredMap {
    resolved(&format!("[color_map]\n{text}"))
}

fn seen(slopes: SlopesSeen<'_>) -> VisibleValues<'_> {
    VisibleValues {
        heights: HeightsSeen::Normal(Normal { mean: 0.4, deviation: 0.8 }),
        slopes,
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
fn facets_with_the_weights_of_a_density_give_its_color() {
    let map =
        layers("[[color_map.layer]]\ndriver = { kind = \"steepness\" }\nunit = \"value\"\nstops = [[0, 0], [1, 1]]\n");
    let facets: Vec<(DVec2, f64)> = (0..100).map(|k| (DVec2::new(f64::from(k) / 200.0, 0.0), 1.0)).collect();
    let ours = seen(SlopesSeen::Facets(&facets)).color(&map).x;
    assert!((ours - 0.2475).abs() < 1e-9, "{ours}");
    assert!(naive_color(&map).x > 0.4 && !is_naive_enough(&map));
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
