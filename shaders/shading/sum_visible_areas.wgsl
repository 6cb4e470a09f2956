// The area of facets that is visible along two directions: what a table stores for a normal cluster. Facing is left to
// the lobe, which is evaluated at the query.

//!import lobe_angles
//!import visibility_unblocked
//!import weights_area

fn sum_of_pair(pair: Pair, to_light: VisibilityTaps, to_viewer: VisibilityTaps) -> Weight {
    var total = Weight();
    for (var start = sum.first; start < sum.end; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, sum.end);
        for (var s = start; s < end; s++) {
            part += weight(s) * (visibility(s, to_light) * visibility(s, to_viewer));
        }
        total += part;
    }
    return total;
}
