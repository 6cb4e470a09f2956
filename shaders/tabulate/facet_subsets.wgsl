// The subset of facets of each half vector, in rows of nodes.row_length: first the number of facets, then the facets in
// order.

struct SampledFacet {
    facet: u32,
    // Inverse of its probability; 0 in the first entry of a row.
    weight: f32,
}
