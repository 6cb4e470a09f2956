// The lobe of a sum over facets: Blinn-Phong.

//!import facets
//!import blinn_phong
//!import tint_fixed

fn lobe(n: Seen, pair: Pair) -> f32 {
    return blinn_phong(n, sum.shape, sum.scale);
}
