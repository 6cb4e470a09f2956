// The facets of a tile, and what one pass sums: one term of one group (src/filtering/facet_sum.rs).

struct Sum {
    // Facets or patches (patches.wgsl).
    first: u32,
    end: u32,
    // Azimuths of horizons or of the map grid; rings and nodes of the grid.
    azimuths: u32,
    rings: u32,
    nodes: u32,
    // 1 / the width of the soft step at a horizon.
    sharpness: f32,
    // The two constants of the lobe (src/simd/lobes.rs).
    shape: f32,
    scale: f32,
    // Tint of the term at i·h = 1, and the colour of the material.
    tint: vec3f,
    // Facets in all.
    facet_count: u32,
    color: vec3f,
    // Of several passes over projected areas: 1 the first, 2 the last, 3 both.
    place: u32,
}

@group(1) @binding(0) var<uniform> sum: Sum;
// Normal and area of each; where colours differ, their areas times colours follow.
@group(1) @binding(1) var<storage, read> facets: array<vec4f>;

// Facets that are summed before the sum is carried over: bounds the rounding error of single precision.
const BLOCK: u32 = 64u;
