// Deferred shading with a table over half and difference angles: the twin of ShadingTable::sums
// (src/effective/shading_table/), a_v f̄ = Σ_c w_c(i,o) T_c(i,o).

//!import shading_points
//!import scales
//!import shadows_none
//!import polar_grid
//!import cubic
//!import column_tints

// Groups of four columns per node, and whether interpolation along θ_d is cubic.
override FOURS: u32 = 1u;
override CUBIC: bool = true;

struct Table {
    // Rings and azimuths of h, steps of φ_d and of θ_d.
    pairs: vec4u,
    // The polar grid of the projected area.
    rings: u32,
    azimuths: u32,
    // HemispherePairGrid::CROWDING.
    crowding: f32,
    pad: u32,
}

@group(1) @binding(0) var<uniform> table: Table;
// [θ_h][φ_h][φ_d][θ_d][four], with one more step of θ_d at either end.
@group(1) @binding(2) var<storage, read> values: array<vec4f>;
// a_v(o) / cos θ_o.
@group(1) @binding(3) var<storage, read> areas: array<f32>;

// The interpolation of a pair: its eight corners in (θ_h, φ_h, φ_d), with the offset of the first of four steps of θ_d
// and a weight each; and the weights along θ_d.
struct TableTaps {
    starts: array<u32, 8>,
    weights: array<f32, 8>,
    along: vec4f,
    i_dot_h: f32,
}

// The twin of the CPU's grid coordinates of pairs (src/math/simd/pairs.rs) and of Interpolation::weights.
fn table_taps(i: vec3f, o: vec3f) -> TableTaps {
    let h = i + o;
    let across = length(h.xy);
    let size = max(length(vec2f(across, h.z)), 1e-20);
    let sine = across / size;
    let cosine = max(h.z / size, 1e-20);
    var axis = vec2f(1.0, 0.0);
    if across >= 1e-9 * size {
        axis = h.xy / max(across, 1e-30);
    }
    // The light in the frame of h.
    let d = vec3f(
        cosine * (axis.x * i.x + axis.y * i.y) - sine * i.z,
        axis.x * i.y - axis.y * i.x,
        0.5 * size,
    );
    let n = sine * abs(d.x);
    let r = sqrt(n * n + cosine * cosine * (d.x * d.x + d.y * d.y));
    let u = sqrt(min(r * (r + n) / ((1.0 + d.z) * cosine * cosine), 1.0));
    let c = 1.0 + table.crowding;
    let root = sqrt(max(c * c - 4.0 * table.crowding * u, 0.0));
    let theta_d = min(2.0 * u / (c + root), 1.0) * f32(table.pairs.w - 1u);
    let ring = min(sqrt(sine * sine / (1.0 + cosine)), 1.0) * f32(table.pairs.x - 1u);
    let azimuth = azimuth_in_turns(axis) * f32(table.pairs.y);
    let half_turns = angle_of(abs(d.y), select(d.x, -d.x, d.y < 0.0)) / PI;
    let phi_d = min(half_turns, 1.0) * f32(table.pairs.z);

    let low_ring = min(u32(ring), table.pairs.x - 2u);
    let low_azimuth = min(u32(azimuth), table.pairs.y - 1u);
    let low_phi_d = min(u32(phi_d), table.pairs.z - 1u);
    let low_theta_d = min(u32(theta_d), table.pairs.w - 2u);
    let blend = vec3f(ring - f32(low_ring), azimuth - f32(low_azimuth), phi_d - f32(low_phi_d));
    let stored = table.pairs.w + 2u;
    var taps: TableTaps;
    for (var k = 0u; k < 8u; k++) {
        let bit = vec3u(k / 4u, k / 2u, k) & vec3u(1u);
        let w = select(1.0 - blend, blend, bit == vec3u(1u));
        let column = (low_azimuth + bit.y) % table.pairs.y;
        let row = ((low_ring + bit.x) * table.pairs.y + column) * table.pairs.z + (low_phi_d + bit.z) % table.pairs.z;
        taps.starts[k] = (row * stored + low_theta_d) * FOURS;
        taps.weights[k] = w.x * w.y * w.z;
    }
    let t = theta_d - f32(low_theta_d);
    taps.along = vec4f(0.0, 1.0 - t, t, 0.0);
    if CUBIC {
        taps.along = cubic_weights(t);
    }
    taps.i_dot_h = min(d.z, 1.0);
    return taps;
}

fn four_at(taps: ptr<function, TableTaps>, four: u32) -> vec4f {
    var total = vec4f(0.0);
    for (var k = 0u; k < 8u; k++) {
        let start = taps.starts[k] + four;
        var sum = values[start + FOURS] * taps.along.y + values[start + 2u * FOURS] * taps.along.z;
        if CUBIC {
            sum += values[start] * taps.along.x + values[start + 3u * FOURS] * taps.along.w;
        }
        total += sum * taps.weights[k];
    }
    // A cubic may fall below zero; a sum does not.
    return max(total, vec4f(0.0));
}

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if is_empty(point) {
        return;
    }
    let frame = frame_of(point);
    let o = view_of(point, frame);
    if o.z <= 0.0 {
        set_scale(point, id.y, 0.0);
        return;
    }
    let to_viewer = grid_taps(o, table.rings, table.azimuths);
    var area = 0.0;
    for (var k = 0u; k < 4u; k++) {
        area += to_viewer.weights[k] * areas[to_viewer.nodes[k]];
    }
    area *= o.z;
    let scale = select(0.0, 1.0 / area, area > params.min_area);
    set_scale(point, id.y, scale);
    if scale == 0.0 {
        return;
    }
    var total = vec3f(0.0);
    for (var k = id.y * params.slice; k < light_end(id.y); k++) {
        let i = in_tangent(frame, lights[k].direction);
        if i.z <= 0.0 || !is_light_visible(point, k) {
            continue;
        }
        var taps = table_taps(i, o);
        var value = vec3f(0.0);
        for (var four = 0u; four < FOURS; four++) {
            let sums = four_at(&taps, four);
            for (var c = 0u; c < 4u; c++) {
                value += column_weight(4u * four + c, i, o, taps.i_dot_h) * sums[c];
            }
        }
        total += lights[k].irradiance * value;
    }
    add_radiance(point, id.y, total * scale);
}
