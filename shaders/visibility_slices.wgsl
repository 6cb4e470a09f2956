// Slices of the CPU.

//!import slice_sight

// The azimuths of a facet side by side: horizons [rad]; where the hanging intervals of each begin, and where all end;
// the intervals' low and high ends [rad].
@group(1) @binding(2) var<storage, read> slices: array<u32>;

fn horizon_of(slice: u32) -> f32 {
    return bitcast<f32>(slices[slice]);
}

fn covered(slice: u32, elevation: f32) -> f32 {
    let slice_count = sum.facet_count * sum.azimuths;
    let starts = slice_count + slice;
    var total = 0.0;
    for (var k = slices[starts]; k < slices[starts + 1u]; k++) {
        let interval = 2u * slice_count + 1u + 2u * k;
        total += above(elevation, bitcast<f32>(slices[interval])) - above(elevation, bitcast<f32>(slices[interval + 1u]));
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
