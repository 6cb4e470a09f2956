// Few distinct normals: the visible area of each, and one lobe for all of it.

//!import lobe_lambertian
//!import visibility_unblocked
//!import weights_area

struct Patch {
    normal: vec3f,
    first: u32,
    end: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

@group(1) @binding(3) var<storage, read> patches: array<Patch>;

fn sum_of_pair(pair: Pair, to_light: Sight, to_viewer: Sight) -> Weight {
    var total = Weight();
    for (var k = sum.first; k < sum.end; k++) {
        let seen = see(patches[k].normal, pair);
        if !is_lit(seen) {
            continue;
        }
        var area = Weight();
        for (var start = patches[k].first; start < patches[k].end; start += BLOCK) {
            var part = Weight();
            let end = min(start + BLOCK, patches[k].end);
            for (var s = start; s < end; s++) {
                part += weight(s) * (visibility(s, to_light) * visibility(s, to_viewer));
            }
            area += part;
        }
        total += area * lobe(seen, pair);
    }
    return total;
}
