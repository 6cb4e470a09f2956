// Soft visibility above interpolated horizons: the twin of HorizonMap::fill (src/visibility/horizon_map.rs).

//!import azimuth_taps

// Elevations [rad]; the azimuths of a facet are adjacent.
@group(1) @binding(2) var<storage, read> horizons: array<f32>;

fn visibility(facet: u32, taps: VisibilityTaps) -> f32 {
    let row = facet * sum.azimuths;
    let lower = horizons[row + taps.lower];
    let horizon = lower + (horizons[row + taps.upper] - lower) * taps.blend;
    return clamp((taps.elevation - horizon) * sum.sharpness + 0.5, 0.0, 1.0);
}
