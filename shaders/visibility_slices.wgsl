// Soft visibility above horizons and between what hangs over them: the twin of Slices::fill (src/visibility/slices.rs).

//!import azimuth_sight

// The azimuths of a facet side by side: horizons [rad]; where the hanging intervals of each begin, and where all end;
// the intervals' low and high ends [rad].
@group(1) @binding(2) var<storage, read> slices: array<u32>;

fn above(elevation: f32, edge: u32) -> f32 {
    return clamp((elevation - bitcast<f32>(slices[edge])) * sum.sharpness + 0.5, 0.0, 1.0);
}

fn covered(slice: u32, elevation: f32) -> f32 {
    let slice_count = sum.facet_count * sum.azimuths;
    let starts = slice_count + slice;
    var total = 0.0;
    for (var k = slices[starts]; k < slices[starts + 1u]; k++) {
        let interval = 2u * slice_count + 1u + 2u * k;
        total += above(elevation, interval) - above(elevation, interval + 1u);
    }
    return total;
}

// Horizons further apart than this belong to different things, and how fast one azimuth gives way to the next there: JUMP and
// SWITCH of src/simd/visibility.rs.
const JUMP: f32 = 0.1;
const SWITCH: f32 = 6.0;

fn visibility(facet: u32, sight: Sight) -> f32 {
    let row = facet * sum.azimuths;
    let lower = row + sight.lower;
    let upper = row + sight.upper;
    // The facet's own place between two azimuths: multiples of the golden ratio.
    let place = f32(facet * 2654435769u) / 4294967296.0;
    let changed = clamp((sight.blend - place) * SWITCH + 0.5, 0.0, 1.0);
    let rise = bitcast<f32>(slices[upper]) - bitcast<f32>(slices[lower]);
    let horizon = bitcast<f32>(slices[lower]) + rise * sight.blend;
    let between = clamp((sight.elevation - horizon) * sum.sharpness + 0.5, 0.0, 1.0);
    let either = mix(above(sight.elevation, lower), above(sight.elevation, upper), changed);
    let open = select(between, either, abs(rise) > JUMP);
    let hidden = mix(covered(lower, sight.elevation), covered(upper, sight.elevation), changed);
    return max(open - hidden, 0.0);
}
