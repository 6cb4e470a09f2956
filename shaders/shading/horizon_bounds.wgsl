// Computes the horizon bounds of each cluster along an azimuth and the next: the lowest and the highest slope. The twin
// of the CPU function in src/visibility/horizon_map.rs. One thread computes one row.

//!import visibility_horizons
//!import flat_index

// The clusters, as clusters.wgsl reads them.
@group(0) @binding(2) var<storage, read_write> rows: array<vec4u>;

const HEAD: u32 = 3u;

@compute @workgroup_size(THREADS)
fn find(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    let cluster = k / sum.azimuths;
    if cluster >= sum.end {
        return;
    }
    let azimuth = k % sum.azimuths;
    let next = (azimuth + 1u) % sum.azimuths;
    let head = cluster * (HEAD + sum.azimuths);
    var low = vec2f(1e30);
    var high = vec2f(-1e30);
    for (var s = rows[head].w; s < rows[head + 1u].x; s++) {
        let slopes = vec2f(horizons[s * sum.azimuths + azimuth], horizons[s * sum.azimuths + next]);
        low = min(low, slopes);
        high = max(high, slopes);
    }
    rows[head + HEAD + azimuth] = bitcast<vec4u>(vec4f(low, high));
}
