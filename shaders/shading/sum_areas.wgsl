// Visible projected area along a direction (Wu et al. 2011, Eq. 10), summed over some of the facets.

//!import facets
//!import visibility_unblocked

fn visible_area(o: vec3f) -> f32 {
    let to_viewer = visibility_taps(o);
    var total = 0.0;
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
    return total;
}
