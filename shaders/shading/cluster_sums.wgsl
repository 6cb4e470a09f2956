// The weight of the facets of a cluster that is visible along a direction.

//!import visibility_unblocked
//!import weights_area

fn visible_weight(first: u32, end_facet: u32, taps: VisibilityTaps) -> Weight {
    var total = Weight();
    for (var start = first; start < end_facet; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, end_facet);
        for (var s = start; s < end; s++) {
            part += weight(s) * visibility(s, taps);
        }
        total += part;
    }
    return total;
}
