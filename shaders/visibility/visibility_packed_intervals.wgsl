// Visibility from occlusion intervals that the GPU computed (slice_scan.wgsl).

//!import slice_blend

// For each slice, the slope of its horizon and its overhangs; the azimuths of a facet are adjacent. Both ends s of an
// overhang are s/(1 + s) in 65,535ths; 0 follows the last overhang.
@group(1) @binding(2) var<storage, read> slices: array<u32>;

const STORED_OVERHANGS: u32 = 4u;

fn horizon_of(slice: u32) -> f32 {
    return bitcast<f32>(slices[slice * (1u + STORED_OVERHANGS)]);
}

fn slope_of(end: u32) -> f32 {
    // The last value is HorizonMap::BLOCKED.
    return f32(end) / max(f32(65535u - end), 65535.0 / 1e9);
}

fn covered(slice: u32, taps: VisibilityTaps) -> f32 {
    let first = slice * (1u + STORED_OVERHANGS) + 1u;
    var total = 0.0;
    for (var k = 0u; k < STORED_OVERHANGS; k++) {
        let ends = slices[first + k];
        if ends == 0u {
            break;
        }
        total += above(taps, slope_of(ends & 0xffffu)) - above(taps, slope_of(ends >> 16u));
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
