// A tint that does not depend on the angle.

fn tint(base: vec3f, i_dot_h: f32) -> vec3f {
    return base;
}
