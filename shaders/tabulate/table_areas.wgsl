// Adds the visible projected area of some facets to a_v(o) / cos θ_o at the nodes of a polar grid, which a table reads.
// One workgroup serves one node, because there are few nodes and many facets.

//!import facets
//!import workgroup_sum
//!import visibility_unblocked

@group(0) @binding(1) var<storage, read> directions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> areas: array<f32>;

@compute @workgroup_size(THREADS)
fn add(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) thread: u32) {
    let o = directions[workgroup.x].xyz;
    let to_viewer = visibility_taps(o);
    var total = 0.0;
    for (var s = sum.first + thread; s < sum.end; s += THREADS) {
        let cosine = dot(facets[s].xyz, o);
        if cosine > 0.0 {
            total += facets[s].w * visibility(s, to_viewer) * cosine;
        }
    }
    let area = workgroup_sum(thread, vec2f(total, 0.0)).x;
    if thread == 0u {
        areas[workgroup.x] += area / o.z;
    }
}
