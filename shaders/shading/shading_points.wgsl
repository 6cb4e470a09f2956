// The bindings of every pass over shading points: points, lights and radiance. Directions are computed as in
// src/render/image/shading.rs.

//!import vectors
//!import point

struct Params {
    eye: vec3f,
    point_count: u32,
    light_count: u32,
    words_per_point: u32,
    // Lights per thread.
    slice: u32,
    // A projected area below this counts as zero.
    min_area: f32,
}

struct Light {
    // Towards the light, in world space.
    direction: vec3f,
    pad_d: u32,
    irradiance: vec3f,
    pad_i: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> points: array<Point>;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
// Binding 3: the bits of shadows_bits.wgsl.
// One row of points for each slice of the lights; image.wgsl adds the rows.
@group(0) @binding(4) var<storage, read_write> radiance: array<vec4f>;
// Binding 5: scales.wgsl.

struct Frame {
    x: vec3f,
    y: vec3f,
    z: vec3f,
}

fn is_empty(point: u32) -> bool {
    return point >= params.point_count || points[point].weight == 0.0;
}

fn frame_of(point: u32) -> Frame {
    let z = points[point].normal;
    let x = points[point].tangent;
    return Frame(x, cross(z, x), z);
}

fn in_tangent(frame: Frame, d: vec3f) -> vec3f {
    return vec3f(dot(d, frame.x), dot(d, frame.y), dot(d, frame.z));
}

// The direction to the viewer in the tangent frame.
fn view_of(point: u32, frame: Frame) -> vec3f {
    return in_tangent(frame, unit_or(params.eye - points[point].position, frame.z));
}

// The end of a slice of the lights.
fn light_end(slice: u32) -> u32 {
    return min((slice + 1u) * params.slice, params.light_count);
}

fn add_radiance(point: u32, slice: u32, value: vec3f) {
    radiance[slice * params.point_count + point] += vec4f(value, 0.0);
}
