// Facets of different colours: areas times colours, and a sum for each channel.

//!import facets

alias Weight = vec3f;

fn weight(facet: u32) -> Weight {
    return facets[sum.facet_count + facet].xyz;
}

fn whole_weight(v: vec3f) -> Weight {
    return v;
}
