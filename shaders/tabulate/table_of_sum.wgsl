// Adds a sum over some facets to its columns of a table, at every node that is not the mirror image of another: the
// twin of ShadingTable::build (src/effective/shading_table/). One thread serves one node; neighbours read the same
// facets together.

//!import table_values
//!import table_pairs
//!import flat_index
//!import visibility_unblocked
//!import weights_area
//!import sum_facets

@compute @workgroup_size(THREADS)
fn add(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let task = task_of(flat_index(id, groups));
    if task.is_none {
        return;
    }
    let pair = pair_of(task);
    let total = vec3f(sum_of_pair(pair, visibility_taps(pair.i), visibility_taps(pair.o)));
    let at = task.row * row_size() + (task.step + 1u) * nodes.width;
    for (var c = 0u; c < nodes.column_count; c++) {
        values[at + nodes.columns[c]] += total[c];
    }
}
