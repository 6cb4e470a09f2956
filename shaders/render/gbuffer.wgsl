// The G-buffer and its shading points: the twin of src/render/image/gbuffer.rs and shading_points.rs, with the same
// rules.
//
// The raster pipeline only finds the triangle of each sample. `find_points` then intersects the sample's ray with that
// triangle's plane and interpolates, so that positions and frames do not depend on the driver. Samples of a pixel that
// show one smooth piece of surface share a point.

//!import vectors
//!import point

struct Camera {
    eye: vec3f,
    near: f32,
    right: vec3f,
    tan_half_fov_x: f32,
    up: vec3f,
    tan_half_fov_y: f32,
    back: vec3f,
    // Smallest cosine between a shading normal and the direction to the viewer.
    min_cosine: f32,
    // Samples across and down the image.
    size: vec2u,
    // The first row of pixels of this band, and the number of its rows.
    first_row: u32,
    rows: u32,
    // Samples per pixel side.
    samples: u32,
    // Extent of a pixel at distance 1.
    pixel_extent: f32,
    // Distance of the starts of shadow rays above the surface.
    lift: f32,
    two_sided: u32,
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
// Three vertices per triangle.
@group(0) @binding(2) var<storage, read> indices: array<u32>;

@group(1) @binding(0) var triangle_ids: texture_2d<u32>;
// The first sample of all pixels of the band, then the second of all pixels, and so on.
@group(1) @binding(1) var<storage, read_write> points: array<Point>;
// The start of the shadow rays of each point.
@group(1) @binding(2) var<storage, read_write> origins: array<vec4f>;

// True if the origins are used.
override SHADOWED: bool = true;

// The constants of shading_points.rs.
const MIN_NORMAL_COSINE: f32 = 0.99863;
const MIN_TANGENT_COSINE: f32 = 0.9962;

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
fn write_triangle_id(projected: Projected) -> @location(0) u32 {
    return projected.triangle;
}

// The unit vector nearest to the unit normal whose cosine with the viewer is at least `least_cosine`.
fn bent_towards(normal: vec3f, viewer: vec3f) -> vec3f {
    let cosine = dot(normal, viewer);
    if cosine >= camera.min_cosine {
        return normal;
    }
    let across = unit_or(normal - viewer * cosine, any_perpendicular(viewer));
    return viewer * camera.min_cosine + across * sqrt(1.0 - camera.min_cosine * camera.min_cosine);
}

fn perpendicular(tangent: vec3f, normal: vec3f) -> vec3f {
    let across = tangent - normal * dot(tangent, normal);
    if dot(across, across) > 1e-10 {
        return normalize(across);
    }
    return any_perpendicular(normal);
}

// Weights of the triangle's second and third corner at the ray from the eye, clamped to the triangle.
fn barycentric_weights(ray: vec3f, a: vec3f, ab: vec3f, ac: vec3f) -> vec2f {
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

// The surface at a sample.
struct Sample {
    // Triangle + 1; 0 for the background.
    triangle_id: u32,
    position: vec3f,
    normal: vec3f,
    tangent: vec3f,
}

fn sample_at(at: vec2u) -> Sample {
    let triangle_id = textureLoad(triangle_ids, at, 0).x;
    if triangle_id == 0u {
        return Sample();
    }
    let first = 3u * (triangle_id - 1u);
    let a = vertices[indices[first]];
    let b = vertices[indices[first + 1u]];
    let c = vertices[indices[first + 2u]];
    let ndc = (vec2f(at) + 0.5) / vec2f(camera.size) * 2.0 - 1.0;
    let ray = camera.right * (ndc.x * camera.tan_half_fov_x)
        - camera.up * (ndc.y * camera.tan_half_fov_y) - camera.back;
    let ab = b.position - a.position;
    let ac = c.position - a.position;
    let weights = barycentric_weights(ray, a.position, ab, ac);
    let first_weight = 1.0 - weights.x - weights.y;
    let position = a.position + ab * weights.x + ac * weights.y;
    let outside = cross(ab, ac);
    let side = select(1.0, -1.0, dot(outside, camera.eye - a.position) < 0.0);
    let mixed = a.normal * first_weight + b.normal * weights.x + c.normal * weights.y;
    let smooth_normal = unit_or(mixed, unit_or(outside, camera.back)) * side;
    let viewer = unit_or(camera.eye - position, camera.back);
    let normal = bent_towards(smooth_normal, viewer);
    let tangent = perpendicular(a.tangent * first_weight + b.tangent * weights.x + c.tangent * weights.y, normal);
    return Sample(triangle_id, position, normal, tangent);
}

// The start of shadow rays: the twin of `ray_origin` (src/render/shadow/).
fn ray_origin(triangle_id: u32, p: vec3f) -> vec3f {
    let first = 3u * (triangle_id - 1u);
    var corners: array<vec3f, 3>;
    for (var k = 0u; k < 3u; k++) {
        corners[k] = vertices[indices[first + k]].position;
    }
    let area = cross(corners[1] - corners[0], corners[2] - corners[0]);
    let squared = dot(area, area);
    if !(squared > 0.0) {
        return p;
    }
    let facing = select(1.0, -1.0, camera.two_sided == 1u && dot(area, camera.eye - corners[0]) < 0.0);
    var lift = vec3f(0.0);
    for (var k = 0u; k < 3u; k++) {
        let weight =
            clamp(dot(cross(corners[(k + 1u) % 3u] - p, corners[(k + 2u) % 3u] - p), area) / squared, 0.0, 1.0);
        let vertex_normal = vertices[indices[first + k]].normal * facing;
        lift -= vertex_normal * (weight * min(dot(p - corners[k], vertex_normal), 0.0));
    }
    return p + lift + area * inverseSqrt(squared) * (facing * camera.lift);
}

fn add_point(slot: u32, weight: f32, hit: Sample) {
    points[slot] = Point(hit.position, weight, hit.normal, hit.triangle_id - 1u, hit.tangent, 0u);
    if SHADOWED {
        origins[slot] = vec4f(ray_origin(hit.triangle_id, hit.position), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn find_points(@builtin(global_invocation_id) id: vec3u) {
    let side = camera.samples;
    let width = camera.size.x / side;
    if id.x >= width || id.y >= camera.rows {
        return;
    }
    let pixel = id.y * width + id.x;
    let plane = width * camera.rows;
    let corner = vec2u(id.x, camera.first_row + id.y) * side;
    let count = side * side;
    let share = 1.0 / f32(count);

    let first = sample_at(corner);
    let step = camera.pixel_extent * length(first.position - camera.eye);
    var is_shared = count > 1u && first.triangle_id != 0u;
    var normals = first.normal;
    var tangents = first.tangent;
    for (var k = 1u; k < count && is_shared; k++) {
        let other = sample_at(corner + vec2u(k % side, k / side));
        normals += other.normal;
        tangents += other.tangent;
        is_shared = other.triangle_id != 0u
            && dot(other.normal, first.normal) >= MIN_NORMAL_COSINE
            && dot(other.tangent, first.tangent) >= MIN_TANGENT_COSINE
            && abs(dot(other.position - first.position, first.normal)) <= step;
    }
    if is_shared {
        let normal = unit_or(normals * share, first.normal);
        let tangent = perpendicular(tangents * share, normal);
        // The position of one sample, not the mean: across a concave edge the mean lies inside the object, in shadow.
        add_point(pixel, 1.0, Sample(first.triangle_id, first.position, normal, tangent));
    }
    for (var k = select(0u, 1u, is_shared); k < count; k++) {
        let slot = k * plane + pixel;
        if is_shared {
            points[slot].weight = 0.0;
            continue;
        }
        let hit = sample_at(corner + vec2u(k % side, k / side));
        if hit.triangle_id == 0u {
            points[slot].weight = 0.0;
        } else {
            add_point(slot, share, hit);
        }
    }
}
