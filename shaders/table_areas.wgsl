// Adds what some facets show of themselves to a_v(o) / cos θ_o at the nodes of a polar grid, which a table reads.

//!import flat_index
//!import sum_areas

@group(0) @binding(1) var<storage, read> directions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> areas: array<f32>;

@compute @workgroup_size(THREADS)
fn add(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    if k < arrayLength(&directions) {
        let o = directions[k].xyz;
        areas[k] += visible_area(o) / o.z;
    }
}
