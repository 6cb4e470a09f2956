// The plain sum: a lobe for every facet.

//!import lobe_lambertian
//!import visibility_unblocked
//!import weights_area

fn sum_of_pair(pair: Pair, to_light: Sight, to_viewer: Sight) -> Weight {
    var total = Weight();
    for (var start = sum.first; start < sum.end; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, sum.end);
        for (var s = start; s < end; s++) {
            let seen = see(facets[s].xyz, pair);
            if is_lit(seen) {
                part += weight(s) * (lobe(seen, pair) * visibility(s, to_light) * visibility(s, to_viewer));
            }
        }
        total += part;
    }
    return total;
}
