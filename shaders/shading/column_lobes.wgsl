// The weights of a table's columns if some are areas of normal clusters: all lobes of the cluster, exact at the query.
// The other columns have a tint. The twin of Weight::at (src/effective/shading_table/columns.rs).

//!import tint_row
//!import lobe_by_number

struct Term {
    tint: Tint,
    normal: vec3f,
    // 0 for a tint without a lobe; else the number of lobe_by_number.wgsl, with shape and scale.
    lobe: u32,
    shape: f32,
    scale: f32,
    // Index of the next term of the column; 0 after the last.
    next: u32,
    pad: u32,
}

// The first term of each column, padded with black to a multiple of four; then the other terms.
@group(1) @binding(1) var<storage, read> terms: array<Term>;

fn lobe_of(term: Term, pair: Pair) -> f32 {
    if term.lobe == 0u {
        return 1.0;
    }
    let angles = lobe_angles(term.normal, pair);
    if !is_lit(angles) {
        return 0.0;
    }
    return lobe_by_number(term.lobe, angles, pair.i_dot_h, term.shape, term.scale);
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
