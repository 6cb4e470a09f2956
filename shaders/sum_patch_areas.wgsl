// The projected area that is seen from a direction (Wu et al. 2011, Eq. 10), from some of the runs of facets with one normal.

//!import patch_sums
//!import reach_unblocked

fn visible_area(o: vec3f) -> f32 {
    let to_viewer = sight_along(o);
    var total = 0.0;
    for (var p = sum.first; p < sum.end; p++) {
        let run = patch_at(p);
        let cosine = dot(run.normal, o);
        let seen = reach(p, to_viewer);
        if cosine <= 0.0 || seen == NOTHING {
            continue;
        }
        if seen == EVERYTHING {
            total += cosine * run.area;
            continue;
        }
        total += cosine * seen_along(run.first, run.end, to_viewer);
    }
    return total;
}
