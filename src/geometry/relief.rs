//! Statistics of a tile's heights and slopes, from which colour maps are standardized.

use glam::{DVec2, DVec3, Vec3};

use super::TileMesh;
use crate::color_map::layers::{Relief, SurfacePoint};
use crate::color_map::slopes::{SlopeDriver, Slopes};
use crate::color_map::{Distribution, Normal};
use crate::scene::GaussianSurface;

/// Smallest vertical part of a normal for its slope. A wall or an overhang counts as this steep.
const STEEPEST: f64 = 1e-3;

/// The slope `(∂h/∂x, ∂h/∂y)` of a surface with this normal.
pub fn slope_of(normal: Vec3) -> DVec2 {
    let normal = normal.as_dvec3();
    -normal.truncate() / normal.z.max(STEEPEST)
}

/// Mean and deviation of heights and slopes over the base area; a surface that overhangs counts in each of its layers.
pub fn relief(mesh: &TileMesh) -> Relief {
    let mut total = 0.0;
    let (low, high) = mesh.z_range();
    // Heights count from the middle, so that an offset loses no digits.
    let middle = 0.5 * f64::from(low + high);
    let mut sums = [0.0; 9];
    for triangle in 0..mesh.triangles.len() {
        let normal = mesh.geometric_normal(triangle);
        let weight = mesh.triangle_area(triangle) * f64::from(normal.z.abs());
        if normal == Vec3::ZERO || !weight.is_finite() {
            continue;
        }
        let z = DVec3::from(mesh.corners(triangle).map(|corner| f64::from(corner.z) - middle));
        let s = slope_of(normal);
        // ∫ z² over a triangle is exact with the products of its corners.
        let square = (z.length_squared() + z.x * z.y + z.y * z.z + z.z * z.x) / 6.0;
        let mean = z.element_sum() / 3.0;
        let length = s.length();
        let terms = [mean, square, s.x, s.y, s.x * s.x, s.x * s.y, s.y * s.y, length, length * length];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        total += weight;
    }
    let [mean, square, x, y, xx, xy, yy, length, length2] = sums.map(|sum| if total > 0.0 { sum / total } else { 0.0 });
    let deviation = |square: f64, mean: f64| (square - mean * mean).max(0.0).sqrt();
    // Below the rounding of positions there is no relief.
    let rounding = 1e-6 * f64::from(mesh.size.max_element());
    let spread = deviation(square, mean);
    let height = Normal { mean: middle + mean, deviation: if spread > rounding { spread } else { 0.0 } };
    let covariance = [(xx - x * x).max(0.0), xy - x * y, (yy - y * y).max(0.0)];
    Relief {
        height,
        slopes: Slopes { mean: DVec2::new(x, y), covariance },
        steepness: Normal { mean: length, deviation: deviation(length2, length) },
    }
}

/// The statistics of an analytic surface.
pub fn relief_of_surface(surface: &GaussianSurface) -> Relief {
    let [xx, xy, yy] = surface.slope_covariance.to_array().map(f64::from);
    let slopes = Slopes { mean: surface.slope_mean.as_dvec2(), covariance: [xx, xy, yy] };
    let [steepness, ..] = slopes.weighted(&SlopeDriver::Steepness, None, &|_| DVec3::ONE);
    let steepness = steepness
        .map_or(Normal { mean: 0.0, deviation: 0.0 }, |of| Normal { mean: of.mean(), deviation: of.deviation() });
    Relief { height: Normal { mean: 0.0, deviation: f64::from(surface.height) }, slopes, steepness }
}

/// A point of the surface as a colour map takes it. `position` is in tile units.
pub fn surface_point(mesh_size: glam::Vec2, position: Vec3, normal: Vec3) -> SurfacePoint {
    SurfacePoint {
        place: (position.truncate() / mesh_size).as_dvec2(),
        height: f64::from(position.z),
        slope: slope_of(normal),
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use glam::{UVec2, Vec2};

    use super::*;
    use crate::geometry::families::heightfield;

    #[test]
    fn the_relief_of_a_wave_is_that_of_a_sine_for_tiles_of_any_size() {
        for size in [1e-6_f32, 1.0, 1e6] {
            let wave = move |p: Vec2| size * (3.0 + 0.1 * (TAU * p.x / size).sin());
            let mesh = heightfield::from_function(UVec2::new(256, 4), Vec2::splat(size), wave);
            let relief = relief(&mesh);
            let unit = f64::from(size);
            let close = |ours: f64, exact: f64| assert!((ours - exact).abs() < 2e-3 * exact, "{size}: {ours} {exact}");
            close(relief.height.mean, 3.0 * unit);
            close(relief.height.deviation, 0.1 * unit / 2.0_f64.sqrt());
            close(relief.slopes.covariance[0], (0.1 * f64::from(TAU)).powi(2) / 2.0);
            assert!(relief.slopes.covariance[2].abs() < 1e-6 && relief.slopes.mean.length() < 1e-4);
        }
    }

    #[test]
    fn a_flat_tile_has_no_deviation_wherever_it_lies() {
        let mesh = heightfield::from_function(UVec2::splat(8), Vec2::ONE, |_| 1000.3);
        assert_eq!(relief(&mesh).height.deviation, 0.0);
    }
}
