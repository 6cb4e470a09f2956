// A table over half and difference coordinates while it is made: what shade_table.wgsl reads, number by number.

//!import table_nodes

// [θ_h][φ_h][φ_d][θ_d][column], one step of θ_d more at either end.
@group(0) @binding(2) var<storage, read_write> values: array<f32>;

// Numbers from one run to the next.
fn row_size() -> u32 {
    return (nodes.pairs.w + 2u) * nodes.width;
}
