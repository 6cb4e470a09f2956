// The lobe of a sum over facets: GGX.

//!import facets
//!import ggx
//!import tint_fresnel

fn lobe(n: Seen, pair: Pair) -> f32 {
    return ggx(n, sum.shape, sum.scale);
}
