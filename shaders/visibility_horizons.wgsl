// Soft visibility above interpolated horizons: the twin of Horizons::fill (src/visibility/horizons.rs).

//!import angles
//!import facets

// Elevations [rad], the azimuths of a facet side by side.
@group(1) @binding(2) var<storage, read> horizons: array<f32>;

struct Sight {
    lower: u32,
    upper: u32,
    blend: f32,
    elevation: f32,
}

fn sight_along(d: vec3f) -> Sight {
    let at = turn_of(d.xy) * f32(sum.azimuths);
    let lower = u32(at) % sum.azimuths;
    return Sight(lower, (lower + 1u) % sum.azimuths, at - floor(at), angle_of(d.z, length(d.xy)));
}

fn visibility(facet: u32, sight: Sight) -> f32 {
    let row = facet * sum.azimuths;
    let lower = horizons[row + sight.lower];
    let horizon = lower + (horizons[row + sight.upper] - lower) * sight.blend;
    return clamp((sight.elevation - horizon) * sum.sharpness + 0.5, 0.0, 1.0);
}
