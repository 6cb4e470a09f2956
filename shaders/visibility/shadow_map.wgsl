// Toroidal shadow maps: the twin of src/visibility/shadow_map.rs, which describes the algorithm.
//
// Three passes run over a batch of directions; y of the dispatch is the direction. `draw_heights` stores the highest
// point of each texel, `draw_triangles` stores its triangle, and `test_facets` tests 32 facets per thread against both.

//!import shadow_view

struct Params {
    corner_count: u32,
    facet_count: u32,
    words_per_row: u32,
    // Texels from one direction's map to the next.
    map_stride: u32,
    // The mesh's lowest z; heights in the maps are relative to it.
    lowest: f32,
    // Heights that differ by less count as equal.
    same_height: f32,
    // The first view of this batch, and the number of all directions.
    first_view: u32,
    direction_count: u32,
}

// A triangle, or a piece of a large one; pieces share the number of their triangle.
struct Corners {
    a: vec3f,
    triangle: u32,
    b: vec3f,
    pad_b: u32,
    c: vec3f,
    pad_c: u32,
}

struct Facet {
    position: vec3f,
    pad_p: u32,
    normal: vec3f,
    pad_n: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> views: array<View>;
@group(0) @binding(2) var<storage, read> corners: array<Corners>;
@group(0) @binding(3) var<storage, read> normals: array<vec4f>;
@group(0) @binding(4) var<storage, read> facets: array<Facet>;
// Bits of the height. They order as the heights do, because heights are not negative.
@group(0) @binding(5) var<storage, read_write> heights: array<atomic<u32>>;
// Triangle + 1; 0 if there is no surface.
@group(0) @binding(6) var<storage, read_write> triangles: array<atomic<u32>>;
// Each word holds the bits of 32 facets for one direction; the directions are adjacent.
@group(0) @binding(7) var<storage, read_write> visible: array<u32>;
// The direction of each view.
@group(0) @binding(8) var<storage, read> directions: array<u32>;

const THREADS: u32 = 64;

// Widens a row's span [left, right] to its crossing with the edge from a to b.
fn widen(span: vec2f, y: f32, a: vec2f, b: vec2f) -> vec2f {
    let low = select(b, a, a.y <= b.y);
    let high = select(a, b, a.y <= b.y);
    if y < low.y || y > high.y {
        return span;
    }
    let left = min(a.x, b.x);
    let right = max(a.x, b.x);
    let rise = high.y - low.y;
    if rise <= 0.0 {
        return vec2f(min(span.x, left), max(span.y, right));
    }
    let x = clamp(low.x + (y - low.y) * ((high.x - low.x) / rise), left, right);
    return vec2f(min(span.x, x), max(span.y, x));
}

// Draws one triangle on the torus: all texels whose centres it covers, edges included.
fn draw(index: u32, direction: u32, writes_triangles: bool) {
    let view = views[params.first_view + direction];
    let piece = corners[index];
    let a = vec3f(texel_of(view, piece.a), piece.a.z - params.lowest);
    let b = vec3f(texel_of(view, piece.b), piece.b.z - params.lowest);
    let c = vec3f(texel_of(view, piece.c), piece.c.z - params.lowest);
    let ab = b - a;
    let ac = c - a;
    let area = ab.x * ac.y - ab.y * ac.x;
    if area == 0.0 {
        return;
    }
    let slope_x = (ab.z * ac.y - ac.z * ab.y) / area;
    let slope_y = (ac.z * ab.x - ab.z * ac.x) / area;
    let z_lo = min(min(a.z, b.z), c.z);
    let z_hi = max(max(a.z, b.z), c.z);
    let first_row = i32(ceil(min(min(a.y, b.y), c.y)));
    let last_row = i32(floor(max(max(a.y, b.y), c.y)));
    let map = direction * params.map_stride;
    for (var row = first_row; row <= last_row; row++) {
        let y = f32(row);
        var span = vec2f(3.0e38, -3.0e38);
        span = widen(span, y, a.xy, b.xy);
        span = widen(span, y, b.xy, c.xy);
        span = widen(span, y, c.xy, a.xy);
        if span.x > span.y {
            continue;
        }
        let first = i32(ceil(span.x));
        let last = i32(floor(span.y));
        let row_start = map + wrap(row, view.rows) * view.columns;
        var column = wrap(first, view.columns);
        let start = a.z + (y - a.y) * slope_y;
        for (var x = first; x <= last; x++) {
            let z = abs(clamp(start + (f32(x) - a.x) * slope_x, z_lo, z_hi));
            let texel = row_start + column;
            if writes_triangles {
                if z + params.same_height >= bitcast<f32>(atomicLoad(&heights[texel])) {
                    atomicMax(&triangles[texel], piece.triangle + 1u);
                }
            } else if bitcast<u32>(z) > atomicLoad(&heights[texel]) {
                atomicMax(&heights[texel], bitcast<u32>(z));
            }
            column++;
            if column == view.columns {
                column = 0u;
            }
        }
    }
}

@compute @workgroup_size(THREADS)
fn draw_heights(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var k = id.x; k < params.corner_count; k += groups.x * THREADS) {
        draw(k, id.y, false);
    }
}

@compute @workgroup_size(THREADS)
fn draw_triangles(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var k = id.x; k < params.corner_count; k += groups.x * THREADS) {
        draw(k, id.y, true);
    }
}

// Bilinear weight of the rays around the facet that are blocked.
fn blocked_weight(view: View, map: u32, p: vec3f, n: vec3f) -> f32 {
    let at = texel_of(view, p);
    let base = floor(at);
    let f = at - base;
    let per_height = 1.0 / view.direction.z;
    let n_dot_w = dot(n, view.direction) * per_height;
    var weight = 0.0;
    for (var k = 0; k < 4; k++) {
        let corner = vec2i(k & 1, k >> 1);
        let x = wrap(i32(base.x) + corner.x, view.columns);
        let y = wrap(i32(base.y) + corner.y, view.rows);
        let texel = map + y * view.columns + x;
        let triangle = atomicLoad(&triangles[texel]);
        if triangle == 0u {
            continue;
        }
        let n_k = normals[triangle - 1u].xyz;
        let step = vec2f(corner) - f;
        let across = step.x * view.plane_from_texel.xy + step.y * view.plane_from_texel.zw;
        let up = bitcast<f32>(atomicLoad(&heights[texel])) - (p.z - params.lowest);
        let before_facet = dot(n.xy, across) + up * n_dot_w;
        let facing = dot(n_k, view.direction) * per_height;
        let plane_before_p = (dot(n_k.xy, across) + up * facing) * sign(facing);
        if before_facet > view.tolerance && plane_before_p > view.tolerance {
            weight += select(1.0 - f.x, f.x, corner.x == 1) * select(1.0 - f.y, f.y, corner.y == 1);
        }
    }
    return weight;
}

@compute @workgroup_size(THREADS)
fn test_facets(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let view = views[params.first_view + id.y];
    let map = id.y * params.map_stride;
    for (var word = id.x; word < params.words_per_row; word += groups.x * THREADS) {
        var bits = 0u;
        let first = word * 32u;
        let count = min(32u, params.facet_count - first);
        for (var k = 0u; k < count; k++) {
            let facet = facets[first + k];
            if dot(facet.normal, view.direction) > 0.0
                && blocked_weight(view, map, facet.position, facet.normal) < 0.5 {
                bits |= 1u << k;
            }
        }
        visible[word * params.direction_count + directions[params.first_view + id.y]] = bits;
    }
}
