// Soft visibility above interpolated horizons: the twin of HorizonMap::fill (src/visibility/horizon_map.rs).

//!import azimuth_taps

// Slopes; the azimuths of a facet are adjacent.
@group(1) @binding(2) var<storage, read> horizons: array<f32>;

fn visibility(facet: u32, taps: VisibilityTaps) -> f32 {
    let row = facet * sum.azimuths;
    return clamp(between(taps, vec2f(horizons[row + taps.lower], horizons[row + taps.upper])), 0.0, 1.0);
}
