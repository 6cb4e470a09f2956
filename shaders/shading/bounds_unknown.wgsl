// With overhangs or maps there are no bounds: each facet is tested.

//!import clusters
//!import visibility_unblocked

fn cluster_visibility(cluster: u32, taps: VisibilityTaps) -> u32 {
    return SOME_VISIBLE;
}
