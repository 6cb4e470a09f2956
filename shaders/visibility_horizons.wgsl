// Soft visibility above interpolated horizons: the twin of Horizons::fill (src/visibility/horizons.rs).

//!import azimuth_sight

// Elevations [rad], the azimuths of a facet side by side.
@group(1) @binding(2) var<storage, read> horizons: array<f32>;

fn visibility(facet: u32, sight: Sight) -> f32 {
    let row = facet * sum.azimuths;
    let lower = horizons[row + sight.lower];
    let horizon = lower + (horizons[row + sight.upper] - lower) * sight.blend;
    return clamp((sight.elevation - horizon) * sum.sharpness + 0.5, 0.0, 1.0);
}
