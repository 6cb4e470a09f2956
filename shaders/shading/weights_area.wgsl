// Weights of facets of one colour: one sum serves all channels.

//!import facets

alias Weight = f32;

fn weight(facet: u32) -> Weight {
    return facets[facet].w;
}

// The weight of a vector with three equal channels.
fn weight_from_rgb(v: vec3f) -> Weight {
    return v.x;
}
