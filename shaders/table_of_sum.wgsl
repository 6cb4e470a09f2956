// Adds a sum over some facets to its columns of a table, at every node that is no image of another: the twin of
// PairTable::build (src/filtering/pair_table). A thread a node; its neighbours read the same facets at the same time.

//!import table_nodes
//!import flat_index
//!import vectors
//!import visibility_unblocked
//!import weights_area
//!import lobe_input
//!import sum_facets

fn lifted(d: vec3f) -> vec3f {
    return unit_or(vec3f(d.xy, max(d.z, nodes.lowest)), vec3f(0.0, 0.0, 1.0));
}

// The twin of UpperPairs::pair (src/directions/upper_pairs.rs).
fn pair_at(ring: u32, phi: Angle, turn: Angle, step: u32) -> Pair {
    let s = f32(ring) / f32(nodes.pairs.x - 1u);
    let m = max(1.0 - s * s, nodes.lowest);
    let sin_theta_h = sqrt(max(1.0 - m * m, 0.0));
    let frame = mat3x3f(
        vec3f(m * phi.cosine, m * phi.sine, -sin_theta_h),
        vec3f(-phi.sine, phi.cosine, 0.0),
        vec3f(sin_theta_h * phi.cosine, sin_theta_h * phi.sine, m),
    );
    let x = f32(step) / f32(nodes.pairs.w - 1u);
    let u = x * (1.0 + nodes.crowding - nodes.crowding * x);
    let n = sin_theta_h * abs(turn.cosine);
    let r = length(vec2f(n, m));
    let versine = min(u * u * m * m / (r * (r + n)), 1.0 - nodes.lowest);
    let sin_theta_d = sqrt(versine * (2.0 - versine));
    let across = vec3f(sin_theta_d * turn.cosine, sin_theta_d * turn.sine, 0.0);
    let along = vec3f(0.0, 0.0, 1.0 - versine);
    let i = lifted(frame * (along + across));
    let o = lifted(frame * (along - across));
    let h = half_vector(i, o);
    return Pair(i, o, h, 0.5 * (dot(i, h) + dot(o, h)));
}

@compute @workgroup_size(THREADS)
fn add(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let node = flat_index(id, groups);
    let row = node / nodes.pairs.w;
    let step = node % nodes.pairs.w;
    if row >= row_count() {
        return;
    }
    let h_index = row / nodes.pairs.z;
    let azimuth = h_index % nodes.pairs.y;
    if angles[azimuth].image != azimuth {
        return;
    }
    let turn = angles[nodes.pairs.y + row % nodes.pairs.z];
    let pair = pair_at(h_index / nodes.pairs.y, angles[azimuth], turn, step);
    let total = vec3f(sum_of_pair(pair, sight_along(pair.i), sight_along(pair.o)));
    let at = row * row_size() + (step + 1u) * nodes.width;
    for (var c = 0u; c < nodes.column_count; c++) {
        values[at + nodes.columns[c]] += total[c];
    }
}
