// A direction between two azimuths of a facet's horizons.

//!import angles
//!import facets

struct Sight {
    lower: u32,
    upper: u32,
    blend: f32,
    elevation: f32,
}

fn sight_along(d: vec3f) -> Sight {
    let at = turn_of(d.xy) * f32(sum.azimuths);
    let lower = u32(at) % sum.azimuths;
    return Sight(lower, (lower + 1u) % sum.azimuths, at - floor(at), angle_of(d.z, length(d.xy)));
}
