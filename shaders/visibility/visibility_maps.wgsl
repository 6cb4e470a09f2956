// Binary visibility on a polar grid, interpolated between its nodes: the twin of SoftMaps::fill
// (src/visibility/soft_maps.rs).

//!import polar_grid
//!import facets

// Each word holds the bits of 32 facets at one node; the nodes of the grid are adjacent.
@group(1) @binding(2) var<storage, read> bits: array<u32>;

alias VisibilityTaps = Taps;

fn visibility_taps(d: vec3f) -> VisibilityTaps {
    return grid_taps(d, sum.rings, sum.azimuths);
}

fn visibility(facet: u32, taps: VisibilityTaps) -> f32 {
    let row = facet / 32u * sum.nodes;
    let words = vec4u(
        bits[row + taps.nodes.x],
        bits[row + taps.nodes.y],
        bits[row + taps.nodes.z],
        bits[row + taps.nodes.w],
    );
    return dot(taps.weights, vec4f((words >> vec4u(facet % 32u)) & vec4u(1u)));
}
