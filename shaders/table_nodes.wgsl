// A table over half and difference coordinates while it is made: what shade_table.wgsl reads, number by number.

struct Nodes {
    // Rings and azimuths of h, steps of φ_d and of θ_d.
    pairs: vec4u,
    // Where a sum goes: into one column, or into one for each channel.
    columns: vec3u,
    column_count: u32,
    // Numbers a node: the columns, and black ones up to a multiple of four.
    width: u32,
    // See upper_pairs.rs.
    crowding: f32,
    lowest: f32,
    pad: u32,
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
// [θ_h][φ_h][φ_d][θ_d][column], one step of θ_d more at either end.
@group(0) @binding(2) var<storage, read_write> values: array<f32>;

// Runs along θ_d.
fn row_count() -> u32 {
    return nodes.pairs.x * nodes.pairs.y * nodes.pairs.z;
}

// Numbers from one run to the next.
fn row_size() -> u32 {
    return (nodes.pairs.w + 2u) * nodes.width;
}
