// The weights of a table's columns: tints.

//!import tint_row

// One tint per column, padded with black to a multiple of four.
@group(1) @binding(1) var<storage, read> columns: array<Tint>;

fn column_weight(column: u32, i: vec3f, o: vec3f, i_dot_h: f32) -> vec3f {
    return tint_at(columns[column], i_dot_h);
}
