// A copy of a triangle that reaches into a cell: what tells whether a slice meets it first.
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
