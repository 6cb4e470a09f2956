// One lobe of a group of facets, or two at once. The overrides hold the numbers of lobe_by_number.wgsl.

//!import table_nodes
//!import lobe_by_number

override FIRST: u32 = 1u;
override SECOND: u32 = 0u;

fn two_lobes(angles: LobeAngles, i_dot_h: f32) -> vec2f {
    return vec2f(
        lobe_by_number(FIRST, angles, i_dot_h, nodes.shapes.x, nodes.scales.x),
        lobe_by_number(SECOND, angles, i_dot_h, nodes.shapes.y, nodes.scales.y),
    );
}
