// Fills the rest of a table from its computed nodes: mirror images of rows, and the steps of θ_d before the first and
// after the last. One thread serves one row and column. It reads rows that are not images, whose inner steps no thread
// writes.

//!import table_values
//!import flat_index

@compute @workgroup_size(THREADS)
fn extend(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    let row = k / nodes.width;
    if row >= row_count() {
        return;
    }
    let phi_d_count = nodes.pairs.z;
    let h_index = row / phi_d_count;
    let azimuth = h_index % nodes.pairs.y;
    let angle = grid_angles[azimuth];
    let phi_d = select(row % phi_d_count, (phi_d_count - row % phi_d_count) % phi_d_count, angle.is_reversed == 1u);
    let original = (h_index - azimuth + angle.image) * phi_d_count + phi_d;
    let to = row * row_size() + k % nodes.width;
    let from_row = original * row_size() + k % nodes.width;
    let last = nodes.pairs.w * nodes.width;
    if original != row {
        for (var at = nodes.width; at <= last; at += nodes.width) {
            values[to + at] = values[from_row + at];
        }
    }
    // Before the first step, the mirror image of the second; after the last, linear extrapolation.
    values[to] = values[from_row + 2u * nodes.width];
    values[to + last + nodes.width] = 2.0 * values[from_row + last] - values[from_row + last - nodes.width];
}
