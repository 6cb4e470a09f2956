// The four bilinear taps of a polar grid: the twin of PolarGrid::taps (src/math/directions/polar_grid.rs).

//!import angles

// Polar angle of the last ring: 89.9°.
const HORIZON: f32 = 1.56905099754262;

// The twin of PolarGrid::horizon_taper.
fn horizon_taper(z: f32) -> f32 {
    return min(z * 572.9581, 1.0);
}

struct Taps {
    nodes: vec4u,
    weights: vec4f,
}

fn ring_theta(ring: u32, rings: u32) -> f32 {
    return select((f32(ring) + 0.5) * HALF_PI / f32(rings), HORIZON, ring >= rings);
}

fn grid_taps(d: vec3f, rings: u32, azimuths: u32) -> Taps {
    let theta = angle_of(length(d.xy), d.z);
    let azimuth = azimuth_in_turns(d.xy);
    let at = theta / HALF_PI * f32(rings) - 0.5;
    // Inside the first ring, interpolation crosses the pole: ring -1 is ring 0, half a turn further.
    var lower = 0u;
    var upper = 0u;
    var t = at + 1.0;
    var lower_azimuth = fract(azimuth + 0.5);
    if at >= 0.0 {
        lower = min(u32(at), rings - 1u);
        upper = lower + 1u;
        let low = ring_theta(lower, rings);
        t = clamp((theta - low) / (ring_theta(upper, rings) - low), 0.0, 1.0);
        lower_azimuth = azimuth;
    }
    let along = vec2f(lower_azimuth, azimuth) * f32(azimuths);
    let floors = floor(along);
    let blend = along - floors;
    let first = vec2u(floors) % azimuths;
    let second = (first + 1u) % azimuths;
    let rows = vec2u(lower, upper) * azimuths;
    return Taps(
        vec4u(rows.x + first.x, rows.x + second.x, rows.y + first.y, rows.y + second.y),
        vec4f((1.0 - t) * (1.0 - blend.x), (1.0 - t) * blend.x, t * (1.0 - blend.y), t * blend.y),
    );
}
