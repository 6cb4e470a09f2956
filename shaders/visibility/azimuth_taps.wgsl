// Soft visibility along a direction as a function of the slopes of a facet's horizons at the two azimuths around it: the
// twin of HorizonMap::taps (src/visibility/horizon_map.rs) and HorizonTaps (src/math/simd/visibility.rs).

//!import angles
//!import facets

struct VisibilityTaps {
    lower: u32,
    upper: u32,
    blend: f32,
    base: f32,
    scale: f32,
    scales: vec2f,
}

// HorizonMap::MIN_COSINE.
const MIN_COSINE: f32 = 1e-6;

// The sine of an angle in [0, π/2], within 2e-9 plus rounding (Abramowitz and Stegun, 4.3.97).
fn sine(x: f32) -> f32 {
    let s = x * x;
    let high = s * (-0.000198409 + s * (0.0000027526 - s * 0.0000000239));
    return x * (1.0 + s * (-0.1666666664 + s * (0.0083333315 + high)));
}

fn visibility_taps(d: vec3f) -> VisibilityTaps {
    let scale = max(length(d.xy), MIN_COSINE) * sum.sharpness;
    let base = 0.5 + d.z * sum.sharpness;
    if any(sum.across != vec2f(0.0)) {
        // The slope of a wall, times its cosine, times that of the elevation.
        let over_walls = dot(sum.across, d.xy);
        let along_walls = sum.across.x * d.y - sum.across.y * d.x;
        let scales = vec2f(max(abs(over_walls), MIN_COSINE), abs(along_walls)) * sum.sharpness;
        let quarter = select(select(2u, 1u, along_walls >= 0.0), select(3u, 0u, along_walls >= 0.0), over_walls >= 0.0);
        return VisibilityTaps(
            quarter, (quarter + 1u) % 4u, 0.0, base, scale, select(scales, scales.yx, quarter % 2u == 1u));
    }
    let at = azimuth_in_turns(d.xy) * f32(sum.azimuths);
    let lower = u32(at) % sum.azimuths;
    let blend = at - floor(at);
    // Over a small step the weights are linear.
    let step = select(TAU / f32(sum.azimuths), 1e-3, sum.azimuths < 4u);
    let weights = vec2f(sine((1.0 - blend) * step), sine(blend * step)) / sine(step);
    return VisibilityTaps(lower, (lower + 1u) % sum.azimuths, blend, base, scale, scale * weights);
}

// Soft visibility above the horizon between two slopes. Values outside of [0, 1] count as 0 and 1.
fn between(taps: VisibilityTaps, horizons: vec2f) -> f32 {
    // Beside a horizon, the slope 0 keeps the interpolation to it exact. The CPU stores 0 there.
    let slopes = select(horizons, max(horizons, vec2f(0.0)), max(horizons.x, horizons.y) > 0.0);
    return taps.base - taps.scales.x * slopes.x - taps.scales.y * slopes.y;
}
