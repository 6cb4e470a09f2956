// The directions at the nodes of a table.

//!import table_nodes
//!import vectors
//!import lobe_angles

fn lifted(d: vec3f) -> vec3f {
    return unit_or(vec3f(d.xy, max(d.z, nodes.lowest)), vec3f(0.0, 0.0, 1.0));
}

// The twin of HemispherePairGrid::pair (src/math/directions/hemisphere_pair_grid.rs).
fn pair_at(ring: u32, phi_h: Angle, phi_d: Angle, step: u32) -> Pair {
    let s = f32(ring) / f32(nodes.pairs.x - 1u);
    let m = max(1.0 - s * s, nodes.lowest);
    let sin_theta_h = sqrt(max(1.0 - m * m, 0.0));
    let frame = mat3x3f(
        vec3f(m * phi_h.cosine, m * phi_h.sine, -sin_theta_h),
        vec3f(-phi_h.sine, phi_h.cosine, 0.0),
        vec3f(sin_theta_h * phi_h.cosine, sin_theta_h * phi_h.sine, m),
    );
    let x = f32(step) / f32(nodes.pairs.w - 1u);
    let u = x * (1.0 + nodes.crowding - nodes.crowding * x);
    let n = sin_theta_h * abs(phi_d.cosine);
    let r = length(vec2f(n, m));
    let versine = min(u * u * m * m / (r * (r + n)), 1.0 - nodes.lowest);
    let sin_theta_d = sqrt(versine * (2.0 - versine));
    let across = vec3f(sin_theta_d * phi_d.cosine, sin_theta_d * phi_d.sine, 0.0);
    let along = vec3f(0.0, 0.0, 1.0 - versine);
    let i = lifted(frame * (along + across));
    let o = lifted(frame * (along - across));
    let h = half_vector(i, o);
    return Pair(i, o, h, 0.5 * (dot(i, h) + dot(o, h)));
}

// The node of a thread.
struct Task {
    row: u32,
    step: u32,
    half_vector: u32,
    // True if there is nothing to do: beyond the last node, and at mirror images.
    is_none: bool,
}

fn task_of(node: u32) -> Task {
    let row = node / nodes.pairs.w;
    let half_vector = row / nodes.pairs.z;
    let azimuth = half_vector % nodes.pairs.y;
    return Task(row, node % nodes.pairs.w, half_vector, row >= row_count() || grid_angles[azimuth].image != azimuth);
}

fn pair_of(task: Task) -> Pair {
    let azimuth = grid_angles[task.half_vector % nodes.pairs.y];
    let phi_d = grid_angles[nodes.pairs.y + task.row % nodes.pairs.z];
    return pair_at(task.half_vector / nodes.pairs.y, azimuth, phi_d, task.step);
}
