// The lobe of a sum over facets: Cook-Torrance.

//!import facets
//!import cook_torrance
//!import tint_fresnel

fn lobe(angles: LobeAngles, pair: Pair) -> f32 {
    return cook_torrance(angles, pair.i_dot_h, sum.shape, sum.scale);
}
