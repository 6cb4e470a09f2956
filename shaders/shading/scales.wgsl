// The factor that turns sums over facets into the effective BRDF.

// 1 / a_v(o) of each point; 0 if no facet is visible.
@group(0) @binding(5) var<storage, read_write> scales: array<f32>;
