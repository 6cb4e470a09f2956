// A colour that no angle changes.

fn tint(base: vec3f, i_dot_h: f32) -> vec3f {
    return base;
}
