// Yes/no visibility on a polar grid, blended between its nodes: the twin of SoftMaps::fill (src/visibility/soft_maps.rs).

//!import polar_grid
//!import facets

// Bits of 32 facets, the nodes of the grid side by side.
@group(1) @binding(2) var<storage, read> bits: array<u32>;

alias Sight = Taps;

fn sight_along(d: vec3f) -> Sight {
    return grid_taps(d, sum.rings, sum.azimuths);
}

fn visibility(facet: u32, sight: Sight) -> f32 {
    let row = facet / 32u * sum.nodes;
    let words = vec4u(bits[row + sight.nodes.x], bits[row + sight.nodes.y], bits[row + sight.nodes.z], bits[row + sight.nodes.w]);
    return dot(sight.weights, vec4f((words >> vec4u(facet % 32u)) & vec4u(1u)));
}
