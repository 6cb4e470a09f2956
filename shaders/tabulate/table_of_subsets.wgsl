// Adds sums over the subset of facets of each half vector (sample_facets.wgsl) to columns of a table, for up to two
// lobes at once. table_of_sum.wgsl does this over all facets.

//!import table_values
//!import table_pairs
//!import facet_subsets
//!import two_lobes
//!import flat_index
//!import visibility_unblocked
//!import weights_area

@group(1) @binding(3) var<storage, read> subsets: array<SampledFacet>;

@compute @workgroup_size(THREADS)
fn add(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let task = task_of(flat_index(id, groups));
    if task.is_none {
        return;
    }
    let pair = pair_of(task);
    let to_light = visibility_taps(pair.i);
    let to_viewer = visibility_taps(pair.o);
    let first = task.half_vector * nodes.row_length + 1u;
    let end = min(sum.end, subsets[first - 1u].facet);
    var first_sum = vec3f(0.0);
    var second_sum = vec3f(0.0);
    for (var k = sum.first; k < end; k++) {
        let sampled = subsets[first + k];
        let angles = lobe_angles(facets[sampled.facet].xyz, pair);
        if !is_lit(angles) {
            continue;
        }
        let viewer_visibility = visibility(sampled.facet, to_viewer);
        if viewer_visibility > 0.0 {
            let area = weight(sampled.facet)
                * (sampled.weight * viewer_visibility * visibility(sampled.facet, to_light));
            let lobes = two_lobes(angles, pair.i_dot_h);
            first_sum += vec3f(area * lobes.x);
            second_sum += vec3f(area * lobes.y);
        }
    }
    let at = task.row * row_size() + (task.step + 1u) * nodes.width;
    for (var c = 0u; c < nodes.column_count; c++) {
        values[at + nodes.columns[c]] += first_sum[c];
        if SECOND != 0u {
            values[at + nodes.second_columns[c]] += second_sum[c];
        }
    }
}
