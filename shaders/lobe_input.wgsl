// What lobes read: the vectors of a pair of directions and what they make with a normal (src/simd/lobes.rs).

struct Pair {
    i: vec3f,
    o: vec3f,
    h: vec3f,
    i_dot_h: f32,
}

struct Seen {
    n_dot_i: f32,
    n_dot_o: f32,
    n_dot_h: f32,
    // |n×h|², from |n-h|², which loses nothing near the mirror direction.
    sin2: f32,
}

fn see(n: vec3f, pair: Pair) -> Seen {
    let d = n - pair.h;
    let d2 = dot(d, d);
    return Seen(
        max(dot(n, pair.i), 0.0),
        max(dot(n, pair.o), 0.0),
        max(1.0 - 0.5 * d2, 1e-6),
        clamp(d2 * (1.0 - 0.25 * d2), 0.0, 1.0),
    );
}

fn is_lit(seen: Seen) -> bool {
    return seen.n_dot_i * seen.n_dot_o > 0.0;
}
