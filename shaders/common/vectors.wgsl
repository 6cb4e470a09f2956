// Small vector helpers.

// The unit vector along v, or the fallback if v has no length.
fn unit_or(v: vec3f, fallback: vec3f) -> vec3f {
    let squared = dot(v, v);
    if !(squared > 0.0) {
        return fallback;
    }
    return v * inverseSqrt(squared);
}

fn half_vector(i: vec3f, o: vec3f) -> vec3f {
    return unit_or(i + o, vec3f(0.0, 0.0, 1.0));
}

// Any unit vector perpendicular to the unit vector n (Duff et al. 2017).
fn any_perpendicular(n: vec3f) -> vec3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return vec3f(b, s + n.y * n.y * a, -n.y);
}
