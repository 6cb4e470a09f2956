// Outside of the horizon bounds of a cluster, no facet needs to be tested.

//!import clusters
//!import azimuth_taps

fn cluster_visibility(cluster: u32, taps: VisibilityTaps) -> u32 {
    let row = clusters[first_row(cluster) + HEAD + taps.lower];
    if taps.elevation <= bitcast<f32>(row.x) {
        return NONE_VISIBLE;
    }
    return select(SOME_VISIBLE, ALL_VISIBLE, taps.elevation >= bitcast<f32>(row.y));
}
