// What turns sums over facets into f̄.

// 1 / a_v(o) of each point, 0 where nothing shows.
@group(0) @binding(5) var<storage, read_write> scales: array<f32>;
