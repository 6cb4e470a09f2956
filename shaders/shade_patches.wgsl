// Deferred shading with a live sum over facets of few normals: of each the area that light and view both see, and one lobe for
// all of it. The twin of FewNormals::sums (src/filtering/few_normals.rs).

//!import shading_points
//!import scales
//!import shadows_none
//!import visibility_unblocked
//!import weights_area
//!import lobe_by_number
//!import patch_sums
//!import reach_unblocked

fn seen_along_both(first: u32, past: u32, to_light: Sight, to_viewer: Sight) -> Weight {
    var total = Weight();
    for (var start = first; start < past; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, past);
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
    let to_viewer = sight_along(o);
    var total = vec3f(0.0);
    for (var p = sum.first; p < sum.end; p++) {
        let run = patch_at(p);
        let view_reach = reach(p, to_viewer);
        if dot(run.normal, o) <= 0.0 || view_reach == NOTHING {
            continue;
        }
        // What the view sees, once a light asks for it.
        var seen_by_viewer = whole_weight(run.whole);
        var is_known = view_reach == EVERYTHING;
        for (var k = id.y * params.slice; k < end_of(id.y); k++) {
            let i = in_tangent(frame, lights[k].direction);
            if i.z <= 0.0 || dot(run.normal, i) <= 0.0 || !sees_light(point, k) {
                continue;
            }
            let to_light = sight_along(i);
            let light_reach = reach(p, to_light);
            if light_reach == NOTHING {
                continue;
            }
            var area: Weight;
            if light_reach == EVERYTHING {
                if !is_known {
                    seen_by_viewer = seen_along(run.first, run.end, to_viewer);
                    is_known = true;
                }
                area = seen_by_viewer;
            } else if view_reach == EVERYTHING {
                area = seen_along(run.first, run.end, to_light);
            } else {
                area = seen_along_both(run.first, run.end, to_light, to_viewer);
            }
            let h = half_vector(i, o);
            let pair = Pair(i, o, h, 0.5 * (dot(i, h) + dot(o, h)));
            let seen = see(run.normal, pair);
            var lobes = vec3f(0.0);
            for (var row = run.terms; row < run.terms_end; row += TERM) {
                let term = term_at(row);
                let value = lobe_by_number(term.lobe, seen, pair.i_dot_h, term.shape, term.scale);
                lobes += tint_at(term.tint, pair.i_dot_h) * value;
            }
            total += lights[k].irradiance * lobes * area;
        }
    }
    add_radiance(point, id.y, total * scales[point]);
}
