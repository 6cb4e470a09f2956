// Images at many resolutions, read with Gaussian footprints: the twin of Pyramid (src/render/seen_through/pyramid.rs).

// Plane, environment and even light: first level, number of levels, 1 if y wraps. Then the levels: width, height, first texel.
@group(0) @binding(1) var<storage, read> levels: array<vec4u>;
@group(0) @binding(2) var<storage, read> texels: array<vec4f>;
// Places [deviations] and weights of 3, 5, 7 and 9 reads along a line.
@group(0) @binding(3) var<storage, read> reads: array<vec2f>;

const MAX_PROBES: u32 = 9u;
const A: f32 = 1.0833334;
const B: f32 = 0.9166667;
const ROUND: f32 = 0.8;

struct Kernel {
    // Deviation along which several reads lie.
    along: vec2f,
    count: u32,
    level: u32,
    coarser: f32,
}

fn pyramid_size(pyramid: u32) -> vec2f {
    return vec2f(levels[levels[pyramid].x].xy);
}

fn variance_of(level: u32) -> f32 {
    return A * f32(1u << (2u * level)) - B;
}

// The reads of a footprint with the covariance xx, xy, yy [squared texels of level 0].
fn pyramid_kernel(pyramid: u32, covariance: vec3f) -> Kernel {
    let full = pyramid_size(pyramid);
    let count = levels[pyramid].y;
    let largest = 4.0 * max(full.x, full.y);
    let bound = largest * largest;
    let c = covariance * (bound / max(covariance.x + covariance.z, bound));
    let middle = 0.5 * (c.x + c.z);
    let skew = 0.5 * (c.x - c.z);
    let radius = sqrt(skew * skew + c.y * c.y);
    let major = middle + radius;
    var minor = max(max(middle - radius, 0.0), max(major / 14.0, A - B));
    let rest = major - minor;
    minor = select(minor + 0.5 * rest, minor, rest > ROUND * minor);
    let exponent = i32(bitcast<u32>((minor + B) / A) >> 23u) - 127;
    var kernel: Kernel;
    kernel.level = min(u32(max(exponent, 0)) / 2u, count - 1u);
    kernel.count = 1u;
    if kernel.level + 1u < count {
        let low = variance_of(kernel.level);
        kernel.coarser = clamp((minor - low) / (variance_of(kernel.level + 1u) - low), 0.0, 1.0);
        if rest > ROUND * minor {
            let axis = select(vec2f(c.y, radius - skew), vec2f(skew + radius, c.y), skew > 0.0);
            let longest = length(axis);
            kernel.along = select(vec2f(1.0, 0.0), axis / max(longest, 1e-30), longest > 1e-30) * sqrt(rest);
            kernel.count = clamp(u32(ceil(2.4 * sqrt(rest / minor))) | 1u, 3u, MAX_PROBES);
        }
    }
    return kernel;
}

fn wrapped(k: i32, n: i32) -> i32 {
    return ((k % n) + n) % n;
}

// Reads one level at `at` [texels of level 0].
fn pyramid_bilinear(pyramid: u32, level: u32, at: vec2f) -> vec3f {
    let header = levels[pyramid];
    let entry = levels[header.x + level];
    let size = vec2i(entry.xy);
    let place = clamp(at * (vec2f(size) / pyramid_size(pyramid)) - 0.5, vec2f(-1.6e7), vec2f(1.6e7));
    let low = floor(place);
    let f = place - low;
    let corner = vec2i(low);
    let columns = vec2i(wrapped(corner.x, size.x), wrapped(corner.x + 1, size.x));
    var rows = clamp(vec2i(corner.y, corner.y + 1), vec2i(0), vec2i(size.y - 1));
    if header.z == 1u {
        rows = vec2i(wrapped(corner.y, size.y), wrapped(corner.y + 1, size.y));
    }
    let first = i32(entry.z) + rows * size.x;
    let upper = mix(texels[first.x + columns.x], texels[first.x + columns.y], f.x);
    let lower = mix(texels[first.y + columns.x], texels[first.y + columns.y], f.x);
    return mix(upper, lower, f.y).xyz;
}

// The mean of the image under a footprint around `at` [texels of level 0].
fn pyramid_read(pyramid: u32, at: vec2f, kernel: Kernel) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < kernel.count; k++) {
        var read = vec2f(0.0, 1.0);
        if kernel.count > 1u {
            read = reads[(kernel.count / 2u - 1u) * MAX_PROBES + k];
        }
        let place = at + kernel.along * read.x;
        var value = pyramid_bilinear(pyramid, kernel.level, place);
        if kernel.coarser > 0.0 {
            value = mix(value, pyramid_bilinear(pyramid, kernel.level + 1u, place), kernel.coarser);
        }
        sum += read.y * value;
    }
    return sum;
}
