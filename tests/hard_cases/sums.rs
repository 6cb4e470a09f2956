//! Sums over a million facets in SIMD lanes, against sums of the same terms in f64.

use biscale::math::directions::from_angles;
use biscale::math::simd;
use biscale::math::simd::{Lobe, PairVectors};
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const COUNT: usize = 1_000_000;

#[test]
fn sums_over_a_million_facets_lose_less_than_a_millionth() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let normals: Vec<Vec3> = (0..COUNT)
        .map(|_| from_angles(1.2 * random.random::<f32>(), std::f32::consts::TAU * random.random::<f32>()))
        .collect();
    let [x, y, z]: [Vec<f32>; 3] = std::array::from_fn(|c| normals.iter().map(|n| n[c]).collect());
    // Areas over six orders of magnitude, visibilities between 0 and 1.
    let areas: Vec<f32> = (0..COUNT).map(|_| 1e-6 * 10f32.powf(6.0 * random.random::<f32>())).collect();
    let mut soft = || -> Vec<f32> { (0..COUNT).map(|_| random.random::<f32>()).collect() };
    let (v_i, v_o) = (soft(), soft());
    for (i, o) in [(from_angles(0.3, 1.0), from_angles(0.4, 4.0)), (from_angles(1.5, 0.0), from_angles(1.3, 3.0))] {
        let pair = PairVectors::new(i, o);
        let lobes = [
            ("Lambertian", Lobe::Lambertian),
            ("Blinn-Phong", Lobe::blinn_phong(80.0)),
            ("Cook-Torrance", Lobe::cook_torrance(0.2)),
            ("Ward", Lobe::ward(0.3)),
            ("GGX", Lobe::ggx(0.1)),
        ];
        for (name, lobe) in lobes {
            let mut values = vec![0.0; COUNT];
            simd::lobe_values(lobe, &pair, [&x, &y, &z], &mut values);
            let exact: f64 = (0..COUNT)
                .map(|s| f64::from(values[s]) * f64::from(v_i[s]) * f64::from(v_o[s]) * f64::from(areas[s]))
                .sum();
            let [sum] = simd::lobe_sums(lobe, &pair, [&x, &y, &z], [&areas], &v_i, &v_o);
            assert!((sum / exact - 1.0).abs() < 1e-6, "{name}: {sum} for {exact}");
        }
        let exact: f64 =
            (0..COUNT).map(|s| f64::from(normals[s].dot(o).max(0.0)) * f64::from(v_o[s]) * f64::from(areas[s])).sum();
        let sum = simd::projected_area([&x, &y, &z], &areas, &v_o, o);
        assert!((sum / exact - 1.0).abs() < 1e-6, "projected area: {sum} for {exact}");
    }
    let exact: f64 = (0..COUNT).map(|s| f64::from(areas[s]) * f64::from(v_i[s]) * f64::from(v_o[s])).sum();
    let [sum] = simd::masked_sum([&areas], &v_i, &v_o);
    assert!((sum / exact - 1.0).abs() < 1e-6, "masked sum: {sum} for {exact}");
}
