//! The choice of the algorithm that computes visibility.

use super::{Costs, Preset, SceneFeatures, Settings, VisibilityMethod, is_on};

/// An algorithm that computes visibility.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityAlgorithm {
    /// Nothing is computed: a flat tile blocks nothing.
    None,
    /// A walk over the samples of a height field.
    HeightMarch,
    /// A horizon map from slices through a mesh without overhangs.
    HorizonScan,
    /// A horizon map and intervals above it, from slices through a mesh with overhangs.
    OcclusionIntervals,
    /// Toroidal shadow maps on the CPU.
    CpuMaps,
    /// Toroidal shadow maps on a GPU.
    GpuMaps,
}

impl VisibilityAlgorithm {
    /// The algorithm for a scene. Shadow maps must be asked for: between their directions the error is large where light
    /// passes small holes, and no estimate shows it. A GPU draws them more slowly than a CPU cuts slices.
    pub(super) fn choose(features: &SceneFeatures, settings: &Settings) -> Self {
        if settings.preset == Preset::Wu2011 {
            return Self::CpuMaps;
        }
        if !is_on(settings.effects.visibility, !features.flat && !is_shallow(features, settings)) {
            return Self::None;
        }
        match settings.visibility_method {
            VisibilityMethod::OcclusionIntervals => Self::OcclusionIntervals,
            VisibilityMethod::Maps if features.maps_on_gpu => Self::GpuMaps,
            VisibilityMethod::Maps => Self::CpuMaps,
            VisibilityMethod::Auto if features.height_samples => Self::HeightMarch,
            VisibilityMethod::Auto if features.height_field => Self::HorizonScan,
            VisibilityMethod::Auto => Self::OcclusionIntervals,
        }
    }
}

/// An upper bound of the part of uniform irradiance that slopes can block: sin² of the steepest slope.
pub(super) fn max_blocked_part(features: &SceneFeatures) -> f64 {
    f64::from(features.steepest).sin().powi(2)
}

/// The part of the tolerance that leaving out the visibility of a shallow tile may use.
pub(super) const SHALLOW_PART: f64 = 0.25;

/// Returns true if occlusion can be left out within a quarter of the tolerance: nothing overhangs and no slope is
/// steep. A direction above the steepest slope sees all of a height field.
fn is_shallow(features: &SceneFeatures, settings: &Settings) -> bool {
    features.height_field && features.closes_plane && max_blocked_part(features) <= SHALLOW_PART * settings.tolerance
}

/// Predicted milliseconds of slices under overhangs: cells and triangles visited per facet and azimuth.
pub(super) fn scan_ms(features: &SceneFeatures, settings: &Settings, costs: &Costs) -> f64 {
    let slices = settings.facets as f64 * settings.slice_azimuths as f64;
    slices * features.scan_work * costs.slice_ns * 1e-6 / costs.threads
}

/// Predicted milliseconds of shadow maps: triangles set up and texels covered per direction.
pub(super) fn maps_ms(features: &SceneFeatures, settings: &Settings, costs: &Costs) -> f64 {
    let grid = settings.map_grid;
    let texels = f64::from(settings.map_resolution).powi(2);
    let ring_ns = |ring: usize| {
        let covered = texels * covered_areas(features.area_ratio, f64::from(grid.theta(ring)));
        features.triangles as f64 * costs.triangle_ns + covered * costs.texel_ns
    };
    (0..grid.ring_count()).map(ring_ns).sum::<f64>() * grid.azimuths as f64 * 1e-6 / costs.threads
}

/// The projections of all parts of a surface along a direction at the polar angle `theta`, over the base area. The
/// estimate is exact for a surface of one slope `s` along all azimuths: the mean of `|1 - s tan θ cos φ|`.
fn covered_areas(area_ratio: f64, theta: f64) -> f64 {
    let rise = (area_ratio.powi(2) - 1.0).max(0.0).sqrt() * theta.tan();
    if rise <= 1.0 { 1.0 } else { ((rise.powi(2) - 1.0).sqrt() + (1.0 / rise).asin()) * std::f64::consts::FRAC_2_PI }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steep_views_cover_a_rough_surface_many_times_and_a_level_one_once() {
        for theta in [0.0, 0.7, 1.569] {
            assert!((covered_areas(1.0, theta) - 1.0).abs() < 1e-12);
        }
        // The slope along the azimuth of the view: the mean of |1 - s tan θ cos φ| over azimuths.
        let (area_ratio, theta) = (1.2_f64, 1.4_f64);
        let rise = (area_ratio.powi(2) - 1.0).sqrt() * theta.tan();
        let mean =
            (0..1000).map(|k| (1.0 - rise * (std::f64::consts::TAU * f64::from(k) / 1000.0).cos()).abs()).sum::<f64>()
                / 1000.0;
        assert!((covered_areas(area_ratio, theta) / mean - 1.0).abs() < 1e-4, "{mean}");
        assert!(covered_areas(area_ratio, 1.569) > 100.0);
    }
}
