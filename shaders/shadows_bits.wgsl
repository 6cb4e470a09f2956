// Which lights each point sees, one bit each (src/large_scale/shadow.rs, Visible).

//!import shading_points

@group(0) @binding(3) var<storage, read> visible: array<u32>;

fn sees_light(point: u32, light: u32) -> bool {
    let word = visible[point * params.words_per_point + light / 32u];
    return ((word >> (light % 32u)) & 1u) == 1u;
}
