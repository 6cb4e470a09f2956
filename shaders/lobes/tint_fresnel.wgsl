// Schlick's Fresnel factor.

fn tint(base: vec3f, i_dot_h: f32) -> vec3f {
    let t = clamp(1.0 - i_dot_h, 0.0, 1.0);
    let t2 = t * t;
    return base + (1.0 - base) * (t2 * t2 * t);
}
