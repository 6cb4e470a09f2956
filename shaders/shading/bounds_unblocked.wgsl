// On a flat tile, all facets of a cluster are visible.

//!import clusters
//!import visibility_unblocked

fn cluster_visibility(cluster: u32, taps: VisibilityTaps) -> u32 {
    return ALL_VISIBLE;
}
