// A copy of a triangle that overlaps a cell; the first fields suffice to reject it.
struct Entry {
    // Corners in the plane.
    a: vec2f,
    b: vec2f,
    c: vec2f,
    z_max: f32,
    z_min: f32,
    heights: vec3f,
    triangle: u32,
}
