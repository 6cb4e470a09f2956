// The lobe of a sum over facets: Ward's.

//!import facets
//!import ward
//!import tint_fixed

fn lobe(n: Seen, pair: Pair) -> f32 {
    return ward(n, sum.shape, sum.scale);
}
