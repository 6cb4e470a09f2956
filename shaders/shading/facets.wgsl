// The facets of a tile, and the part that one pass sums: one term of one group (src/effective/direct/facet_sum.rs).

struct Sum {
    // The range of facets, or of clusters (clusters.wgsl).
    first: u32,
    end: u32,
    // Azimuths of horizons or of the grid of maps; rings and nodes of that grid.
    azimuths: u32,
    rings: u32,
    nodes: u32,
    // 1 / transition width at a horizon [1/rad].
    sharpness: f32,
    // The two constants of the lobe (src/math/simd/lobes.rs).
    shape: f32,
    scale: f32,
    // Tint of the term at i·h = 1, and the colour of the material.
    tint: vec3f,
    // The number of all facets.
    facet_count: u32,
    color: vec3f,
    // Flags of a pass over projected areas: 1 for the first pass, 2 for the last, 3 for both.
    area_pass: u32,
    // The direction across grooves, to which the horizons belong; 0 for a surface without.
    across: vec2f,
}

@group(1) @binding(0) var<uniform> sum: Sum;
// Normal and area of each facet. If colours differ, area times colour of each facet follow.
@group(1) @binding(1) var<storage, read> facets: array<vec4f>;

// Facets per partial sum; partial sums bound the rounding error of single precision.
const BLOCK: u32 = 64u;
