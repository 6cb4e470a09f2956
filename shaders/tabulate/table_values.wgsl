// The values of a table while the GPU computes it, as single numbers; shade_table.wgsl reads them in groups of four.

//!import table_nodes

// [θ_h][φ_h][φ_d][θ_d][column], with one more step of θ_d at either end.
@group(0) @binding(2) var<storage, read_write> values: array<f32>;

// The number of values per row.
fn row_size() -> u32 {
    return (nodes.pairs.w + 2u) * nodes.width;
}
