// Deferred shading with a sum over normal clusters: the area of each that is visible to both light and viewer, times
// one lobe. The twin of ClusteredSum::sums (src/effective/direct/clustered_sum.rs).

//!import shading_points
//!import scales
//!import shadows_none
//!import visibility_unblocked
//!import weights_area
//!import lobe_by_number
//!import cluster_sums
//!import bounds_unblocked

fn mutually_visible_weight(first: u32, end_facet: u32, to_light: VisibilityTaps, to_viewer: VisibilityTaps) -> Weight {
    var total = Weight();
    for (var start = first; start < end_facet; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, end_facet);
        for (var s = start; s < end; s++) {
            part += weight(s) * (visibility(s, to_light) * visibility(s, to_viewer));
        }
        total += part;
    }
    return total;
}

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if is_empty(point) || scales[point] == 0.0 {
        return;
    }
    let frame = frame_of(point);
    let o = view_of(point, frame);
    let to_viewer = visibility_taps(o);
    var total = vec3f(0.0);
    for (var c = sum.first; c < sum.end; c++) {
        let cluster = cluster_at(c);
        let view_visibility = cluster_visibility(c, to_viewer);
        if dot(cluster.normal, o) <= 0.0 || view_visibility == NONE_VISIBLE {
            continue;
        }
        // The area that is visible to the viewer; computed when the first light needs it.
        var viewer_area = weight_from_rgb(cluster.total_weight);
        var is_known = view_visibility == ALL_VISIBLE;
        for (var k = id.y * params.slice; k < light_end(id.y); k++) {
            let i = in_tangent(frame, lights[k].direction);
            if i.z <= 0.0 || dot(cluster.normal, i) <= 0.0 || !is_light_visible(point, k) {
                continue;
            }
            let to_light = visibility_taps(i);
            let light_visibility = cluster_visibility(c, to_light);
            if light_visibility == NONE_VISIBLE {
                continue;
            }
            var area: Weight;
            if light_visibility == ALL_VISIBLE {
                if !is_known {
                    viewer_area = visible_weight(cluster.first, cluster.end, to_viewer);
                    is_known = true;
                }
                area = viewer_area;
            } else if view_visibility == ALL_VISIBLE {
                area = visible_weight(cluster.first, cluster.end, to_light);
            } else {
                area = mutually_visible_weight(cluster.first, cluster.end, to_light, to_viewer);
            }
            let h = half_vector(i, o);
            let pair = Pair(i, o, h, 0.5 * (dot(i, h) + dot(o, h)));
            let angles = lobe_angles(cluster.normal, pair);
            var lobes = vec3f(0.0);
            for (var row = cluster.terms; row < cluster.terms_end; row += TERM) {
                let term = term_at(row);
                let value = lobe_by_number(term.lobe, angles, pair.i_dot_h, term.shape, term.scale);
                lobes += tint_at(term.tint, pair.i_dot_h) * value;
            }
            total += lights[k].irradiance * lobes * area;
        }
    }
    add_radiance(point, id.y, total * scales[point]);
}
