// A place on the object where the material is evaluated (src/large_scale/shading_points.rs).

struct Point {
    position: vec3f,
    // Share of its pixel; 0 where there is nothing to shade.
    weight: f32,
    normal: vec3f,
    triangle: u32,
    tangent: vec3f,
    pad: u32,
}
