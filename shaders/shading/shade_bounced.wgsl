// Adds interreflection from its table: the twin of InterreflectionTable::eval_lights (src/interreflection/table.rs).

//!import shading_points
//!import scales
//!import shadows_none
//!import polar_grid
//!import cubic

struct Grid {
    // Rings without the one at the horizon.
    rings: u32,
    // Columns of a row of values.
    columns: u32,
    // Base area of the tile: the table holds G, and the sums over facets hold G times this area.
    base_area: f32,
    pad: u32,
}

@group(1) @binding(0) var<uniform> grid: Grid;
// The first node of each ring, and the number of all nodes.
@group(1) @binding(1) var<storage, read> starts: array<u32>;
// G in RGB. A row for each node of the viewer holds the rings of the light; the first three azimuths of a ring follow
// its last one.
@group(1) @binding(2) var<storage, read> values: array<vec4f>;

// Four consecutive azimuths of a ring.
struct RingTaps {
    ring: u32,
    first: u32,
    weights: vec4f,
}

// The elevation of a ring. Ring -1 lies beyond the pole.
fn elevation(ring: i32) -> f32 {
    if ring < 0 {
        return (f32(ring) + 0.5) * HALF_PI / f32(grid.rings);
    }
    return ring_theta(u32(ring), grid.rings);
}

// Weights of three values for the slope of their parabola at the middle one; `left` and `right` are the distances.
fn parabola_slope(left: f32, right: f32) -> vec3f {
    return vec3f(-right / left, right / left - left / right, left / right) / (left + right);
}

// The twin of elevation_weights (src/math/directions/reduced_grid.rs): a cubic whose slopes at `lower` and at the next
// ring are those of parabolas, or of the line where no ring follows.
fn elevation_weights(lower: i32, theta: f32) -> vec4f {
    let at_lower = elevation(lower);
    let at_upper = elevation(lower + 1);
    let width = at_upper - at_lower;
    let t = clamp((theta - at_lower) / width, 0.0, 1.0);
    let t2 = t * t;
    let t3 = t2 * t;
    let upper = 3.0 * t2 - 2.0 * t3;
    let upper_slope = t3 - t2;
    let lower_slope = (t3 - 2.0 * t2 + t) * width * parabola_slope(at_lower - elevation(lower - 1), width);
    let weights = vec4f(0.0, 1.0 - upper, upper, 0.0) + vec4f(lower_slope, 0.0);
    if lower + 2 > i32(grid.rings) {
        return weights + upper_slope * vec4f(0.0, -1.0, 1.0, 0.0);
    }
    return weights
        + vec4f(0.0, upper_slope * width * parabola_slope(width, elevation(lower + 2) - at_upper));
}

fn azimuth_count(ring: u32) -> u32 {
    return starts[ring + 1u] - starts[ring];
}

// The twin of ReducedGrid::cubic_taps.
fn cubic_taps(d: vec3f) -> array<RingTaps, 4> {
    let theta = angle_of(length(d.xy), d.z);
    let turns = azimuth_in_turns(d.xy);
    let last = i32(grid.rings);
    let at = clamp(theta / HALF_PI * f32(grid.rings) - 0.5, -0.5, f32(last));
    let lower = min(i32(floor(at)), last - 1);
    var weights = cubic_weights(at - f32(lower));
    if lower + 2 >= last {
        weights = elevation_weights(lower, theta);
    }
    var taps: array<RingTaps, 4>;
    for (var k = 0; k < 4; k++) {
        // Ring -1 is ring 0, half a turn further.
        let knot = min(lower - 1 + k, last);
        let ring = u32(select(knot, -1 - knot, knot < 0));
        let count = azimuth_count(ring);
        let along = fract(select(turns, turns + 0.5, knot < 0)) * f32(count);
        let second = u32(along);
        taps[k] = RingTaps(ring, (second + count - 1u) % count, weights[k] * cubic_weights(along - floor(along)));
    }
    return taps;
}

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if is_empty(point) || scales[point] == 0.0 {
        return;
    }
    let frame = frame_of(point);
    let o = view_of(point, frame);
    // The sixteen rows around the viewer.
    var rows: array<u32, 16>;
    var row_weights: array<f32, 16>;
    var to_viewer = cubic_taps(o);
    for (var k = 0u; k < 16u; k++) {
        let taps = to_viewer[k / 4u];
        rows[k] = (starts[taps.ring] + (taps.first + k % 4u) % azimuth_count(taps.ring)) * grid.columns;
        row_weights[k] = taps.weights[k % 4u];
    }
    var total = vec3f(0.0);
    for (var k = id.y * params.slice; k < light_end(id.y); k++) {
        let i = in_tangent(frame, lights[k].direction);
        if i.z <= 0.0 || !is_light_visible(point, k) {
            continue;
        }
        var to_light = cubic_taps(i);
        var value = vec4f(0.0);
        for (var r = 0u; r < 4u; r++) {
            let taps = to_light[r];
            let column = starts[taps.ring] + 3u * taps.ring + taps.first;
            for (var row = 0u; row < 16u; row++) {
                let at = rows[row] + column;
                value += row_weights[row]
                    * (taps.weights.x * values[at] + taps.weights.y * values[at + 1u]
                        + taps.weights.z * values[at + 2u] + taps.weights.w * values[at + 3u]);
            }
        }
        // A cubic may be below zero; no reflected light is.
        total += lights[k].irradiance * max(value.rgb, vec3f(0.0));
    }
    add_radiance(point, id.y, total * (grid.base_area * scales[point]));
}
