// Facets of one colour: one sum for all channels.

//!import facets

alias Weight = f32;

fn weight(facet: u32) -> Weight {
    return facets[facet].w;
}
