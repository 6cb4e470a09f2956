// The lobe of a sum over facets: Lambertian.

//!import lambertian
//!import tint_fixed

fn lobe(angles: LobeAngles, pair: Pair) -> f32 {
    return lambertian(angles);
}
