use glam::UVec2;

use super::*;
use crate::color_map::stops::tests::{MAPS, map};
use crate::scene::{NoiseBasis, NoiseDriver};

/// Textures of 256² from normal noise: the data of the accuracy table.
fn data() -> Vec<(&'static str, DriverGrid)> {
    let noise = |basis| DriverGrid::of_noise(&NoiseDriver { basis, cells: 32, octaves: 1, seed: 2 });
    let g = noise(NoiseBasis::Gaussian);
    let of = |f: &dyn Fn(f64) -> f64| {
        let values: Vec<f32> = g.values.iter().map(|value| f(f64::from(*value)) as f32).collect();
        DriverGrid::new(g.size, &values, 1)
    };
    vec![
        ("gaussian", of(&|z| z)),
        ("perlin", noise(NoiseBasis::Perlin)),
        ("absolute", of(&f64::abs)),
        ("bimodal", of(&|z| (3.0 * z).tanh())),
        ("lognormal", of(&|z| (0.8 * z).exp())),
    ]
}

#[test]
fn far_means_of_textures_of_any_distribution_are_within_0_005_of_the_plain_means() {
    let mut worst_without = 0.0_f64;
    for (name, grid) in data() {
        let driver = Arc::new(PlaceDriver::new(grid));
        let mut square = 0.0;
        for kind in MAPS {
            let far = Footprint { centre: DVec2::splat(0.3), covariance: DMat2::from_diagonal(DVec2::splat(1e6)) };
            let plain = driver.plain_mean(&map(kind));
            let ours = PlaceMap::new(driver.clone(), &map(kind), Gaussianize::Auto).mean(&far, 4);
            let without = PlaceMap::new(driver.clone(), &map(kind), Gaussianize::Off).mean(&far, 4);
            square += (ours - plain).length_squared() / 9.0;
            worst_without = worst_without.max(((without - plain).length_squared() / 3.0).sqrt());
        }
        println!("far mean of {name}: rms {:.4}", square.sqrt());
        assert!(square.sqrt() < 0.005, "{name}: {}", square.sqrt());
    }
    println!("without ranks: worst {worst_without:.4}");
    assert!(worst_without > 0.03);
}

#[test]
fn constant_two_valued_and_nearly_constant_textures_have_their_mean_colour_far_away_and_no_nan_near() {
    let nearly: Vec<f32> = (0..64).map(|k| if k == 13 { 5.0 } else { 1.0 }).collect();
    let two: Vec<f32> = (0..64).map(|k| f32::from(u8::from(k % 8 < 3))).collect();
    for values in [vec![2.0; 64], nearly, two] {
        let driver = Arc::new(PlaceDriver::new(DriverGrid::new(UVec2::splat(8), &values, 1)));
        for gaussianize in [Gaussianize::Auto, Gaussianize::On] {
            let place = PlaceMap::new(driver.clone(), &map("bands"), gaussianize);
            let plain = driver.plain_mean(&map("bands"));
            let far = place.map().mean(&place.whole());
            assert!((far - plain).abs().max_element() < 0.02, "{gaussianize:?}: {far} {plain}");
            for width in [0.0, 1e-6, 0.1, 3.0] {
                let covariance = DMat2::from_diagonal(DVec2::new(width, width / 64.0));
                let color = place.mean(&Footprint { centre: DVec2::new(0.9, -3.3), covariance }, 16);
                assert!(color.is_finite() && color.min_element() >= 0.0 && color.max_element() <= 1.0);
            }
        }
    }
}

#[test]
fn on_a_linear_map_the_naive_value_is_the_filtered_one() {
    let (_, grid) = data().swap_remove(0);
    let stops = [(-40.0, 0.0), (0.0, 0.5), (40.0, 1.0)];
    let stops = stops.map(|(value, grey)| crate::color_map::Stop { value, color: DVec3::splat(grey) });
    let linear = StopMap::new(stops.to_vec());
    let place = PlaceMap::new(Arc::new(PlaceDriver::new(grid)), &linear, Gaussianize::Off);
    for width in [1e-4, 0.02, 0.5] {
        let covariance = DMat2::from_diagonal(DVec2::splat(width * width));
        let at = Footprint { centre: DVec2::new(0.2, 0.7), covariance };
        let naive = linear.color(place.moments(&at, 4).mean);
        assert!((place.mean(&at, 4) - naive).abs().max_element() < 1e-9);
    }
}
