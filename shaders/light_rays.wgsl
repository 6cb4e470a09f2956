// Which lights each shading point sees: the twin of `Occluder::visible` (src/large_scale/shadow.rs), ray by ray through
// the same hierarchy (src/large_scale/bvh.rs).

struct Params {
    // The points of this dispatch.
    first_point: u32,
    end_point: u32,
    light_count: u32,
    words_per_point: u32,
}

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

struct Point {
    // Where its rays start.
    origin: vec3f,
    pad_o: u32,
    normal: vec3f,
    pad_n: u32,
}

struct Light {
    direction: vec3f,
    pad_d: u32,
    // 1 / direction, very large where that is infinite.
    inverse: vec3f,
    pad_i: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> blockers: array<Blocker>;
@group(0) @binding(3) var<storage, read> points: array<Point>;
@group(0) @binding(4) var<storage, read> lights: array<Light>;
@group(0) @binding(5) var<storage, read_write> visible: array<u32>;

// The deepest hierarchy (60 levels) and a little more.
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

// Whether a ray meets a node's box, by the slab test; rounding must not lose boxes that are flat.
fn is_entered(index: u32, origin: vec3f, inverse: vec3f) -> bool {
    let t_low = (nodes[index].low - origin) * inverse;
    let t_high = (nodes[index].high - origin) * inverse;
    let near = min(t_low, t_high);
    let far = max(t_low, t_high);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    let leave = min(far.x, min(far.y, far.z));
    return !(enter > leave * 1.000001);
}

fn is_blocked(origin: vec3f, light: Light) -> bool {
    var stack: array<u32, STACK>;
    stack[0] = 0u;
    var depth = select(0u, 1u, is_entered(0u, origin, light.inverse));
    while depth > 0u {
        depth--;
        let first = nodes[stack[depth]].first;
        let count = nodes[stack[depth]].count;
        if count > 0u {
            for (var k = first; k < first + count; k++) {
                if is_hit(blockers[k], origin, light.direction) {
                    return true;
                }
            }
            continue;
        }
        for (var child = first; child <= first + 1u; child++) {
            if depth < STACK && is_entered(child, origin, light.inverse) {
                stack[depth] = child;
                depth++;
            }
        }
    }
    return false;
}

@compute @workgroup_size(64)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let at = params.first_point + id.x;
    if at >= params.end_point {
        return;
    }
    let point = points[at];
    var bits = 0u;
    let first = 32u * id.y;
    let count = min(32u, params.light_count - first);
    for (var k = 0u; k < count; k++) {
        let light = lights[first + k];
        if dot(light.direction, point.normal) > 0.0 && !is_blocked(point.origin, light) {
            bits |= 1u << k;
        }
    }
    visible[at * params.words_per_point + id.y] = bits;
}
