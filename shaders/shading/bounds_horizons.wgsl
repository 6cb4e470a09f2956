// Outside of the horizon bounds of a cluster, no facet needs to be tested.

//!import clusters
//!import azimuth_taps

// Two places may round the same visibility differently.
const ROUNDING: f32 = 1e-3;

fn cluster_visibility(cluster: u32, taps: VisibilityTaps) -> u32 {
    let slopes = bitcast<vec4f>(clusters[first_row(cluster) + HEAD + taps.lower]);
    if between(taps, slopes.xy) <= -ROUNDING {
        return NONE_VISIBLE;
    }
    return select(SOME_VISIBLE, ALL_VISIBLE, between(taps, slopes.zw) >= 1.0 + ROUNDING);
}
