// Adds sums over facets that were picked for each half vector (pick_facets.wgsl) to their columns of a table, as
// table_of_sum.wgsl does over all facets; of up to two lobes at once.

//!import table_values
//!import table_pairs
//!import table_picks
//!import two_lobes
//!import flat_index
//!import visibility_unblocked
//!import weights_area

@group(1) @binding(3) var<storage, read> picks: array<Pick>;

@compute @workgroup_size(THREADS)
fn add(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let task = task_of(flat_index(id, groups));
    if task.is_none {
        return;
    }
    let pair = pair_of(task);
    let to_light = sight_along(pair.i);
    let to_viewer = sight_along(pair.o);
    let first = task.half_vector * nodes.room + 1u;
    let end = min(sum.end, picks[first - 1u].facet);
    var one = vec3f(0.0);
    var two = vec3f(0.0);
    for (var k = sum.first; k < end; k++) {
        let pick = picks[first + k];
        let seen = see(facets[pick.facet].xyz, pair);
        if !is_lit(seen) {
            continue;
        }
        let seen_by_viewer = visibility(pick.facet, to_viewer);
        if seen_by_viewer > 0.0 {
            let area = weight(pick.facet) * (pick.weight * seen_by_viewer * visibility(pick.facet, to_light));
            let lobes = two_lobes(seen, pair.i_dot_h);
            one += vec3f(area * lobes.x);
            two += vec3f(area * lobes.y);
        }
    }
    let at = task.row * row_size() + (task.step + 1u) * nodes.width;
    for (var c = 0u; c < nodes.column_count; c++) {
        values[at + nodes.columns[c]] += one[c];
        if SECOND != 0u {
            values[at + nodes.seconds[c]] += two[c];
        }
    }
}
