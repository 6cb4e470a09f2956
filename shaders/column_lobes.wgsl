// What multiplies a table's columns where some are areas of facets of one normal: all that those reflect, exact at the query;
// a tint for the others. The twin of Weight::at (src/filtering/pair_table/columns.rs).

//!import tint_row
//!import lobe_by_number

struct Term {
    tint: Tint,
    normal: vec3f,
    // 0: no lobe, the tint is all; else one more than Lobe::numbers says (src/simd/lobes.rs), which tells shape and scale, too.
    lobe: u32,
    shape: f32,
    scale: f32,
    // Where the next term of the column stands; 0 after the last.
    next: u32,
    pad: u32,
}

// The first of each column, four for each of the fours, black where there are fewer; then the others.
@group(1) @binding(1) var<storage, read> terms: array<Term>;

fn lobe_of(term: Term, pair: Pair) -> f32 {
    if term.lobe == 0u {
        return 1.0;
    }
    let seen = see(term.normal, pair);
    if !is_lit(seen) {
        return 0.0;
    }
    return lobe_by_number(term.lobe, seen, pair.i_dot_h, term.shape, term.scale);
}

fn column_weight(column: u32, i: vec3f, o: vec3f, i_dot_h: f32) -> vec3f {
    let pair = Pair(i, o, (i + o) / max(2.0 * i_dot_h, 1e-20), i_dot_h);
    var total = vec3f(0.0);
    var k = column;
    loop {
        let term = terms[k];
        total += tint_at(term.tint, i_dot_h) * lobe_of(term, pair);
        k = term.next;
        if k == 0u {
            break;
        }
    }
    return total;
}
