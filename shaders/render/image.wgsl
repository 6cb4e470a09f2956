// Gathers points into pixels: the twin of `gather` (src/render/image/shading.rs) and of src/render/image/tone_map.rs.

//!import point

struct Params {
    // Radiance of a uniform background, if `is_wall` is 0; else the background is a wall.
    background: vec3f,
    is_wall: u32,
    // Size of the image in pixels.
    size: vec2u,
    // The first row of pixels of this band, and the number of its rows.
    first_row: u32,
    rows: u32,
    // Point slots per pixel.
    slots: u32,
    // Rows of radiance.
    slices: u32,
    // Factor on radiance, and whether the filmic curve follows.
    gain: f32,
    is_filmic: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> points: array<Point>;
@group(0) @binding(2) var<storage, read> radiance: array<vec4f>;

// Linear radiance of the whole image with the number of points of each pixel, or the image for a screen.
@group(1) @binding(0) var<storage, read_write> pixels: array<vec4f>;
@group(1) @binding(0) var image: texture_storage_2d<rgba8unorm, write>;

fn background_at(at: vec2u) -> vec3f {
    if params.is_wall == 0u {
        return params.background;
    }
    let size = vec2f(params.size);
    let p = (vec2f(at) + 0.5 - vec2f(0.5, 0.55) * size) / min(size.x, size.y);
    return vec3f(0.97, 1.0, 1.05) * (0.025 + 0.095 * exp(-3.2 * dot(p, p)));
}

// Radiance of a pixel, and its number of points.
fn pixel_radiance(pixel: u32, at: vec2u) -> vec4f {
    let plane = params.size.x * params.rows;
    let point_count = plane * params.slots;
    var covered = 0.0;
    var count = 0.0;
    var total = vec3f(0.0);
    for (var k = 0u; k < params.slots; k++) {
        let point = k * plane + pixel;
        let weight = points[point].weight;
        if weight == 0.0 {
            continue;
        }
        var sum = vec3f(0.0);
        for (var slice = 0u; slice < params.slices; slice++) {
            sum += radiance[slice * point_count + point].xyz;
        }
        covered += weight;
        count += 1.0;
        total += sum * weight;
    }
    if covered < 1.0 {
        total += background_at(at) * (1.0 - covered);
    }
    return vec4f(total, count);
}

// `x` clamped to 0..=high; a NaN becomes 0, because it is not above 0.
fn clamped(x: vec3f, high: f32) -> vec3f {
    return select(vec3f(0.0), min(x, vec3f(high)), x > vec3f(0.0));
}

fn tone_mapped(radiance: vec3f) -> vec3f {
    let exposed = radiance * params.gain;
    if params.is_filmic == 0u {
        return clamped(exposed, 1.0);
    }
    let x = clamped(exposed, 8.0);
    return x * (1.0 + 1.296875 * x) / (1.0 + 0.75 * x + 1.3125 * x * x);
}

fn srgb(linear: vec3f) -> vec3f {
    return select(1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055, 12.92 * linear, linear <= vec3f(0.0031308));
}

@compute @workgroup_size(8, 8)
fn write_radiance(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.size.x || id.y >= params.rows {
        return;
    }
    let at = vec2u(id.x, params.first_row + id.y);
    pixels[at.y * params.size.x + at.x] = pixel_radiance(id.y * params.size.x + id.x, at);
}

@compute @workgroup_size(8, 8)
fn write_image(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.size.x || id.y >= params.rows {
        return;
    }
    let at = vec2u(id.x, params.first_row + id.y);
    textureStore(image, at, vec4f(srgb(tone_mapped(pixel_radiance(id.y * params.size.x + id.x, at).xyz)), 1.0));
}
