// Visibility from occlusion intervals that the CPU computed.

//!import slice_blend

// The slope of the horizon of each slice, with the azimuths of a facet adjacent; the index of the first overhang of each
// slice, and the end of all; the slopes of the low and high ends of the overhangs.
@group(1) @binding(2) var<storage, read> slices: array<u32>;

fn horizon_of(slice: u32) -> f32 {
    return bitcast<f32>(slices[slice]);
}

fn covered(slice: u32, taps: VisibilityTaps) -> f32 {
    let slice_count = sum.facet_count * sum.azimuths;
    let starts = slice_count + slice;
    var total = 0.0;
    for (var k = slices[starts]; k < slices[starts + 1u]; k++) {
        let interval = 2u * slice_count + 1u + 2u * k;
        total += above(taps, bitcast<f32>(slices[interval])) - above(taps, bitcast<f32>(slices[interval + 1u]));
    }
    return total;
}

fn visibility(facet: u32, taps: VisibilityTaps) -> f32 {
    let row = facet * sum.azimuths;
    let sides = vec2u(row + taps.lower, row + taps.upper);
    let horizons = vec2f(horizon_of(sides.x), horizon_of(sides.y));
    let hidden = vec2f(covered(sides.x, taps), covered(sides.y, taps));
    return between_slices(facet, taps, horizons, hidden);
}
