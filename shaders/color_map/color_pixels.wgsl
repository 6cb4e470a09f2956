// Colours of many pixels: one thread each.

//!import flat_index
//!import color_reads

struct Pixel {
    // Mean and deviation within the pixel.
    within: vec2f,
    // ν of viewer and light.
    nu: vec2f,
    apart: f32,
    correlation: f32,
    // 0: texture, 1: heights, 2: slopes.
    driver: u32,
    pad: u32,
}

@group(0) @binding(3) var<uniform> axis: ColorAxis;
@group(0) @binding(4) var<storage, read> pixels: array<Pixel>;
@group(0) @binding(5) var<storage, read_write> colors: array<vec4f>;

@compute @workgroup_size(64)
fn color_pixels(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = flat_index(id, groups);
    if k >= arrayLength(&pixels) {
        return;
    }
    let pixel = pixels[k];
    var color: vec3f;
    switch pixel.driver {
        case 0u: { color = color_of_texture(axis, pixel.within); }
        case 1u: { color = color_of_heights(axis, pixel.nu, pixel.apart, pixel.within); }
        default: { color = color_of_slopes(axis, pixel.nu.x, pixel.correlation, pixel.within); }
    }
    colors[k] = vec4f(color, 1.0);
}
