// A flat tile: every facet sees everything.

struct Sight {
    nothing: u32,
}

fn sight_along(d: vec3f) -> Sight {
    return Sight(0u);
}

fn visibility(facet: u32, sight: Sight) -> f32 {
    return 1.0;
}
