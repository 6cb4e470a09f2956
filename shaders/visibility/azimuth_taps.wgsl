// The two azimuths of a facet's horizons around a direction, and the direction's elevation [rad].

//!import angles
//!import facets

struct VisibilityTaps {
    lower: u32,
    upper: u32,
    blend: f32,
    elevation: f32,
}

fn visibility_taps(d: vec3f) -> VisibilityTaps {
    let at = azimuth_in_turns(d.xy) * f32(sum.azimuths);
    let lower = u32(at) % sum.azimuths;
    return VisibilityTaps(lower, (lower + 1u) % sum.azimuths, at - floor(at), angle_of(d.z, length(d.xy)));
}
