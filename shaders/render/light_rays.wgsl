// Visibility of the lights from each shading point: the twin of the CPU code in src/render/shadow/, with the same
// hierarchy. One thread traces the rays of one point to 32 lights.

//!import shading_points

struct Node {
    low: vec3f,
    // Leaf: its first blocker. Inner node: its first child; the second follows it.
    first: u32,
    high: vec3f,
    // Blockers of a leaf; 0 for an inner node.
    count: u32,
}

// A triangle as a corner and two edges.
struct Blocker {
    corner: vec3f,
    pad_c: u32,
    edge_1: vec3f,
    pad_1: u32,
    edge_2: vec3f,
    pad_2: u32,
}

@group(1) @binding(0) var<storage, read> nodes: array<Node>;
@group(1) @binding(1) var<storage, read> blockers: array<Blocker>;
// The start of the rays of each point.
@group(1) @binding(2) var<storage, read> origins: array<vec4f>;
@group(1) @binding(3) var<storage, read_write> visible: array<u32>;

// More than the deepest hierarchy (60 levels).
const STACK: u32 = 64;

// Möller and Trumbore 1997.
fn is_hit(blocker: Blocker, origin: vec3f, direction: vec3f) -> bool {
    let p = cross(direction, blocker.edge_2);
    let determinant = dot(blocker.edge_1, p);
    if determinant == 0.0 {
        return false;
    }
    let inverse = 1.0 / determinant;
    let offset = origin - blocker.corner;
    let u = dot(offset, p) * inverse;
    if !(u >= 0.0 && u <= 1.0) {
        return false;
    }
    let q = cross(offset, blocker.edge_1);
    let v = dot(direction, q) * inverse;
    return v >= 0.0 && u + v <= 1.0 && dot(blocker.edge_2, q) * inverse > 0.0;
}

// Returns true if a ray meets a node's box, by the slab test. The margin keeps flat boxes despite rounding.
fn is_entered(index: u32, origin: vec3f, inverse: vec3f) -> bool {
    let t_low = (nodes[index].low - origin) * inverse;
    let t_high = (nodes[index].high - origin) * inverse;
    let near = min(t_low, t_high);
    let far = max(t_low, t_high);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    let leave = min(far.x, min(far.y, far.z));
    return !(enter > leave * 1.000001);
}

fn is_blocked(origin: vec3f, direction: vec3f) -> bool {
    // Very large numbers in place of infinities, which shaders need not support.
    let inverse = select(clamp(1.0 / direction, vec3f(-1e30), vec3f(1e30)), vec3f(1e30), abs(direction) < vec3f(1e-30));
    var stack: array<u32, STACK>;
    stack[0] = 0u;
    var depth = select(0u, 1u, is_entered(0u, origin, inverse));
    while depth > 0u {
        depth--;
        let first = nodes[stack[depth]].first;
        let count = nodes[stack[depth]].count;
        if count > 0u {
            for (var k = first; k < first + count; k++) {
                if is_hit(blockers[k], origin, direction) {
                    return true;
                }
            }
            continue;
        }
        for (var child = first; child <= first + 1u; child++) {
            if depth < STACK && is_entered(child, origin, inverse) {
                stack[depth] = child;
                depth++;
            }
        }
    }
    return false;
}

@compute @workgroup_size(64)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if is_empty(point) {
        return;
    }
    let origin = origins[point].xyz;
    let normal = points[point].normal;
    var bits = 0u;
    let first = 32u * id.y;
    let count = min(32u, params.light_count - first);
    for (var k = 0u; k < count; k++) {
        let direction = lights[first + k].direction;
        if dot(direction, normal) > 0.0 && !is_blocked(origin, direction) {
            bits |= 1u << k;
        }
    }
    visible[point * params.words_per_point + id.y] = bits;
}
