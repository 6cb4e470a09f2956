// The mean colour of a texture, of heights and of slopes within a pixel: the twin of ColorReads (src/color_map/reads.rs).
// Heitz et al. 2013, Secs. 4 and 5.

// Rows of deviations, columns of means.
@group(0) @binding(0) var color_table: texture_2d<f32>;
// 1/(1+Λ), mean and variance of visible slopes over ν/(1+ν).
@group(0) @binding(1) var<storage, read> directions: array<vec4f>;
// Mean and deviation of visible heights over the octave of 1+a, divided by 24.5.
@group(0) @binding(2) var<storage, read> heights: array<vec4f>;

const MAX_DEVIATION: f32 = 1.5;
const OCTAVES: f32 = 24.5;
const LEAST: f32 = 1e-7;

struct ColorAxis {
    // The mean of the first column, and columns per mean.
    low: f32,
    per_mean: f32,
}

// `within` holds mean and deviation of the driver in its deviations.
fn color_of_texture(axis: ColorAxis, within: vec2f) -> vec3f {
    let size = textureDimensions(color_table);
    let last = vec2f(size - 1u);
    let x = clamp((within.x - axis.low) * axis.per_mean, 0.0, last.x);
    let y = sqrt(clamp(within.y / MAX_DEVIATION, 0.0, 1.0)) * last.y;
    let at = min(vec2u(vec2f(x, y)), size - 2u);
    let f = vec2f(x, y) - vec2f(at);
    let low = mix(textureLoad(color_table, at, 0), textureLoad(color_table, at + vec2u(1u, 0u), 0), f.x);
    let high = mix(textureLoad(color_table, at + vec2u(0u, 1u), 0), textureLoad(color_table, at + 1u, 0), f.x);
    return mix(low, high, f.y).rgb;
}

fn direction_entry(nu: f32) -> vec4f {
    let last = arrayLength(&directions) - 1u;
    let above = clamp(nu, 0.0, 1e30);
    let x = above / (1.0 + above) * f32(last);
    let k = min(u32(x), last - 1u);
    return mix(directions[k], directions[k + 1u], x - f32(k));
}

fn height_entry(exponent: f32) -> vec4f {
    let last = arrayLength(&heights) - 1u;
    // The logarithm to base 2 at powers of 2, and linear between them.
    let octave = f32(bitcast<u32>(1.0 + exponent) - 0x3f800000u) / 8388608.0;
    let x = clamp(octave / OCTAVES, 0.0, 1.0) * f32(last);
    let k = min(u32(x), last - 1u);
    return mix(heights[k], heights[k + 1u], x - f32(k));
}

// `nu` holds ν of viewer and light, `apart` the difference of their azimuths from 0 to π.
fn color_of_heights(axis: ColorAxis, nu: vec2f, apart: f32, within: vec2f) -> vec3f {
    let lambda_o = 1.0 / max(direction_entry(nu.x).x, LEAST) - 1.0;
    let lambda_i = 1.0 / max(direction_entry(nu.y).x, LEAST) - 1.0;
    let independence = 4.41 * apart / (4.41 * apart + 1.0);
    let exponent = max(lambda_o, lambda_i) + independence * min(lambda_o, lambda_i);
    let seen = height_entry(exponent);
    return color_of_texture(axis, vec2f(within.x + within.y * seen.x, within.y * seen.y));
}

// `correlation` is that of the slopes towards the viewer and along the driver's azimuth.
fn color_of_slopes(axis: ColorAxis, nu: f32, correlation: f32, within: vec2f) -> vec3f {
    let seen = direction_entry(nu);
    let spread = sqrt(max(1.0 + correlation * correlation * (seen.z - 1.0), 0.0));
    return color_of_texture(axis, vec2f(within.x + within.y * correlation * seen.y, within.y * spread));
}
