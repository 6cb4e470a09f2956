// What the nodes of a table tell of the rest of it: images of rows in mirror planes, and the step of θ_d before the first
// and after the last. A thread a row and column; it reads rows that are no images, which none of the others writes inside.

//!import table_values
//!import flat_index

@compute @workgroup_size(THREADS)
fn extend(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    let row = k / nodes.width;
    if row >= row_count() {
        return;
    }
    let turns = nodes.pairs.z;
    let h_index = row / turns;
    let azimuth = h_index % nodes.pairs.y;
    let angle = angles[azimuth];
    let turn = select(row % turns, (turns - row % turns) % turns, angle.is_turned == 1u);
    let original = (h_index - azimuth + angle.image) * turns + turn;
    let own = row * row_size() + k % nodes.width;
    let other = original * row_size() + k % nodes.width;
    let last = nodes.pairs.w * nodes.width;
    if original != row {
        for (var at = nodes.width; at <= last; at += nodes.width) {
            values[own + at] = values[other + at];
        }
    }
    // The mirror image of the second, and a straight line.
    values[own] = values[other + 2u * nodes.width];
    values[own + last + nodes.width] = 2.0 * values[other + last] - values[other + last - nodes.width];
}
