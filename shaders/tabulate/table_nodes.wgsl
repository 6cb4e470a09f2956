// The nodes of a shading table, and the columns that a dispatch computes.

struct Nodes {
    // Rings and azimuths of h, steps of φ_d and of θ_d.
    pairs: vec4u,
    // The columns of the first lobe, and `second_columns` of the second: one column, or one per channel.
    columns: vec3u,
    column_count: u32,
    second_columns: vec3u,
    // Values per node: the columns, padded with black ones to a multiple of four.
    width: u32,
    // Shapes and scales of two lobes, if facets are sampled.
    shapes: vec2f,
    scales: vec2f,
    // Expected number of facets of the subset of a half vector, and the length of its row.
    subset_size: f32,
    row_length: u32,
    // HemispherePairGrid::CROWDING and HemispherePairGrid::MIN_SINE.
    crowding: f32,
    lowest: f32,
}

struct Angle {
    cosine: f32,
    sine: f32,
    // The azimuth of h whose mirror image this azimuth is, and whether φ_d is reversed there.
    image: u32,
    is_reversed: u32,
}

@group(0) @binding(0) var<uniform> nodes: Nodes;
// The azimuths of h, then the steps of φ_d.
@group(0) @binding(1) var<storage, read> grid_angles: array<Angle>;

// The number of rows along θ_d.
fn row_count() -> u32 {
    return nodes.pairs.x * nodes.pairs.y * nodes.pairs.z;
}
