use super::*;
use crate::render::lighting::environment::load;
use std::path::Path;

fn sum(lights: &[DirectionalLight]) -> DVec3 {
    lights.iter().map(|l| l.irradiance.as_dvec3()).sum()
}

#[test]
fn energy_is_conserved_per_channel_for_any_count() {
    for name in ["studio", "clear_sky", "overcast_sky", "sun"] {
        let map = load(name, Path::new(".")).unwrap().map;
        for count in [1, 2, 7, 32, 200] {
            let lights = split(&map, count);
            assert!(lights.len() <= count, "{name} {count}");
            let relative = (sum(&lights) - map.total()).length() / map.total().length();
            assert!(relative < 1e-6, "{name} {count}: {relative}");
            assert!(lights.iter().all(|l| (l.direction.length() - 1.0).abs() < 1e-5));
        }
    }
}

#[test]
fn a_single_pixel_sun_gets_its_own_light_with_its_exact_energy() {
    let mut map = LatLongMap::from_fn(128, 64, |d| DVec3::splat(0.3 + 0.2 * d.y));
    let (row, column) = (20, 77);
    map.texels[row * 128 + column] = Vec3::new(9e4, 8e4, 6e4);
    let lights = split(&map, 16);
    let direction = map.direction(77.5, 20.5).as_vec3();
    let suns: Vec<_> = lights.iter().filter(|l| l.direction.dot(direction) > 0.999_999).collect();
    assert_eq!(suns.len(), 1);
    let expected = DVec3::new(9e4, 8e4, 6e4) * map.solid_angle(row);
    assert!((suns[0].irradiance.as_dvec3() - expected).length() / expected.length() < 1e-6);
    assert_eq!(lights.len(), 16);
}

#[test]
fn a_black_map_gives_no_lights_and_a_lone_texel_one() {
    assert!(split(&LatLongMap::from_fn(16, 8, |_| DVec3::ZERO), 32).is_empty());
    assert!(split(&LatLongMap::default(), 32).is_empty());
    let one = split(&LatLongMap::from_fn(1, 1, |_| DVec3::ONE), 32);
    assert_eq!(one.len(), 1);
    assert!((one[0].irradiance.x - 4.0 * std::f32::consts::PI).abs() < 1e-5);
}

#[test]
fn irradiance_on_any_normal_approaches_the_integral_as_lights_are_added() {
    let map = load("studio", Path::new(".")).unwrap().map;
    let normals: Vec<_> = (0..60)
        .map(|k| {
            let (y, phi) = (1.0 - (f64::from(k) + 0.5) / 30.0, 2.399_963 * f64::from(k));
            let s = (1.0 - y * y).sqrt();
            DVec3::new(s * phi.cos(), y, s * phi.sin())
        })
        .collect();
    let exact: Vec<f64> = normals
        .iter()
        .map(|n| {
            let all = map.texels.iter().enumerate();
            all.map(|(k, t)| {
                let (row, column) = (k / map.width, k % map.width);
                let cosine = map.direction(column as f64 + 0.5, row as f64 + 0.5).dot(*n).max(0.0);
                luminance(t.as_dvec3()) * cosine * map.solid_angle(row)
            })
            .sum()
        })
        .collect();
    let error = |count: usize| {
        let lights = split(&map, count);
        let of = |n: &DVec3| -> f64 {
            lights.iter().map(|l| luminance(l.irradiance.as_dvec3()) * l.direction.as_dvec3().dot(*n).max(0.0)).sum()
        };
        let square: f64 = normals.iter().zip(&exact).map(|(n, exact)| (of(n) - exact).powi(2)).sum();
        (square / exact.iter().map(|e| e * e).sum::<f64>()).sqrt()
    };
    let errors = [8, 32, 128].map(error);
    eprintln!("studio: relative irradiance error with 8, 32, 128 lights: {errors:?}");
    assert!(errors[0] < 0.15 && errors[1] < 0.05 && errors[2] < 0.02, "{errors:?}");
}
