// Drafts of objects that a viewer sees through: one thread per point, then one per pixel of the background. The twin of
// `render` without paths (src/render/seen_through/image.rs).

//!import flat_index
//!import backdrop

struct View {
    backdrop: Backdrop,
    // Eye, and deviation of the position within a pixel at unit depth.
    eye: vec4f,
    // Axes of the camera, with the tangents of half the field of view.
    right: vec4f,
    up: vec4f,
    back: vec4f,
    // Width and height of the image, number of points.
    counts: vec4u,
}

struct Point {
    position: vec3f,
    pixel: u32,
    normal: vec4f,
    tangent: vec4f,
}

// The part of the light of one bundle, its mean direction and covariance, and its tail.
struct Lobe {
    part: vec4f,
    mean: vec4f,
    rest: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(4) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(5) var<storage, read> points: array<Point>;
@group(0) @binding(6) var<storage, read_write> radiance: array<vec4f>;

// Nodes per side of the table of lobes, and vectors of a node.
const SIDE: u32 = 33u;
const PER_NODE: u32 = 8u;
const LEAST_TAIL: f32 = 0.02;
const TAIL: f32 = 8.0;

// The backdrop in a pixel, as the camera sees it.
fn behind_pixel(pixel: u32) -> vec3f {
    let at = vec2f(vec2u(pixel % view.counts.x, pixel / view.counts.x)) + 0.5;
    let ndc = (2.0 * at / vec2f(view.counts.xy) - 1.0) * vec2f(view.right.w, view.up.w);
    let d = view.right.xyz * ndc.x - view.up.xyz * ndc.y - view.back.xyz;
    let scale = view.eye.w / length(d);
    var footprint: Footprint;
    footprint.direction[0] = scale * view.right.xyz;
    footprint.direction[1] = scale * view.up.xyz;
    return backdrop_read(view.backdrop, view.eye.xyz, normalize(d), footprint);
}

// The lobes of a viewer, interpolated.
fn lobes_at(o: vec3f) -> array<vec4f, 8> {
    let last = f32(SIDE - 1u);
    let at = clamp(0.5 * (o.xy / (1.0 + max(o.z, 0.0)) + 1.0) * last, vec2f(0.0), vec2f(last - 1e-3));
    let corner = vec2u(at);
    let f = at - vec2f(corner);
    let k = corner.y * SIDE + corner.x;
    var sum: array<vec4f, 8>;
    for (var n = 0u; n < PER_NODE; n++) {
        let low = mix(nodes[k * PER_NODE + n], nodes[(k + 1u) * PER_NODE + n], f.x);
        let high = mix(nodes[(k + SIDE) * PER_NODE + n], nodes[(k + SIDE + 1u) * PER_NODE + n], f.x);
        sum[n] = mix(low, high, f.y);
    }
    return sum;
}

struct Frame {
    position: vec3f,
    axes: mat3x3f,
    spread: array<vec3f, 2>,
}

// The read of a lobe around `d` with this covariance of tangential components.
fn read_around(frame: Frame, d: vec3f, covariance: vec3f) -> vec3f {
    let first = sqrt(max(covariance.x, 0.0));
    let across = select(0.0, covariance.y / first, first > 0.0);
    let second = sqrt(max(covariance.z - across * across, 0.0));
    // The vertical component keeps the length at 1.
    let z = select(1.0, -1.0, d.z < 0.0) * max(abs(d.z), 0.1);
    var footprint: Footprint;
    footprint.position = frame.spread;
    footprint.direction[0] = frame.axes * vec3f(first, across, -(d.x * first + d.y * across) / z);
    footprint.direction[1] = frame.axes * vec3f(0.0, second, -(d.y * second) / z);
    return backdrop_read(view.backdrop, frame.position, frame.axes * d, footprint);
}

fn of_lobe(frame: Frame, lobe: Lobe, o: vec3f, side: f32) -> vec3f {
    let part = lobe.part.xyz;
    if all(part == vec3f(0.0)) {
        return vec3f(0.0);
    }
    // The means of the table are relative to the straight direction.
    var mean = lobe.mean.xy - o.xy;
    mean *= min(0.999 / max(length(mean), 1e-12), 1.0);
    let d = vec3f(mean, side * sqrt(1.0 - dot(mean, mean)));
    let covariance = vec3f(lobe.mean.zw, lobe.rest.x);
    var value = read_around(frame, d, covariance);
    let tail = lobe.part.w;
    if tail * max(part.x, max(part.y, part.z)) > LEAST_TAIL {
        value = mix(value, read_around(frame, d, covariance * TAIL), tail);
    }
    return part * value;
}

fn of_point(point: Point) -> vec3f {
    let to_eye = view.eye.xyz - point.position;
    let extent = view.eye.w * length(to_eye);
    var frame: Frame;
    frame.position = point.position;
    frame.axes = mat3x3f(point.tangent.xyz, cross(point.normal.xyz, point.tangent.xyz), point.normal.xyz);
    frame.spread[0] = extent * view.right.xyz;
    frame.spread[1] = extent * view.up.xyz;
    let o = normalize(to_eye * frame.axes);
    let lobes = lobes_at(o);
    var sum = of_lobe(frame, Lobe(lobes[0], lobes[1], lobes[2]), o, -1.0);
    sum += of_lobe(frame, Lobe(lobes[3], lobes[4], lobes[5]), o, 1.0);
    if any(lobes[6].xyz != vec3f(0.0)) {
        sum += lobes[6].xyz * behind_pixel(point.pixel);
    }
    if any(lobes[7].xyz != vec3f(0.0)) {
        sum += lobes[7].xyz * read_around(frame, vec3f(-o.xy, o.z), vec3f(0.0));
    }
    sum += lobes[2].yzw * backdrop_even(view.backdrop, -point.normal.xyz);
    return sum + lobes[5].yzw * backdrop_even(view.backdrop, point.normal.xyz);
}

@compute @workgroup_size(64)
fn seen_through(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    if k >= view.counts.z + view.counts.x * view.counts.y {
        return;
    }
    if k < view.counts.z {
        radiance[k] = vec4f(of_point(points[k]), 1.0);
    } else {
        radiance[k] = vec4f(behind_pixel(k - view.counts.z), 1.0);
    }
}
