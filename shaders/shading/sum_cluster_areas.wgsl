// Visible projected area along a direction (Wu et al. 2011, Eq. 10), summed over some of the normal clusters.

//!import cluster_sums
//!import bounds_unblocked

fn visible_area(o: vec3f) -> f32 {
    let to_viewer = visibility_taps(o);
    var total = 0.0;
    for (var k = sum.first; k < sum.end; k++) {
        let cluster = cluster_at(k);
        let cosine = dot(cluster.normal, o);
        let visible = cluster_visibility(k, to_viewer);
        if cosine <= 0.0 || visible == NONE_VISIBLE {
            continue;
        }
        if visible == ALL_VISIBLE {
            total += cosine * cluster.area;
            continue;
        }
        total += cosine * visible_weight(cluster.first, cluster.end, to_viewer);
    }
    return total;
}
