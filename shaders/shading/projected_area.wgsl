// Computes 1 / a_v(o) of every point (Wu et al. 2011, Eq. 10) from all facets.

//!import shading_points
//!import scales
//!import sum_areas

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
    var total = visible_area(o);
    // Adds the result of earlier passes.
    if (sum.area_pass & 1u) == 0u {
        total += scales[point];
    }
    if (sum.area_pass & 2u) == 0u {
        scales[point] = total;
    } else {
        scales[point] = select(0.0, 1.0 / total, total > params.min_area);
    }
}
