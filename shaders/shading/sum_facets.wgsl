// A sum with one lobe per facet.

//!import lobe_lambertian
//!import visibility_unblocked
//!import weights_area

fn sum_of_pair(pair: Pair, to_light: VisibilityTaps, to_viewer: VisibilityTaps) -> Weight {
    var total = Weight();
    for (var start = sum.first; start < sum.end; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, sum.end);
        for (var s = start; s < end; s++) {
            let angles = lobe_angles(facets[s].xyz, pair);
            if is_lit(angles) {
                part += weight(s) * (lobe(angles, pair) * visibility(s, to_light) * visibility(s, to_viewer));
            }
        }
        total += part;
    }
    return total;
}
