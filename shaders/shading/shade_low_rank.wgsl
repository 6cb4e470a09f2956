// Deferred shading with factors: the twin of LowRank::sums (src/effective/low_rank/), G = Σ_c U_c(i,o) P_c(h,d).

//!import shading_points
//!import scales
//!import shadows_none
//!import polar_grid
//!import tint_row

// True if any channel is a plain table (Lambertian), and if any channel has a factor P.
override HAS_TABLES: bool = true;
override HAS_FACTORS: bool = true;

struct Grids {
    // The grid of visibility: rings, azimuths, nodes.
    rings: u32,
    azimuths: u32,
    nodes: u32,
    channel_count: u32,
    // The grid of half and difference angles: rings and azimuths of h, steps of θ_d and φ_d.
    pairs: vec4u,
    // Offset in p_factors of a_v(o) / cos θ_o, with one value per node of the visibility grid.
    first_area: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

struct Channel {
    // In units of four columns.
    first_u: u32,
    first_p: u32,
    columns: u32,
    is_table: u32,
    tint: Tint,
}

@group(1) @binding(0) var<uniform> grids: Grids;
@group(1) @binding(1) var<storage, read> channels: array<Channel>;
@group(1) @binding(2) var<storage, read> u_factors: array<vec4f>;
@group(1) @binding(3) var<storage, read> p_factors: array<vec4f>;

var<private> io_nodes: array<u32, 16>;
var<private> io_weights: array<f32, 16>;
var<private> hd_nodes: array<u32, 16>;
var<private> hd_weights: array<f32, 16>;

// Two nodes and the weight of the second.
struct Step {
    nodes: vec2u,
    blend: f32,
}

fn step_on(share: f32, count: u32) -> Step {
    let at = clamp(share, 0.0, 1.0) * f32(count - 1u);
    let low = min(u32(at), count - 2u);
    return Step(vec2u(low, low + 1u), at - f32(low));
}

fn step_around(azimuth: f32, count: u32) -> Step {
    let at = fract(azimuth) * f32(count);
    let low = u32(at) % count;
    return Step(vec2u(low, (low + 1u) % count), at - floor(at));
}

// The twin of HalfDifferenceGrid::taps; it computes the frame of h without sines and cosines.
fn find_pair_taps(i: vec3f, h: vec3f) {
    let across = length(h.xy);
    var along = vec2f(1.0, 0.0);
    if across > 0.0 {
        along = h.xy / across;
    }
    let local = vec3f(
        h.z * (along.x * i.x + along.y * i.y) - across * i.z,
        along.x * i.y - along.y * i.x,
        dot(h, i),
    );
    let a = step_on(angle_of(across, h.z) / HALF_PI, grids.pairs.x);
    let b = step_around(azimuth_in_turns(h.xy), grids.pairs.y);
    // Nodes of θ_d are denser near grazing, as in half_difference.rs.
    let theta_d = clamp(angle_of(length(local.xy), local.z) / HALF_PI, 0.0, 1.0);
    let c = step_on(1.0 - sqrt(1.0 - theta_d), grids.pairs.z);
    let d = step_around(2.0 * azimuth_in_turns(local.xy), grids.pairs.w);
    for (var k = 0u; k < 16u; k++) {
        let bit = vec4u(k / 8u, k / 4u, k / 2u, k) & vec4u(1u);
        let blend = vec4f(a.blend, b.blend, c.blend, d.blend);
        let w = select(1.0 - blend, blend, bit == vec4u(1u));
        let row = (a.nodes[bit.x] * grids.pairs.y + b.nodes[bit.y]) * grids.pairs.z + c.nodes[bit.z];
        hd_nodes[k] = row * grids.pairs.w + d.nodes[bit.w];
        hd_weights[k] = w.x * w.y * w.z * w.w;
    }
}

fn find_visibility_taps(to_viewer: Taps, to_light: Taps) {
    for (var k = 0u; k < 16u; k++) {
        io_nodes[k] = to_viewer.nodes[k / 4u] * grids.nodes + to_light.nodes[k % 4u];
        io_weights[k] = to_viewer.weights[k / 4u] * to_light.weights[k % 4u];
    }
}

fn channel_value(channel: Channel) -> f32 {
    if HAS_TABLES && (!HAS_FACTORS || channel.is_table == 1u) {
        var value = 0.0;
        for (var k = 0u; k < 16u; k++) {
            value += io_weights[k] * u_factors[channel.first_u + io_nodes[k] / 4u][io_nodes[k] % 4u];
        }
        return value;
    }
    var value = 0.0;
    if HAS_FACTORS {
        for (var column = 0u; column < channel.columns; column++) {
            var left = vec4f(0.0);
            var right = vec4f(0.0);
            for (var k = 0u; k < 16u; k++) {
                left += io_weights[k] * u_factors[channel.first_u + io_nodes[k] * channel.columns + column];
                right += hd_weights[k] * p_factors[channel.first_p + hd_nodes[k] * channel.columns + column];
            }
            value += dot(left, right);
        }
    }
    return value;
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
    let to_viewer = grid_taps(o, grids.rings, grids.azimuths);
    var area = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let node = to_viewer.nodes[k];
        area += to_viewer.weights[k] * p_factors[grids.first_area + node / 4u][node % 4u];
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
        find_visibility_taps(to_viewer, grid_taps(i, grids.rings, grids.azimuths));
        let h = half_vector(i, o);
        if HAS_FACTORS {
            find_pair_taps(i, h);
        }
        var value = vec3f(0.0);
        for (var c = 0u; c < grids.channel_count; c++) {
            let channel = channels[c];
            value += tint_at(channel.tint, dot(i, h)) * channel_value(channel);
        }
        // Truncated factors may be slightly negative; a BRDF is not.
        total += lights[k].irradiance * max(value, vec3f(0.0)) * (horizon_taper(i.z) * horizon_taper(o.z));
    }
    add_radiance(point, id.y, total * scale);
}
