// A tint and the colour that multiplies it: the twin of Tint::at (src/effective/tint.rs).

//!import tint_fixed

struct Tint {
    // At i·h = 1.
    base: vec3f,
    // 1 if the tint follows tint(), 0 if it is constant.
    follows: f32,
    color: vec3f,
    pad: u32,
}

fn tint_at(row: Tint, i_dot_h: f32) -> vec3f {
    return mix(row.base, tint(row.base, i_dot_h), row.follows) * row.color;
}
