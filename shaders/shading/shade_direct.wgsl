// Deferred shading with a sum over facets: the twin of Direct::sums (src/effective/direct/) for one term of one group
// of facets. Rust swaps the imports below for those that the scene needs, so that unused effects leave no code.

//!import shading_points
//!import scales
//!import shadows_none
//!import visibility_unblocked
//!import weights_area
//!import lobe_lambertian
//!import sum_facets

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
    for (var k = id.y * params.slice; k < light_end(id.y); k++) {
        let i = in_tangent(frame, lights[k].direction);
        if i.z <= 0.0 || !is_light_visible(point, k) {
            continue;
        }
        let h = half_vector(i, o);
        let pair = Pair(i, o, h, 0.5 * (dot(i, h) + dot(o, h)));
        let value = vec3f(sum_of_pair(pair, visibility_taps(i), to_viewer));
        total += lights[k].irradiance * tint(sum.tint, pair.i_dot_h) * value;
    }
    add_radiance(point, id.y, total * sum.color * scales[point]);
}
