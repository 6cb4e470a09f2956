// The lobe of a sum over facets: Ward.

//!import facets
//!import ward
//!import tint_fixed

fn lobe(angles: LobeAngles, pair: Pair) -> f32 {
    return ward(angles, sum.shape, sum.scale);
}
