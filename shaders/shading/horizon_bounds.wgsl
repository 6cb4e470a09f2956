// Computes the horizon bounds of each cluster between an azimuth and the next: the elevation [rad] up to which no facet
// is unblocked, and the elevation from which all facets are. The twin of the CPU function in
// src/visibility/horizon_map.rs. One thread computes one row.

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
    var low = 1e30;
    var high = -1e30;
    for (var s = rows[head].w; s < rows[head + 1u].x; s++) {
        let here = horizons[s * sum.azimuths + azimuth];
        let there = horizons[s * sum.azimuths + next];
        low = min(low, min(here, there));
        high = max(high, max(here, there));
    }
    // A little more than half the transition width, because blending two azimuths rounds.
    let margin = 0.51 / sum.sharpness + 1e-6;
    rows[head + HEAD + azimuth] = vec4u(bitcast<u32>(low - margin), bitcast<u32>(high + margin), 0u, 0u);
}
