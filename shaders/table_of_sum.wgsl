// Adds a sum over some facets to its columns of a table, at every node that is no image of another: the twin of
// PairTable::build (src/filtering/pair_table). A thread a node; its neighbours read the same facets at the same time.

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
    let total = vec3f(sum_of_pair(pair, sight_along(pair.i), sight_along(pair.o)));
    let at = task.row * row_size() + (task.step + 1u) * nodes.width;
    for (var c = 0u; c < nodes.column_count; c++) {
        values[at + nodes.columns[c]] += total[c];
    }
}
