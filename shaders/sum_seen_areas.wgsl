// The area of facets that two directions see: what a table holds of facets of one normal. Whether that faces the directions,
// its lobe tells.

//!import lobe_input
//!import visibility_unblocked
//!import weights_area

fn sum_of_pair(pair: Pair, to_light: Sight, to_viewer: Sight) -> Weight {
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
