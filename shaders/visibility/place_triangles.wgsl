// Moves the copies of triangles that overlap the cells of a tile to their positions: the twin of
// PeriodicGrid::copy_corners (src/geometry/grid/periodic_grid.rs). One thread moves one copy.

//!import slice_entry
//!import flat_index

struct Tile {
    size: vec2f,
    copies: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> tile: Tile;
// The triangle, and its shift in tiles as two signed 16-bit halves.
@group(0) @binding(1) var<storage, read> copies: array<vec2u>;
// Three corners per triangle.
@group(0) @binding(2) var<storage, read> corners: array<f32>;
@group(0) @binding(3) var<storage, read_write> entries: array<Entry>;

fn corner(k: u32) -> vec3f {
    return vec3f(corners[3u * k], corners[3u * k + 1u], corners[3u * k + 2u]);
}

@compute @workgroup_size(THREADS)
fn place(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    if k >= tile.copies {
        return;
    }
    let triangle = copies[k].x;
    let halves = bitcast<i32>(copies[k].y);
    let shift = vec2f(vec2i(extractBits(halves, 0u, 16u), extractBits(halves, 16u, 16u))) * tile.size;
    let a = corner(3u * triangle);
    let b = corner(3u * triangle + 1u);
    let c = corner(3u * triangle + 2u);
    let heights = vec3f(a.z, b.z, c.z);
    let z_max = max(max(a.z, b.z), c.z);
    let z_min = min(min(a.z, b.z), c.z);
    entries[k] = Entry(a.xy + shift, b.xy + shift, c.xy + shift, z_max, z_min, heights, triangle);
}
