// Soft visibility above horizons and between overhangs: the twin of OcclusionIntervals::fill
// (src/visibility/occlusion_intervals.rs).

//!import azimuth_taps

fn above(taps: VisibilityTaps, slope: f32) -> f32 {
    return clamp(taps.base - taps.scale * slope, 0.0, 1.0);
}

// If the tangent of the difference of two horizons exceeds JUMP, or JUMP_PART of the higher slope where that is less,
// they belong to different surfaces. There visibility switches between the azimuths over 1/SWITCH of their distance. The
// constants are those of src/math/simd/visibility.rs.
const JUMP: f32 = 0.1;
const JUMP_PART: f32 = 0.5;
const SWITCH: f32 = 6.0;

// Visibility between two slices, from their horizons and from how much their overhangs hide.
fn between_slices(facet: u32, taps: VisibilityTaps, horizons: vec2f, hidden: vec2f) -> f32 {
    // The facet switches at its own position between two azimuths: multiples of the golden ratio.
    let switch_at = f32(facet * 2654435769u) / 4294967296.0;
    let changed = clamp((taps.blend - switch_at) * SWITCH + 0.5, 0.0, 1.0);
    let either = mix(above(taps, horizons.x), above(taps, horizons.y), changed);
    let largest = (1.0 + horizons.x * horizons.y) * min(JUMP, JUMP_PART * max(horizons.x, horizons.y));
    let is_jump = abs(horizons.y - horizons.x) > largest;
    let open = select(clamp(between(taps, horizons), 0.0, 1.0), either, is_jump);
    return max(open - mix(hidden.x, hidden.y, changed), 0.0);
}
