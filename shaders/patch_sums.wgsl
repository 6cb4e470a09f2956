// What a direction sees of a run of facets.

//!import visibility_unblocked
//!import weights_area

fn seen_along(first: u32, past: u32, sight: Sight) -> Weight {
    var total = Weight();
    for (var start = first; start < past; start += BLOCK) {
        var part = Weight();
        let end = min(start + BLOCK, past);
        for (var s = start; s < end; s++) {
            part += weight(s) * visibility(s, sight);
        }
        total += part;
    }
    return total;
}
