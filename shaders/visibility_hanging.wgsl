// Slices that the device made (slice_scan.wgsl).

//!import slice_sight

// The azimuths of a facet side by side, of each its horizon [rad] and its hanging intervals: both ends in 65,535ths of
// Horizons::BLOCKED, 0 after the last.
@group(1) @binding(2) var<storage, read> slices: array<u32>;

const KEPT: u32 = 4u;
const STEP: f32 = 1.59079632679490 / 65535.0;

fn horizon_of(slice: u32) -> f32 {
    return bitcast<f32>(slices[slice * (1u + KEPT)]);
}

fn covered(slice: u32, elevation: f32) -> f32 {
    let first = slice * (1u + KEPT) + 1u;
    var total = 0.0;
    for (var k = 0u; k < KEPT; k++) {
        let ends = slices[first + k];
        if ends == 0u {
            break;
        }
        total += above(elevation, STEP * f32(ends & 0xffffu)) - above(elevation, STEP * f32(ends >> 16u));
    }
    return total;
}

fn visibility(facet: u32, sight: Sight) -> f32 {
    let row = facet * sum.azimuths;
    let sides = vec2u(row + sight.lower, row + sight.upper);
    let horizons = vec2f(horizon_of(sides.x), horizon_of(sides.y));
    let hidden = vec2f(covered(sides.x, sight.elevation), covered(sides.y, sight.elevation));
    return between_slices(facet, sight, horizons, hidden);
}
