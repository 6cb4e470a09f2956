// The input of lobes: a pair of directions, and their angles to a normal (src/math/simd/lobes.rs).

struct Pair {
    i: vec3f,
    o: vec3f,
    h: vec3f,
    i_dot_h: f32,
}

struct LobeAngles {
    n_dot_i: f32,
    n_dot_o: f32,
    n_dot_h: f32,
    // |n×h|², computed from |n-h|², which keeps precision near the mirror direction.
    sin2: f32,
}

fn lobe_angles(normal: vec3f, pair: Pair) -> LobeAngles {
    let d = normal - pair.h;
    let d2 = dot(d, d);
    return LobeAngles(
        max(dot(normal, pair.i), 0.0),
        max(dot(normal, pair.o), 0.0),
        max(1.0 - 0.5 * d2, 1e-6),
        clamp(d2 * (1.0 - 0.25 * d2), 0.0, 1.0),
    );
}

fn is_lit(angles: LobeAngles) -> bool {
    return angles.n_dot_i * angles.n_dot_o > 0.0;
}
