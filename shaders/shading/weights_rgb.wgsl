// Weights of facets of different colours: area times colour, with one sum per channel.

//!import facets

alias Weight = vec3f;

fn weight(facet: u32) -> Weight {
    return facets[sum.facet_count + facet].xyz;
}

fn weight_from_rgb(v: vec3f) -> Weight {
    return v;
}
