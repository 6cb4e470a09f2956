// The nodes of a table over half and difference coordinates, and what of it a dispatch makes.

struct Nodes {
    // Rings and azimuths of h, steps of φ_d and of θ_d.
    pairs: vec4u,
    // Where a sum goes: into one column, or into one for each channel; and where that of a second lobe goes.
    columns: vec3u,
    column_count: u32,
    seconds: vec3u,
    // Numbers a node: the columns, and black ones up to a multiple of four.
    width: u32,
    // Shapes and scales of two lobes, where facets are picked.
    shapes: vec2f,
    scales: vec2f,
    // About how many facets are picked for each half vector, and room for them.
    picked: f32,
    room: u32,
    // See upper_pairs.rs.
    crowding: f32,
    lowest: f32,
}

struct Angle {
    cosine: f32,
    sine: f32,
    // The azimuth of h whose mirror image this one is, and whether φ_d runs backwards there.
    image: u32,
    is_turned: u32,
}

@group(0) @binding(0) var<uniform> nodes: Nodes;
// The azimuths of h, and the steps of φ_d after them.
@group(0) @binding(1) var<storage, read> angles: array<Angle>;

// Runs along θ_d.
fn row_count() -> u32 {
    return nodes.pairs.x * nodes.pairs.y * nodes.pairs.z;
}
