// Facets of one colour: one sum for all channels.

//!import facets

alias Weight = f32;

fn weight(facet: u32) -> Weight {
    return facets[facet].w;
}

// From a vector for three channels.
fn whole_weight(v: vec3f) -> Weight {
    return v.x;
}
