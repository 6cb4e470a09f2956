// The lobe of a sum over facets: GGX.

//!import facets
//!import ggx
//!import tint_fresnel

fn lobe(angles: LobeAngles, pair: Pair) -> f32 {
    return ggx(angles, sum.shape, sum.scale);
}
