// One lobe of a group of facets, or two at once: a pipeline is compiled for which.

//!import table_nodes
//!import lobe_by_number

override FIRST: u32 = 1u;
override SECOND: u32 = 0u;

fn two_lobes(n: Seen, i_dot_h: f32) -> vec2f {
    return vec2f(
        lobe_by_number(FIRST, n, i_dot_h, nodes.shapes.x, nodes.scales.x),
        lobe_by_number(SECOND, n, i_dot_h, nodes.shapes.y, nodes.scales.y),
    );
}
