// Soft visibility above horizons and between overhangs: the twin of OcclusionIntervals::fill
// (src/visibility/occlusion_intervals.rs).

//!import azimuth_taps

fn above(elevation: f32, edge: f32) -> f32 {
    return clamp((elevation - edge) * sum.sharpness + 0.5, 0.0, 1.0);
}

// If two horizons differ by more than JUMP [rad], they belong to different surfaces. There visibility switches between
// the azimuths over 1/SWITCH of their distance. Both constants are those of src/math/simd/visibility.rs.
const JUMP: f32 = 0.1;
const SWITCH: f32 = 6.0;

// Visibility between two slices, from their horizons and from how much their overhangs hide.
fn between_slices(facet: u32, taps: VisibilityTaps, horizons: vec2f, hidden: vec2f) -> f32 {
    // The facet switches at its own position between two azimuths: multiples of the golden ratio.
    let switch_at = f32(facet * 2654435769u) / 4294967296.0;
    let changed = clamp((taps.blend - switch_at) * SWITCH + 0.5, 0.0, 1.0);
    let rise = horizons.y - horizons.x;
    let between = above(taps.elevation, horizons.x + rise * taps.blend);
    let either = mix(above(taps.elevation, horizons.x), above(taps.elevation, horizons.y), changed);
    let open = select(between, either, abs(rise) > JUMP);
    return max(open - mix(hidden.x, hidden.y, changed), 0.0);
}
