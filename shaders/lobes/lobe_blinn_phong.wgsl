// The lobe of a sum over facets: Blinn-Phong.

//!import facets
//!import blinn_phong
//!import tint_fixed

fn lobe(angles: LobeAngles, pair: Pair) -> f32 {
    return blinn_phong(angles, sum.shape, sum.scale);
}
