// A shading point: a position on the object where the material is evaluated (src/render/image/shading_points.rs).

struct Point {
    position: vec3f,
    // Share of its pixel; 0 if the slot is empty.
    weight: f32,
    normal: vec3f,
    triangle: u32,
    tangent: vec3f,
    pad: u32,
}
