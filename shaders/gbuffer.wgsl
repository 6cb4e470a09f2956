// The G-buffer: the twin of src/large_scale/gbuffer.rs, whose rules it follows.
//
// The raster pipeline only finds which triangle each sample shows; `resolve` then meets the sample's ray with that
// triangle's plane and interpolates, so that positions and frames do not depend on how a driver interpolates.

//!import vectors

struct Camera {
    eye: vec3f,
    near: f32,
    right: vec3f,
    tan_half_fov_x: f32,
    up: vec3f,
    tan_half_fov_y: f32,
    back: vec3f,
    // Smallest cosine between a shading normal and the direction to the viewer.
    least_cosine: f32,
    // Samples across and down.
    size: vec2u,
    // The first row of samples in the output, and how many rows it holds.
    first_row: u32,
    rows: u32,
}

struct Vertex {
    position: vec3f,
    pad_p: u32,
    normal: vec3f,
    pad_n: u32,
    tangent: vec3f,
    pad_t: u32,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
// Three vertices a triangle.
@group(0) @binding(2) var<storage, read> indices: array<u32>;

@group(1) @binding(0) var shown: texture_2d<u32>;
@group(1) @binding(1) var<storage, read_write> triangles: array<u32>;
// Three numbers a sample in each.
@group(1) @binding(2) var<storage, read_write> positions: array<f32>;
@group(1) @binding(3) var<storage, read_write> normals: array<f32>;
@group(1) @binding(4) var<storage, read_write> tangents: array<f32>;

const NOTHING: u32 = 0xffffffffu;

struct Projected {
    @builtin(position) clip: vec4f,
    // Triangle + 1; 0 is the background.
    @location(0) @interpolate(flat, either) triangle: u32,
}

@vertex
fn project(@builtin(vertex_index) corner: u32) -> Projected {
    let offset = vertices[indices[corner]].position - camera.eye;
    let x = dot(offset, camera.right) / camera.tan_half_fov_x;
    let y = dot(offset, camera.up) / camera.tan_half_fov_y;
    // Reversed depth, near / distance: 1 at the near plane, 0 far away.
    return Projected(vec4f(x, y, camera.near, -dot(offset, camera.back)), corner / 3u + 1u);
}

@fragment
fn name_triangle(projected: Projected) -> @location(0) u32 {
    return projected.triangle;
}

// The unit vector nearest to the unit normal whose cosine with the viewer is at least `least_cosine`.
fn bent_towards(normal: vec3f, viewer: vec3f) -> vec3f {
    let cosine = dot(normal, viewer);
    if cosine >= camera.least_cosine {
        return normal;
    }
    let across = unit_or(normal - viewer * cosine, any_perpendicular(viewer));
    return viewer * camera.least_cosine + across * sqrt(1.0 - camera.least_cosine * camera.least_cosine);
}

fn perpendicular(tangent: vec3f, normal: vec3f) -> vec3f {
    let across = tangent - normal * dot(tangent, normal);
    if dot(across, across) > 1e-10 {
        return normalize(across);
    }
    return any_perpendicular(normal);
}

// Weights of the triangle's second and third corner where the ray from the eye meets its plane, kept in the triangle.
fn meet(ray: vec3f, a: vec3f, ab: vec3f, ac: vec3f) -> vec2f {
    let offset = camera.eye - a;
    let p = cross(ray, ac);
    let q = cross(offset, ab);
    let determinant = dot(ab, p);
    if determinant == 0.0 {
        return vec2f(0.0);
    }
    let weights = clamp(vec2f(dot(offset, p), dot(ray, q)) / determinant, vec2f(0.0), vec2f(1.0));
    return weights / max(weights.x + weights.y, 1.0);
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= camera.size.x || id.y >= camera.rows {
        return;
    }
    let sample = id.y * camera.size.x + id.x;
    let at = vec2u(id.x, camera.first_row + id.y);
    let name = textureLoad(shown, at, 0).x;
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    var tangent = vec3f(0.0);
    if name != 0u {
        let first = 3u * (name - 1u);
        let a = vertices[indices[first]];
        let b = vertices[indices[first + 1u]];
        let c = vertices[indices[first + 2u]];
        let ndc = (vec2f(at) + 0.5) / vec2f(camera.size) * 2.0 - 1.0;
        let ray = camera.right * (ndc.x * camera.tan_half_fov_x) - camera.up * (ndc.y * camera.tan_half_fov_y) - camera.back;
        let ab = b.position - a.position;
        let ac = c.position - a.position;
        let weights = meet(ray, a.position, ab, ac);
        let first_weight = 1.0 - weights.x - weights.y;
        position = a.position + ab * weights.x + ac * weights.y;
        let outside = cross(ab, ac);
        let side = select(1.0, -1.0, dot(outside, camera.eye - a.position) < 0.0);
        let mixed = a.normal * first_weight + b.normal * weights.x + c.normal * weights.y;
        let smooth_normal = unit_or(mixed, unit_or(outside, camera.back)) * side;
        let viewer = unit_or(camera.eye - position, camera.back);
        normal = bent_towards(smooth_normal, viewer);
        tangent = perpendicular(a.tangent * first_weight + b.tangent * weights.x + c.tangent * weights.y, normal);
    }
    triangles[sample] = select(name - 1u, NOTHING, name == 0u);
    for (var axis = 0u; axis < 3u; axis++) {
        positions[3u * sample + axis] = position[axis];
        normals[3u * sample + axis] = normal[axis];
        tangents[3u * sample + axis] = tangent[axis];
    }
}
