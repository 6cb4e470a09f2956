// Soft visibility above horizons and between what hangs over them: the twin of Slices::fill (src/visibility/slices.rs).

//!import azimuth_sight

fn above(elevation: f32, edge: f32) -> f32 {
    return clamp((elevation - edge) * sum.sharpness + 0.5, 0.0, 1.0);
}

// Horizons further apart than this belong to different things, and how fast one azimuth gives way to the next there: JUMP and
// SWITCH of src/simd/visibility.rs.
const JUMP: f32 = 0.1;
const SWITCH: f32 = 6.0;

// From the horizons of the slices on either side, and what hangs over them there.
fn between_slices(facet: u32, sight: Sight, horizons: vec2f, hidden: vec2f) -> f32 {
    // The facet's own place between two azimuths: multiples of the golden ratio.
    let place = f32(facet * 2654435769u) / 4294967296.0;
    let changed = clamp((sight.blend - place) * SWITCH + 0.5, 0.0, 1.0);
    let rise = horizons.y - horizons.x;
    let between = above(sight.elevation, horizons.x + rise * sight.blend);
    let either = mix(above(sight.elevation, horizons.x), above(sight.elevation, horizons.y), changed);
    let open = select(between, either, abs(rise) > JUMP);
    return max(open - mix(hidden.x, hidden.y, changed), 0.0);
}
