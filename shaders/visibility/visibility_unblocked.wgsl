// A flat tile: every direction is visible from every facet.

struct VisibilityTaps {
    unused: u32,
}

fn visibility_taps(d: vec3f) -> VisibilityTaps {
    return VisibilityTaps(0u);
}

fn visibility(facet: u32, taps: VisibilityTaps) -> f32 {
    return 1.0;
}
