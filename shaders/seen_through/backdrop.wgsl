// The backdrop of an object: an endless plane and the environment. The twin of Backdrop (src/render/seen_through/backdrop.rs).

//!import pyramid

const PI: f32 = 3.14159265358979;
const TAU: f32 = 6.28318530717959;
const PLANE: u32 = 0u;
const ENVIRONMENT: u32 = 1u;
const EVEN: u32 = 2u;
const LEAST_COSINE: f32 = 0.02;

struct Backdrop {
    // z, texels per world unit, texel of the axis x = y = 0.
    plane: vec4f,
    // Rotations of environment and even light, and 1 if there is a plane.
    rotations: vec4f,
}

// Deviations of the position and the direction of a bundle of rays.
struct Footprint {
    position: array<vec3f, 2>,
    direction: array<vec3f, 2>,
}

// The angle of the vector (x, y) from the x axis, to 1e-5 rad.
fn fast_angle(y: f32, x: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let ratio = min(a, b) / max(max(a, b), 1.2e-38);
    let s = ratio * ratio;
    let high = s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 - s * 0.0117212)));
    var angle = ratio * (0.99997726 + s * (-0.33262347 + high));
    angle = select(angle, 0.5 * PI - angle, b > a);
    angle = select(angle, PI - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}

fn surrounding_texel(pyramid: u32, rotation: f32, d: vec3f) -> vec2f {
    let theta = fast_angle(length(d.xz), d.y);
    let phi = fast_angle(d.x, -d.z) + rotation;
    return vec2f(phi / TAU + 0.5, theta / PI) * pyramid_size(pyramid);
}

fn added(covariance: vec3f, d: vec2f) -> vec3f {
    return covariance + vec3f(d.x * d.x, d.x * d.y, d.y * d.y);
}

fn environment_covariance(d: vec3f, turns: array<vec3f, 2>) -> vec3f {
    let sine = max(length(d.xz), 0.05);
    let across = vec3f(-d.z, 0.0, d.x) / sine;
    let down = vec3f(d.x * d.y / sine, -sine, d.z * d.y / sine);
    let scale = pyramid_size(ENVIRONMENT) / vec2f(TAU * sine, PI);
    var sum = vec3f(0.0);
    sum = added(sum, scale * vec2f(dot(turns[0], across), dot(turns[0], down)));
    return added(sum, scale * vec2f(dot(turns[1], across), dot(turns[1], down)));
}

fn plane_shift(shift: vec3f, d: vec3f, scale: f32) -> vec2f {
    let on_plane = shift - d * (shift.z / d.z);
    return vec2f(on_plane.x, -on_plane.y) * scale;
}

fn plane_covariance(backdrop: Backdrop, position: vec3f, direction: vec3f, footprint: Footprint) -> vec3f {
    let d = vec3f(direction.xy, min(direction.z, -LEAST_COSINE));
    let distance = max((backdrop.plane.x - position.z) / d.z, 0.0);
    let scale = backdrop.plane.y;
    var sum = added(vec3f(0.0), plane_shift(footprint.position[0], d, scale));
    sum = added(sum, plane_shift(footprint.position[1], d, scale));
    sum = added(sum, distance * plane_shift(footprint.direction[0], d, scale));
    return added(sum, distance * plane_shift(footprint.direction[1], d, scale));
}

fn part_below(z: f32, tilt: f32) -> f32 {
    if abs(z) >= 2.5 * tilt {
        return select(0.0, 1.0, z < 0.0);
    }
    return 1.0 / (1.0 + exp(1.702 * z / tilt));
}

// The mean radiance that arrives at `position` against the directions around `d`, by one filtered read.
fn backdrop_read(backdrop: Backdrop, position: vec3f, d: vec3f, footprint: Footprint) -> vec3f {
    let tilt = length(vec2f(footprint.direction[0].z, footprint.direction[1].z));
    let to_plane = backdrop.rotations.z * part_below(d.z, tilt);
    var sum = vec3f(0.0);
    if to_plane > 0.0 {
        let below = vec3f(d.xy, min(d.z, -1e-4));
        let hit = position + below * ((backdrop.plane.x - position.z) / below.z);
        let at = vec2f(hit.x, -hit.y) * backdrop.plane.y + backdrop.plane.zw;
        let kernel = pyramid_kernel(PLANE, plane_covariance(backdrop, position, d, footprint));
        sum += to_plane * pyramid_read(PLANE, at, kernel);
    }
    if to_plane < 1.0 {
        let kernel = pyramid_kernel(ENVIRONMENT, environment_covariance(d, footprint.direction));
        let at = surrounding_texel(ENVIRONMENT, backdrop.rotations.x, d);
        sum += (1.0 - to_plane) * pyramid_read(ENVIRONMENT, at, kernel);
    }
    return sum;
}

// The mean radiance of the hemisphere around `axis`, weighted by the cosine.
fn backdrop_even(backdrop: Backdrop, axis: vec3f) -> vec3f {
    return pyramid_bilinear(EVEN, 0u, surrounding_texel(EVEN, backdrop.rotations.y, axis));
}
