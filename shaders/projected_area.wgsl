// 1 / a_v(o) of every point (Wu et al. 2011, Eq. 10), from all facets.

//!import shading_points
//!import scales
//!import facets
//!import visibility_unblocked

@compute @workgroup_size(64)
fn measure(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if is_empty(point) {
        return;
    }
    let o = view_of(point, frame_of(point));
    if o.z <= 0.0 {
        scales[point] = 0.0;
        return;
    }
    let to_viewer = sight_along(o);
    // What the passes before found.
    var total = 0.0;
    if sum.first > 0u {
        total = scales[point];
    }
    for (var start = sum.first; start < sum.end; start += BLOCK) {
        var part = 0.0;
        let end = min(start + BLOCK, sum.end);
        for (var s = start; s < end; s++) {
            let cosine = dot(facets[s].xyz, o);
            if cosine > 0.0 {
                part += facets[s].w * visibility(s, to_viewer) * cosine;
            }
        }
        total += part;
    }
    if sum.last == 0u {
        scales[point] = total;
    } else {
        scales[point] = select(0.0, 1.0 / total, total > params.least_area);
    }
}
