// Visibility of lights from each point, one bit per light (src/render/shadow/).

//!import shading_points

@group(0) @binding(3) var<storage, read> visible: array<u32>;

fn is_light_visible(point: u32, light: u32) -> bool {
    let word = visible[point * params.words_per_point + light / 32u];
    return ((word >> (light % 32u)) & 1u) == 1u;
}
