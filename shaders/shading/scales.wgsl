// The factor that turns sums over facets into the effective BRDF.

// 1 / a_v(o) of each point; 0 if no facet is visible.
@group(0) @binding(5) var<storage, read_write> scales: array<f32>;

// Of the threads of a point, the one of the first slice of lights writes its scale.
fn set_scale(point: u32, slice: u32, scale: f32) {
    if slice == 0u {
        scales[point] = scale;
    }
}
